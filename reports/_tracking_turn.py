"""Who logs a study: one process of this machine at a time, which learns whether another has been at it since."""

import contextlib
import hashlib
import socket
from collections.abc import Iterator
from pathlib import Path

from ..common import holding
from ..common.files import write_text
from ..common.settings import Tracking
from . import _tracking_sqlite

LEAST_S = 30.0  # that one waits for another who is at it: a turn of the process that follows a run takes seconds
LAST = "last"  # the file that says whose turn was the last


@contextlib.contextmanager
def turn(tracking: Tracking, study: str, results: Path | None, me: str, waits: bool = True) -> Iterator[bool]:
    """While the body runs no other process of this machine logs the study to this store; yields whether `me`, any name
    of its own, had the turn before this one, too.

    Of a database that is a file the lock lies beside it, whoever logs from where; of another store in results/STUDY
    (None: no lock, as of results that are none of ours). Raises UserError, which names the other, at once or when it
    has waited for `tracking.patience`.
    """
    folder = _folder(tracking.uri, study, results)
    if folder is None:
        yield False
        return
    with holding.alone(folder, max(tracking.patience, LEAST_S) if waits else 0.0):
        last = folder / LAST
        mine = last.is_file() and last.read_text(encoding="utf-8") == me
        if not mine:
            write_text(last, me)
        yield mine


def place(results: Path) -> str:
    """What stands for results/STUDY on this machine: who holds its turn knows that other writers of it are dead."""
    return hashlib.sha256(f"{socket.gethostname()}:{results.resolve()}".encode()).hexdigest()[:12]


def _folder(uri: str, study: str, results: Path | None) -> Path | None:
    path = _tracking_sqlite.path_of(uri)
    if path is not None:
        return path.parent / f".{path.name}.writers" / study
    return None if results is None else results / "logs" / "track"
