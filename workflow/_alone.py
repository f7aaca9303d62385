"""One run of a study at a time in a folder: a second one is refused, one that was killed leaves nothing to unlock.

The run holds results/STUDY/.run.json with a lock of the operating system, which goes when it ends, however it ends;
the file says who holds it. Snakemake's own lock files say nothing of who made them, and outlive a run that was killed:
those of this study are removed once it is held, since no living run can have made them. A file system between machines
may not carry locks, so what another machine wrote is broken by `--unlock` alone.
"""

import atexit
import contextlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..common import holding
from ..common.errors import UserError
from . import _clock

FILE = ".run.json"
SIGN_S = 30.0  # between two signs of life: the file's time is set
# What Snakemake does without running anything; a study that is being run can be looked at.
LOOKS = {
    *("--summary", "-S", "--detailed-summary", "-D", "--dag", "--rulegraph", "--filegraph", "--d3dag", "--lint"),
    *(
        "--list",
        "-l",
        "--list-rules",
        "--list-target-rules",
        "--list-untracked",
        "--lu",
        "--report",
        "--print-compilation",
    ),
    *("--list-changes", "--list-input-changes", "--list-params-changes", "--generate-unit-tests", "--containerize"),
}
_held: dict[Path, int] = {}  # open files of this process


@contextlib.contextmanager
def plainly(stop: Any = lambda: None) -> Iterator[None]:
    """A user's mistake, and a file system that takes no files, end Snakemake in one sentence, without a traceback."""
    try:
        yield
    except (UserError, OSError) as error:
        stop()
        print(f"viewbench: {_sentence(error)}", file=sys.stderr)
        raise SystemExit(2) from None


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        where = f": '{error.filename}'" if error.filename else ""
        return f"{error.strerror}{where}; see to that, and run the same command again"
    return str(error)


def claim(results: Path, arguments: list[str]) -> bool:
    """Holds results/STUDY for this process until it ends; whether it does, since some `arguments` only look.

    Raises UserError when another run holds it, or may hold it from another machine. With `--unlock` what another
    machine left is taken for dead.
    """
    if LOOKS & {argument.partition("=")[0] for argument in arguments}:
        return False
    path = results / FILE
    if path in _held:
        return True
    with _said(results):
        results.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        _allowed(results, handle, unlock="--unlock" in arguments)
        with _said(results):
            holding.write(handle, holding.me())
    except BaseException:
        os.close(handle)
        raise
    _held[path] = handle
    _remove_locks(results)
    ours = os.getpid()

    def release() -> None:
        if os.getpid() == ours and path in _held:
            with contextlib.suppress(OSError):
                holding.write(_held.pop(path), {})

    atexit.register(release)
    threading.Thread(target=_show_life, args=(path,), name="sign of life", daemon=True).start()
    return True


def refused(results: Path, unlock: bool = False) -> None:
    """Raises UserError where `claim` would; holds nothing."""
    with contextlib.suppress(FileNotFoundError), _said(results):
        handle = os.open(results / FILE, os.O_RDWR)
        try:
            _allowed(results, handle, unlock)
        finally:
            os.close(handle)


def running(results: Path) -> bool:
    """Whether another run holds, or may hold, results/STUDY."""
    if results / FILE in _held:
        return False
    try:
        refused(results)
    except UserError:
        return True
    return False


@contextlib.contextmanager
def _said(results: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        raise UserError(
            f"nothing can be written to '{results}': {error.strerror}; give it room and the right to write, and run "
            "the same command again"
        ) from None


def _allowed(results: Path, handle: int, unlock: bool) -> None:
    got = holding.lock(handle)
    for _ in range(5 if got is False else 0):  # who only asks holds it for a moment
        time.sleep(0.1)
        got = got or holding.lock(handle)
    record = holding.read(handle)
    near = holding.reaches(record)
    if got is False or (got is None and record and near and _lives(record.get("pid"))):
        raise UserError(
            f"'{results}' is being run already, by {holding.named(record)}; wait for it or stop it, then run the same "
            "command again"
        )
    if record and not near and not unlock:
        sign = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(os.fstat(handle).st_mtime))
        raise UserError(
            f"'{results}' is, or was, run by {holding.named(record)}, a machine that cannot be asked from here (its "
            f"last sign of life: {sign}); if nothing runs there any more, give the same command with --unlock once "
            "(viewbench run: behind --)"
        )


def _lives(pid: Any) -> bool:
    try:
        os.kill(int(pid), 0)
    except (OverflowError, ProcessLookupError, TypeError, ValueError):
        return False
    except PermissionError:
        return True
    return True


def _remove_locks(results: Path) -> None:
    """Removes Snakemake's locks on files of this study, which no living run can have made."""
    for lock in Path(".snakemake/locks").glob("*.lock"):
        with contextlib.suppress(OSError):
            if any(line.startswith(f"{results.as_posix()}/") for line in lock.read_text(encoding="utf-8").splitlines()):
                lock.unlink()


def _show_life(path: Path) -> None:
    watch, shown = _clock.Watch(), time.monotonic()
    while path in _held:
        time.sleep(1)
        with contextlib.suppress(OSError, KeyError):
            if watch.went_back():
                _clock.settle(path.parent)
            if time.monotonic() - shown > SIGN_S:
                shown = time.monotonic()
                os.utime(_held[path])
