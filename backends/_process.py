"""Runs a trainer that is a program of its own: as a list, never through a shell, and never outliving its caller."""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from ..common.errors import PassingError, UserError
from ._memory import Usage, watched
from ._passing import passes

KEPT = 4096  # bytes of a log's end in which its last line is looked for
PR_SET_PDEATHSIG = 1  # of Linux' prctl: the signal that a process gets when its parent dies


def run(command: Sequence[str], folder: Path, log: Path, what: str, timeout_s: float | None = None) -> Usage:
    """Runs `command` in `folder`, appends what it prints to `log`, and returns how much memory it took.

    The program leads a process group of its own, which is killed whole when the time is up or the caller is stopped,
    so that none of its children goes on with a model that nobody waits for. Raises UserError, with the program's last
    line, when it is not found, ends with another status than 0, or takes longer than `timeout_s`; PassingError where it
    says that memory was short, or the system killed it.
    """
    with open(log, "ab") as output:
        try:
            process = subprocess.Popen(
                list(command),
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                process_group=0,
                preexec_fn=_die_with_parent(),
            )
        except OSError as error:
            raise UserError(f"{what}: '{command[0]}' cannot be run: {error.strerror or error}") from None
        try:
            with watched(process.pid) as usage:
                try:
                    status = process.wait(timeout_s)
                except BaseException:
                    _kill_group(process)  # at once, and not when the watcher has looked
                    raise
        except subprocess.TimeoutExpired:
            raise UserError(f"{what}: stopped after {timeout_s:g} s; allow more time or less work") from None
        finally:
            _kill_group(process)
    if status != 0:
        ended = f"exit status {status}" if status > 0 else f"signal {signal.Signals(-status).name}"
        # Killed, and its caller is not: that is what the system does when the machine has no memory left.
        kind = PassingError if status == -signal.SIGKILL or passes(_end(log)) else UserError
        raise kind(f"{what} failed with {ended}: {last_line(log) or 'it printed nothing'}")
    return usage


def last_line(log: Path) -> str:
    """The last line with something on it."""
    lines = [line.strip() for line in _end(log).replace("\r", "\n").splitlines()]
    return next((line for line in reversed(lines) if line), "")


def _end(log: Path) -> str:
    with open(log, "rb") as file:
        file.seek(max(0, log.stat().st_size - KEPT))
        return file.read().decode("utf-8", "replace")


def _kill_group(process: subprocess.Popen) -> None:
    """Kills what is left of the group: the program if it still runs, and children that it left behind."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _die_with_parent() -> Callable[[], None] | None:
    """For Popen's preexec_fn: has Linux kill the program when this process is killed and cannot clean up."""
    if not sys.platform.startswith("linux"):
        return None
    prctl = ctypes.CDLL(None, use_errno=True).prctl  # looked up before the fork: only the call is made after it
    return lambda: prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) and None
