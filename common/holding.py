"""Which process holds a file, on which machine, and whether that process may still live.

A lock of the operating system (flock) says it without a doubt where it reaches: it goes with the process, however that
ends, and NFS, Lustre and GPFS carry it between machines unless they are mounted without. A record in the file says the
rest: who holds it, and whether it was written where flock cannot be trusted to reach.
"""

import contextlib
import functools
import json
import os
import shutil
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import UserError

try:
    import fcntl
except ImportError:  # Windows has no flock: there nothing is locked, and nothing of others is removed
    fcntl = None

TEMPORARY = ".part-"  # begins the names of files that are being written
WRITER = ".writer"  # in a folder that one process writes at a time
OLD_S = 86400.0  # a temporary file that is older was left by a writer that is dead, wherever it ran
YOUNG_S = 2.0  # it may not be locked yet
LOOK_S = 0.2  # between two tries to get what another holds
SLEEP_S = 0.01


def lock(handle: int) -> bool | None:
    """Locks an open file until it is closed: True if it is ours now, False if it is another's, None if files cannot
    be locked here."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def machine() -> dict[str, str]:
    """This machine's name, its lasting number and that of its start, as far as it has them."""
    return {
        "host": socket.gethostname(),
        "machine": _line("/etc/machine-id"),
        "boot": _line("/proc/sys/kernel/random/boot_id"),
    }


def me() -> dict[str, Any]:
    """What a file says of the process that holds it."""
    return {"pid": os.getpid(), "since": time.strftime("%Y-%m-%d %H:%M:%S"), **machine()}


def began(pid: int) -> str:
    """When a process of this machine began, in ticks since the machine did (field 22 of /proc/PID/stat, proc(5)).

    Empty where there is none, or one that has ended and was not waited for, or no /proc.
    """
    try:
        # The name of the program, in parentheses, may have spaces and parentheses in it.
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
        return "" if fields[0] == "Z" else fields[19]
    except (OSError, IndexError):
        return ""


def reaches(record: dict[str, Any]) -> bool:
    """Whether a lock of the process that wrote the record would be seen here: it runs, or ran, on this machine."""
    now = machine()
    if record.get("boot") and record.get("boot") == now["boot"]:
        return True  # containers of one machine share its locks
    return (record.get("host"), record.get("machine")) == (now["host"], now["machine"])


def read(handle: int) -> dict[str, Any]:
    """The record in an open file; empty where there is none, or one that was cut short."""
    with contextlib.suppress(OSError, RecursionError, ValueError):
        record = json.loads(os.pread(handle, 4096, 0))
        return record if isinstance(record, dict) else {}
    return {}


def write(handle: int, record: dict[str, Any]) -> None:
    """Puts the record, or nothing, into an open file."""
    os.ftruncate(handle, 0)
    if record:
        os.pwrite(handle, json.dumps(record).encode(), 0)


@contextlib.contextmanager
def alone(folder: Path, patience_s: float = 30.0) -> Iterator[None]:
    """While the body runs no other process writes the folder that asks in this way too.

    One that does already is waited for: it may be ending, since its run was killed. Raises UserError, which names it,
    when it has not ended after `patience_s`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / WRITER
    handle = _taken(path, time.monotonic() + patience_s)
    try:
        with contextlib.suppress(OSError):
            write(handle, me())
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()  # while it is held: who waits for it finds that it is gone, and makes a new one
        os.close(handle)


def _taken(path: Path, until: float) -> int:
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        got = lock(handle)
        if got is None or (got and _same(path, handle)):
            return handle
        record = read(handle)
        os.close(handle)
        if not got and time.monotonic() > until:
            raise UserError(f"'{path.parent}' is being written by {named(record)}; run this again when that has ended")
        time.sleep(SLEEP_S if got else LOOK_S)


def prefix() -> str:
    """What the names of temporary files begin with that this process makes: it says which start of which machine."""
    return f"{TEMPORARY}{_boot()}-"


@contextlib.contextmanager
def kept(folder: Path) -> Iterator[None]:
    """While the body runs `sweep` leaves this temporary folder alone."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folders
        yield
        return
    try:
        lock(handle)
        yield
    finally:
        os.close(handle)


def sweep(folder: Path) -> list[Path]:
    """Removes the temporary files below `folder` that writers which were killed left there, and returns them.

    Those of this machine's processes go as soon as their writer is dead: they are locked until then. Those of other
    machines, and of before this one was started anew, go after a day, since no lock says for sure how these are.
    """
    removed = []
    for parent, folders, files in os.walk(folder):
        left = [name for name in folders if name.startswith(TEMPORARY)]
        folders[:] = [name for name in folders if name not in left]
        left += [name for name in files if name.startswith(TEMPORARY) or name == WRITER]
        removed += [path for path in (Path(parent, name) for name in left) if _swept(path)]
    return removed


def _swept(path: Path) -> bool:
    try:
        handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    except OSError:  # it has just got its name, or is another user's
        return False
    try:
        got = lock(handle)
        near = reaches(read(handle)) if path.name == WRITER else path.name.startswith(prefix())
        age = time.time() - os.fstat(handle).st_mtime
        if got is False or abs(age) < YOUNG_S or not ((near and got) or age > OLD_S):
            return False
        with contextlib.suppress(OSError):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()
            return True
        return False
    finally:
        os.close(handle)


@functools.cache
def _boot() -> str:
    return _line("/proc/sys/kernel/random/boot_id")[:8] or "0"


def named(record: dict[str, Any]) -> str:
    """The process of a record, for people."""
    if not record:
        return "another process"
    return f"process {record.get('pid')} on {record.get('host')} (since {record.get('since')})"


def _same(path: Path, handle: int) -> bool:
    """Whether the open file is still the one of this name."""
    try:
        return os.path.samestat(path.stat(), os.fstat(handle))
    except OSError:
        return False


def _line(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError:
        return ""
