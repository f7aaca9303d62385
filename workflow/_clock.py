"""A clock that goes back leaves results with dates to come: these are dated now, in the order that they have.

Snakemake runs a job again where an input is newer than what was made of it, by the dates of the files. A result that is
dated tomorrow would be kept whatever changes today, and a job that reads it would fail, for its output is older.
"""

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path

STEP_S = 1.0  # a clock that went back by less changes no order that matters
APART_NS = 1000  # between two files that are dated now: Snakemake reads dates as float64 seconds


def settle(results: Path, now_ns: int | None = None) -> int:
    """Dates the files below `results` that are of the future just before now; returns how many there were."""
    now = time.time_ns() if now_ns is None else now_ns
    found = []
    for parent, _, files in os.walk(results):
        for path in (Path(parent, name) for name in files):
            with contextlib.suppress(OSError):
                changed = path.lstat().st_mtime_ns
                if changed > now:
                    found.append((changed, path))
    for rank, (_, path) in enumerate(sorted(found)):
        date = now - (len(found) - rank) * APART_NS
        with contextlib.suppress(OSError):  # it is gone, or another user's
            os.utime(path, ns=(date, date), follow_symlinks=False)
    return len(found)


class Watch:
    """Says whether the clock has gone back since it was asked last."""

    def __init__(self, clock: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic):
        self.clock, self.steady = clock, steady
        self.ahead = clock() - steady()

    def went_back(self) -> bool:
        """Whether it is behind where it would be by the seconds that have passed."""
        before, self.ahead = self.ahead, self.clock() - self.steady()
        return self.ahead < before - STEP_S
