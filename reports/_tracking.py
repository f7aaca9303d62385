"""Copies a study into MLflow: one experiment a study, one finished run a cell, however often it is repeated.

The JSON files are the truth and MLflow the window on them. Each run carries a fingerprint of its cell's files: a run
with the same fingerprint is left alone, any other run of the cell (changed files, a crash half-way) is replaced
(`_tracking_log.py`). Cells are the children of summaries, which draw the paper's Figure 4 (`_tracked_summary.py`). A
study goes on without its log: `_tracking_follow.py` offers each cell once, and the end of the study takes up what is
missing.
"""

import contextlib
import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from ..common.cells import AXES, RECORDS, cell_folder, cell_name
from ..common.errors import UserError
from ..common.settings import Tracking
from . import _tracking_errors, _tracking_sqlite
from . import _tracking_turn as turns
from ._about import About
from ._tracked_cell import Cells, StudyCells
from ._tracked_run import CELL, FINGERPRINT
from ._tracked_study import Tracked
from ._tracked_summary import by_group, key_of
from ._tracking_errors import NO_TRACKING, Kind, masked
from ._tracking_log import Log, is_remote

__all__ = ["CELL", "FINGERPRINT", "KEY", "NO_TRACKING", "is_remote", "local_uri", "track"]
KEY = AXES
STRIKES = 5  # tries of a cell that a server in trouble does not take, while it answers otherwise
DOUBTED = 4  # times that a refused user asks again: MLflow's server says 401, too, where its database is in trouble
PAUSES_S = (1, 2, 4, 8, 15)  # between asking a store that is away; the last one again and again
# Seconds of MLflow's own patience with one request, and how often it repeats it: a study logs hundreds of runs.
TIMEOUT_S, RETRIES = 20, 2
QUIET = ("alembic", "mlflow.store.db.utils")  # log what is said in a sentence here
Progress = Callable[[int, int | None, str], None]
T = TypeVar("T")


def track(
    about: About,
    cells: Sequence[Mapping[str, str]],
    results: Path,
    tracking: Tracking,
    progress: Progress = lambda done, total, text: None,
    say: Callable[[str], None] = lambda text: None,
    stale: Sequence[Mapping[str, str]] = (),
) -> dict[str, int | str]:
    """Logs the cells of one study and their summaries; returns how many runs of cells were "logged" and "kept", and
    the id of the "experiment".

    `cells` are rows of the grid (KEY as texts), `results` is results/STUDY. Cells without all their files are left
    out; the runs of those that are `stale` go, where they are runs of these results, and those of cells and summaries
    that the study does not have. Removes what crashes have left in the experiment. Waits up to `tracking.patience`
    seconds, each time anew, for a store that does not answer. Raises UserError when some cells were not taken: repeat
    the call.
    """
    ready = [cell for cell in cells if all((cell_folder(results, cell) / name).is_file() for name in RECORDS)]
    source = StudyCells(about, results, tracking)
    return put(about, ready, source, tracking, progress, say, stale=stale, place=turns.place(results))


def put(
    about: About,
    ready: Sequence[Mapping[str, str]],
    source: Cells,
    tracking: Tracking,
    progress: Progress = lambda done, total, text: None,
    say: Callable[[str], None] = lambda text: None,
    stale: Sequence[Mapping[str, str]] | None = None,
    place: str = "",
) -> dict[str, int | str]:
    """What `track` does with the cells that are `ready`, wherever they come from; what else is in the experiment is
    left alone where `stale` is None."""
    done, refused = {"logged": 0, "kept": 0}, []
    with explained(tracking.uri):
        log = open_log(about.name, tracking, RETRIES, tracking.patience, place)
        patience = _Patience(tracking, say)
        patience.ask(log.start)
        tracked = Tracked(about, source, log)
        patience.ask(tracked.describe)

        def offer(name: str, what: Callable[[], T]) -> T | None:
            try:
                return patience.ask(what, log.answers)
            except (UserError, *_tracking_errors.errors()) as error:
                if _tracking_errors.kind(error) is not Kind.CELL:
                    raise
                refused.append(f"{name}: {_tracking_errors.words(error, tracking.uri)}")
                return None

        taken = set[str]()
        for number, cell in enumerate(_turned(_by_time(ready, source), log)):
            name = cell_name(cell)
            new = offer(name, lambda: tracked.cell(cell))  # noqa: B023
            if new is not None:
                taken.add(name)
                done["logged" if new else "kept"] += 1
            progress(number + 1, len(ready), name)
        for group, members in by_group(cell for cell in ready if cell_name(cell) in taken).items():
            offer(key_of(group), lambda: tracked.summary(group, members))  # noqa: B023
        for cell in stale or ():
            offer(cell_name(cell), lambda: tracked.drop(cell))  # noqa: B023
        if stale is not None:
            patience.ask(tracked.prune)
    if refused:
        raise UserError(
            f"MLflow at '{masked(tracking.uri)}' took {sum(done.values())} of {len(ready)} cells, first without "
            f"{refused[0]}"
        )
    return {**done, "experiment": log.experiment}


def _by_time(cells: Sequence[Mapping[str, str]], source: Cells) -> list[Mapping[str, str]]:
    """In the order in which they were made: a summary begins with the first of its cells."""

    def began(cell: Mapping[str, str]) -> float:
        try:
            return source.facts(cell).began_ms
        except UserError:  # said when it is its turn
            return float("inf")

    return sorted(cells, key=began)


def _turned(cells: Sequence[Mapping[str, str]], log: Log) -> list[Mapping[str, str]]:
    """From another cell on in each process: several that log the same at once share the work."""
    first = int(log.writer.rpartition("-")[2], 16) % len(cells) if log.shared and cells else 0
    return [*cells[first:], *cells[:first]]


def local_uri(uri: str) -> str:
    """The URI with a relative sqlite path made absolute and its folder made; others as they are."""
    path = _tracking_sqlite.path_of(uri)
    if path is None:
        return uri
    path.parent.mkdir(parents=True, exist_ok=True)
    return f"{_tracking_sqlite.PREFIX}{path}"


def keep_quiet() -> None:
    """MLflow calls nobody at home, here and in programs that this process begins, unless its variables say so."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("DO_NOT_TRACK", "true")


def open_log(study: str, tracking: Tracking, retries: int, wait_s: float, place: str = "") -> Log:
    """The log of a study, without a request; waits so long for a file that is locked."""
    keep_quiet()
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
    return Log(client, uri, study, tracking, place)


@contextlib.contextmanager
def explained(uri: str) -> Iterator[None]:
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
