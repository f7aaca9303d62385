"""Has a command run by the study's fork server, where there is one; it says what that is.

Imported by every call of `viewbench`, so it imports little itself.
"""

import contextlib
import os
import signal
import sys
from pathlib import Path

ADDRESS = "VIEWBENCH_FORK_SERVER"  # path of the server's socket, for the jobs of a study
LENGTH = 4  # bytes before a request, which say how long it is


def run(arguments: list[str]) -> int | None:
    """Exit status of the command; None where no server is in reach, so that the command is to be run here."""
    if not os.environ.get(ADDRESS):
        return None
    import json
    import socket

    request = {"arguments": arguments, "folder": str(Path.cwd()), "environment": dict(os.environ)}
    content = json.dumps(request).encode()  # names that are not UTF-8 are escaped
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        try:
            connection.connect(os.environ[ADDRESS])
            socket.send_fds(connection, [len(content).to_bytes(LENGTH, "big")], [0, 1, 2])
            connection.sendall(content)
            lines = connection.makefile("r")
            pid = lines.readline()
        except OSError:
            return None
        if not pid:
            return None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda number, frame: _pass_on(int(pid), number))
        status = lines.readline()
    if not status:
        print("viewbench: the process that ran this is gone", file=sys.stderr)
        return 1
    return int(status)


def _pass_on(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):  # it has just ended
        os.killpg(pid, number)
