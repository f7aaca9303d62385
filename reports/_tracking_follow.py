"""Logs a study's cells while it runs: one process that imports MLflow once, when the first cell has been scored.

It looks at the cells' scores every few seconds, does nothing where nothing is new, and gives up for a while where the
store does not answer or is locked: the end of the study takes up what is missing (`_tracking.track`).
"""

import contextlib
import os
import time
import uuid
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from ..common.cells import RECORDS, cell_folder, cell_name
from ..common.errors import UserError
from ..common.files import write_json
from ..common.settings import Tracking
from . import _tracked_link, _tracking_errors
from . import _tracking_turn as turns
from ._about import About
from ._tracked_cell import StudyCells
from ._tracked_study import Tracked
from ._tracked_summary import Group, by_group, group_of
from ._tracking import Progress, explained, open_log
from ._tracking_stamp import FOLLOWED

LOOK_S = 3.0  # between two looks
SETTLE_S = 6.0  # from when a score is seen to when it is logged, so that a study of seconds need not import MLflow
AT_ONCE = 20  # cells, before another that wants to log the study may
AWAY_S = 30.0  # before a store that did not take a cell is asked again
RETRIES, WAIT_S = 1, 5.0  # of one request, and for a database that another holds

Stamp = tuple[int, int]  # of a file: when it was written, and its length


class Follower:
    """What one such process knows. `cells` is the grid; those named in `stale` are about to be made anew."""

    def __init__(
        self,
        about: About,
        cells: Sequence[Mapping[str, str]],
        results: Path,
        tracking: Tracking,
        stale: Collection[str] = (),
        say: Callable[[str], None] = lambda text: None,
        progress: Progress = lambda done, total, text: None,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.about, self.results, self.tracking = about, results, tracking
        self.say, self.progress, self.clock = say, progress, clock
        self.source, self.me = StudyCells(about, results, tracking), uuid.uuid4().hex
        self.cells = {cell_name(cell): cell for cell in cells}
        score = [*RECORDS][-1]
        self.scores = {name: str(cell_folder(results, cell) / score) for name, cell in self.cells.items()}
        self.described: set[str] = set()  # scenes
        self.groups = by_group(cells)
        self.over = {name: stamp for name in stale if name in self.cells and (stamp := self._stamp(name))}
        self.seen: dict[str, tuple[Stamp, float]] = {}  # scores that are not logged, and since when they are there
        self.logged: set[str] = set()
        self.tracked: Tracked | None = None
        self.experiment = ""
        self.again = 0.0  # when a store that was away is asked again
        self.said = ""
        self.began, self.longest_s = time.time(), 0.0  # from a score of this time on to its run

    def go_on(self, stopped: Callable[[float], bool]) -> None:
        """Until `stopped`, which waits for so many seconds and then says whether it is time to end."""
        while not stopped(LOOK_S):
            due = self.due()
            if due and self.clock() >= self.again:
                self.log(due[:AT_ONCE], lambda: stopped(0))

    def due(self) -> list[str]:
        """Names of the cells to log now."""
        now, due = self.clock(), []
        for name in self.cells:
            stamp = self._stamp(name)
            if stamp is None or self.over.get(name) == stamp:
                continue
            if name not in self.seen or self.seen[name][0] != stamp:
                self.seen[name] = (stamp, now)
            if now - self.seen[name][1] >= SETTLE_S:
                due.append(name)
        return due

    def log(self, names: Sequence[str], stopped: Callable[[], bool] = lambda: False) -> None:
        """Logs these cells, and the points of summaries that are complete now; raises nothing that goes wrong."""
        with contextlib.ExitStack() as held:
            try:  # what another does is not waited for
                turn = turns.turn(self.tracking, self.about.name, self.results, self.me, waits=False)
                mine = held.enter_context(turn)
            except (UserError, OSError):
                self.again = self.clock() + AWAY_S
                return
            if not mine:
                self.tracked = None  # which knows less than what is there by now
            self._log(names, stopped)
        self._account()
        self.progress(len(self.logged), len(self.cells), "")

    def _log(self, names: Sequence[str], stopped: Callable[[], bool]) -> None:
        try:
            with explained(self.tracking.uri):
                tracked = self._open()
                touched = {}
                for name in names:
                    if stopped():
                        return
                    stamp = self._stamp(name)
                    self.logged.discard(name)
                    if stamp and self._cell(tracked, name):
                        self.logged.add(name)
                        self._note_lag(stamp)
                        touched[group_of(self.cells[name])] = None
                    if stamp:
                        self.over[name] = stamp
                for group in touched:
                    self._summary(tracked, group)
                self.said = ""
        except UserError as error:
            self.tracked = None
            self.again = self.clock() + AWAY_S
            if str(error) != self.said:
                self.said = str(error)
                self.say(f"{error}; trying again")

    def _open(self) -> Tracked:
        if self.tracked is None:
            log = open_log(self.about.name, self.tracking, RETRIES, WAIT_S, turns.place(self.results))
            log.start()
            self.tracked = Tracked(self.about, self.source, log)
            self.tracked.describe()
            self.experiment = log.experiment
        return self.tracked

    def _cell(self, tracked: Tracked, name: str) -> bool:
        """Whether the cell has its run. One that another job is making anew, and one that MLflow does not take, is left
        to its next score or to the end of the study."""
        try:
            if not self.source.coherent(self.cells[name]):
                return False
            tracked.cell(self.cells[name])
        except (UserError, *_tracking_errors.errors()) as error:
            if _tracking_errors.kind(error) is not _tracking_errors.Kind.CELL:
                raise
            self.say(f"{name}: {_tracking_errors.words(error, self.tracking.uri)}")
            return False
        return True

    def _summary(self, tracked: Tracked, group: Group) -> None:
        """Adds the ratios of a summary all of whose seeds have been logged, by this process or before it."""
        ratios: dict[str, list[Mapping[str, str]]] = {}
        for cell in self.groups[group]:
            ratios.setdefault(cell["ratio"], []).append(cell)
        members = [cell for here in ratios.values() if all(map(self._is_logged, here)) for cell in here]
        if members:
            tracked.summary(group, members, whole=False)

    def _is_logged(self, cell: Mapping[str, str]) -> bool:
        name = cell_name(cell)
        return name in self.logged and self.over.get(name) == self._stamp(name)

    def _stamp(self, name: str) -> Stamp | None:
        """Of the cell's score; None where there is none, or nothing yet to describe its scene by."""
        try:
            found = os.stat(self.scores[name])  # noqa: PTH116 - of all cells, every few seconds
        except OSError:
            return None
        scene = self.cells[name]["scene"]
        if scene not in self.described:
            if not (self.results / "scenes" / f"{scene}.json").is_file():
                return None
            self.described.add(scene)
        return found.st_mtime_ns, found.st_size

    def _note_lag(self, stamp: Stamp) -> None:
        scored = stamp[0] / 1e9
        if scored > self.began:
            self.longest_s = max(self.longest_s, time.time() - scored)

    def _account(self) -> None:
        """What this process has cost so far, for who wants to know."""
        with contextlib.suppress(OSError):
            write_json(
                self.results / FOLLOWED,
                {
                    "experiment": self.experiment,
                    "store": _tracked_link.store(self.tracking.uri),
                    "pid": os.getpid(),
                    "cells": len(self.logged),
                    "cpu_s": time.process_time(),
                    "longest_s": self.longest_s,
                },
            )
