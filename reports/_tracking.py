"""Copies a study's cells into MLflow: one experiment a study, one finished run a cell, however often it is repeated.

The JSON files are the truth and MLflow the window on them. Each run carries a fingerprint of its cell's files: a run
with the same fingerprint is left alone, any other run of the cell (changed files, a crash half-way) is replaced
(`_tracking_log.py`). A study goes on without its log: each cell is offered once, and the end of the study takes up what
is missing.
"""

import contextlib
import logging
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from ..common.cells import AXES, RECORDS, cell_folder, cell_name
from ..common.errors import UserError
from ..common.settings import Tracking
from . import _tracking_errors, _tracking_sqlite
from ._tracked_run import CELL, FINGERPRINT
from ._tracking_away import Away
from ._tracking_errors import Kind, masked
from ._tracking_log import Log, is_remote

__all__ = ["CELL", "FINGERPRINT", "KEY", "NO_TRACKING", "is_remote", "local_uri", "track", "track_cell"]
KEY = AXES
NO_TRACKING = "tracking.uri is empty"  # why nothing is logged where nobody wants it
STRIKES = 5  # tries of a cell that a server in trouble does not take, while it answers otherwise
DOUBTED = 4  # times that a refused user asks again: MLflow's server says 401, too, where its database is in trouble
PAUSES_S = (1, 2, 4, 8, 15)  # between asking a store that is away; the last one again and again
# Seconds of MLflow's own patience with one request, and how often it repeats it: a study logs hundreds of runs. A job
# of one cell gives up sooner, since the end of the study logs what it did not.
TIMEOUT_S, RETRIES, RETRIES_OF_ONE = 20, 2, 1
QUIET = ("alembic", "mlflow.store.db.utils")  # log what is said in a sentence here
Progress = Callable[[int, int | None, str], None]
T = TypeVar("T")


def track(
    study: str,
    cells: list[dict[str, str]],
    results: Path,
    tracking: Tracking,
    progress: Progress = lambda done, total, text: None,
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, int]:
    """Logs the cells of one study; returns how many runs were "logged" and how many were "kept".

    `cells` are rows of the grid (KEY as texts), `results` is results/STUDY. Cells without all their files are left
    out. Removes what crashes have left in the experiment. Waits up to `tracking.patience` seconds, each time anew, for
    a store that does not answer. Raises UserError when some cells were not taken: repeat the call.
    """
    away = Away(results, masked(tracking.uri))
    patience = _Patience(tracking, say)
    done, refused = {"logged": 0, "kept": 0}, []
    ready = [cell for cell in cells if all((cell_folder(results, cell) / name).is_file() for name in RECORDS)]
    with _explained(tracking.uri):
        log = _open(study, tracking, RETRIES, tracking.patience)
        known = patience.ask(log.start)
        away.over()
        for number, cell in enumerate(ready):
            name = cell_name(cell)
            try:
                new = patience.ask(
                    lambda: log.cell(cell, cell_folder(results, cell), known.get(cell_name(cell), [])),  # noqa: B023
                    log.answers,
                )
                done["logged" if new else "kept"] += 1
            except (UserError, *_tracking_errors.errors()) as error:
                if _tracking_errors.kind(error) is not Kind.CELL:
                    raise
                refused.append(f"{name}: {_tracking_errors.words(error, tracking.uri)}")
            progress(number + 1, len(ready), name)
    if refused:
        raise UserError(
            f"MLflow at '{masked(tracking.uri)}' took {sum(done.values())} of {len(ready)} cells, first without "
            f"{refused[0]}"
        )
    return done


def track_cell(study: str, cell: dict[str, str], results: Path, tracking: Tracking) -> dict[str, int]:
    """Logs one cell while the study goes on; returns what `track` does.

    Raises UserError at once where a job before this one found nobody (`_tracking_away.py`), and after a short while
    where this one does: `track` at the end of the study takes up what is missing.
    """
    away = Away(results, masked(tracking.uri))
    since_s = away.since_s()
    if since_s is not None:
        raise UserError(f"MLflow at '{masked(tracking.uri)}' was away {since_s:.0f} s ago, so it was not asked")
    with _explained(tracking.uri):
        try:
            log = _open(study, tracking, RETRIES_OF_ONE, TIMEOUT_S)
            known = log.start(cell_name(cell)).get(cell_name(cell), [])
            new = log.cell(cell, cell_folder(results, cell), known, fresh=True)
        except _tracking_errors.errors() as error:
            if _tracking_errors.kind(error) is not Kind.CELL:
                away.says(_tracking_errors.words(error, tracking.uri))
            raise
    away.over()
    return {"logged": int(new), "kept": int(not new)}


def local_uri(uri: str) -> str:
    """The URI with a relative sqlite path made absolute and its folder made; others as they are."""
    path = _tracking_sqlite.path_of(uri)
    if path is None:
        return uri
    path.parent.mkdir(parents=True, exist_ok=True)
    return f"{_tracking_sqlite.PREFIX}{path}"


def _open(study: str, tracking: Tracking, retries: int, wait_s: float) -> Log:
    """The log of a study, without a request; waits so long for a file that is locked."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("DO_NOT_TRACK", "true")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", str(retries))
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", str(TIMEOUT_S))
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")
    os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
    uri = local_uri(tracking.uri)
    path = _tracking_sqlite.path_of(uri)
    if path:
        _tracking_sqlite.check(path, wait_s)
    from mlflow import MlflowClient

    for name in QUIET:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with _tracking_sqlite.alone_at_first(path, wait_s) if path else contextlib.nullcontext():
        client = MlflowClient(tracking_uri=uri)
        if path:
            client.search_experiments(max_results=1)  # makes the database, if the client has not
    return Log(client, uri, study, tracking)


@contextlib.contextmanager
def _explained(uri: str) -> Iterator[None]:
    """Errors of MLflow become UserError."""
    try:
        yield
    except _tracking_errors.errors() as error:
        said = _tracking_errors.words(error, uri)
        raise UserError(f"MLflow at '{masked(uri)}' did not take the runs: {said}") from None


class _Patience:
    """Asks again while a store is away, for so many seconds since it last answered."""

    def __init__(self, tracking: Tracking, say: Callable[[str], None]):
        self.tracking, self.say, self.answered = tracking, say, time.monotonic()
        self.troubled = False  # by what was asked last

    def ask(self, what: Callable[[], T], answers: Callable[[], object] | None = None) -> T:
        """What `what` returns, asked until the patience is over or something else is wrong than that nobody is there.

        With `answers`, which asks for next to nothing: raises TroubledError when that is answered and `what` is not,
        unless it was so with what was asked before, too.
        """
        tries = strikes = 0
        while True:
            try:
                value = what()
                self.answered, self.troubled = time.monotonic(), False
                return value
            except _tracking_errors.errors() as error:
                left_s = self.answered + self.tracking.patience - time.monotonic()
                doubted = _tracking_errors.refuses_user(error) and tries < DOUBTED
                if not (doubted or _tracking_errors.kind(error) is Kind.AWAY) or left_s <= 0:
                    raise
                said = _tracking_errors.words(error, self.tracking.uri)
                if not tries:
                    self.say(f"MLflow at '{masked(self.tracking.uri)}': {said}; asking again for {left_s:.0f} s")
                time.sleep(min(PAUSES_S[min(tries, len(PAUSES_S) - 1)], left_s))
                tries += 1
                if answers is not None and self._hears(answers):
                    strikes += 1
                    if strikes == STRIKES and self.troubled:
                        raise
                    if strikes == STRIKES:
                        self.troubled = True
                        raise _tracking_errors.TroubledError(said) from None

    def _hears(self, answers: Callable[[], object]) -> bool:
        try:
            answers()
        except _tracking_errors.errors():
            return False
        self.answered = time.monotonic()
        return True
