"""Runs a command again, in a process that starts afresh, where what stopped it may pass by itself."""

import os
import sys
import time

ATTEMPT = "VIEWBENCH_ATTEMPT"  # how often the command has been begun before
WAIT = "VIEWBENCH_ATTEMPT_WAIT"  # seconds to wait before this time
PASSING = 75  # exit status of a command that may work another time: EX_TEMPFAIL of sysexits.h
LONGEST_S = 600


def run(arguments: list[str]) -> int:
    """Exit status of the command; where it is PASSING and there are attempts left, this process becomes the next one.

    What the first one held (a GPU and its lock, memory, a library's state after an error) is gone by then: Python
    starts again, with the variables that this process had at first, and waits before it takes anything.
    """
    given = dict(os.environ)
    try:
        time.sleep(float(given.pop(WAIT, 0)))
    except KeyboardInterrupt:
        print("viewbench: stopped", file=sys.stderr)
        return 130
    from .commands import _main

    status = _main.run(arguments)
    if status == PASSING:
        before = int(given.get(ATTEMPT, 0))
        wait = _wait(before)
        if wait is not None:
            given |= {ATTEMPT: str(before + 1), WAIT: str(wait)}
            _become(arguments, given)
    return status


def _wait(before: int) -> float | None:
    """Seconds until the next attempt, which it announces; None after the last one."""
    from ..common import settings as settings_file

    compute = settings_file.load().compute
    if before >= compute.retries:
        return None
    wait = float(min(compute.retry_wait * 2**before, LONGEST_S))
    print(f"viewbench: tried again in {wait:g} s ({before + 1} of {compute.retries})", file=sys.stderr, flush=True)
    return wait


def _become(arguments: list[str], environment: dict[str, str]) -> None:
    sys.stdout.flush()
    os.closerange(3, 1 << 16)  # a driver's descriptors may be of those that a program hands on
    # -P: what lies in the folder that it stands in is no module, unless it was started so.
    safe = ["-P"] if sys.flags.safe_path or os.path.basename(sys.argv[0]) != "__main__.py" else []  # noqa: PTH119
    os.execve(sys.executable, [sys.executable, *safe, "-m", "viewbench", *arguments], environment)
