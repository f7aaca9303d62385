"""Has a command run by the study's fork server, where there is one; it says what that is.

Imported by every call of `viewbench`, so it imports little itself.
"""

import contextlib
import os
import signal
import sys
from pathlib import Path

ADDRESS = "VIEWBENCH_FORK_SERVER"  # path of the server's socket, for the jobs of a study
PASSED_ON = (signal.SIGINT, signal.SIGTERM)  # to the job, but those that are ignored here
PREFIX = "VIEWBENCH_FORK_SERVER_PREFIX"  # sys.prefix of the server: another environment's jobs are not its own
LENGTH = 4  # bytes before a request, which say how long it is


def run(arguments: list[str]) -> int | None:
    """Exit status of the command; None where no server is in reach, so that the command is to be run here."""
    if not os.environ.get(ADDRESS) or os.environ.get(PREFIX, sys.prefix) != sys.prefix:
        return None
    import json
    import socket

    ignored = [int(number) for number in PASSED_ON if signal.getsignal(number) == signal.SIG_IGN]
    request = {
        "arguments": arguments,
        "folder": str(Path.cwd()),
        "environment": dict(os.environ),
        "ignored": ignored,
    }
    pid = ""

    def pass_on(number: int, frame: object) -> None:
        if not pid:
            sys.exit(128 + number)  # which hangs up, and so ends the job
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.killpg(int(pid), number)

    before = {number: signal.signal(number, pass_on) for number in PASSED_ON if number not in ignored}
    content = json.dumps(request).encode()  # names that are not UTF-8 are escaped
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        try:
            connection.connect(os.environ[ADDRESS])
            socket.send_fds(connection, [len(content).to_bytes(LENGTH, "big")], [0, 1, 2])
            connection.sendall(content)
            lines = connection.makefile("r")
            pid = lines.readline()
        except OSError:
            pid = ""
        if not pid:
            for number, handler in before.items():
                signal.signal(number, handler)
            return None
        status = lines.readline()
    if not status:
        print("viewbench: the process that ran this is gone", file=sys.stderr)
        return 1
    return int(status)
