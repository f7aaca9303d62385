"""How much of a capture repeats itself: views that are enough at a similarity, and stretches that say one thing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._similarity import Similarity

LEVELS = (0.99, 0.98, 0.95, 0.9, 0.8, 0.7)  # on real captures from nearly all views to a tenth of them
SHORTEST = 3  # views that a run has at least
TRIED = 4  # times as many runs looked at closely as are asked for
STEPS = 5  # moves of a run's centre
BLOCK = 64  # views compared at a time at the end of a run, doubled while it goes on
MOST_COMPARED = 512  # views of a run whose mutual similarities say which is in its middle


@dataclass(frozen=True)
class Level:
    """How many views are enough for every view to be so similar to one of them."""

    similarity: float
    views: int


@dataclass(frozen=True)
class Run:
    """Consecutive training views `first` to `last` that are all at least `similarity` like one of them, `centre`."""

    first: int
    last: int
    centre: int
    similarity: float

    def __len__(self) -> int:
        return self.last - self.first + 1


def levels(curve: np.ndarray, n: int, wanted: Sequence[float]) -> list[Level]:
    """For each similarity s the smallest K whose uncovered distance, `curve` (K,) of the first 1, 2, … views of an
    order, is at most 1 − s; N where the curve ends before."""
    found = []
    for s in sorted(wanted, reverse=True):
        enough = np.flatnonzero(curve <= 1 - s + 1e-12)
        found.append(Level(s, int(enough[0]) + 1 if len(enough) else n))
    return found


def level_of_runs(found: Sequence[Level], n: int) -> float:
    """The highest similarity at which half of the views are enough, or the lowest there is: what counts as a repeat
    depends on the factors, and at this one there is something to tell."""
    half = [level.similarity for level in found if 2 * level.views <= n]
    return max(half) if half else min(level.similarity for level in found)


def runs(similar: Similarity, centres: Sequence[int] | np.ndarray, level: float, most: int) -> list[Run]:
    """At most `most` runs that do not overlap, the longest first, of views at least `level` like their centre.

    Runs are grown around the `centres`, views no two of which are that similar, so that the work is little more than
    one comparison a view; the longest are then moved to where they are longest.
    """
    grown = sorted((_grown(similar, int(centre), level) for centre in centres), key=_longest_first)
    better = sorted({_moved(similar, run, level) for run in grown[: TRIED * most]}, key=_longest_first)
    chosen: list[Run] = []
    for run in better:
        apart = all(run.last < other.first or run.first > other.last for other in chosen)
        if apart and len(run) >= SHORTEST and len(chosen) < most:
            chosen.append(run)
    return chosen


def _longest_first(run: Run) -> tuple[int, float, int, int]:
    return -len(run), -run.similarity, run.first, run.centre


def _grown(similar: Similarity, centre: int, level: float) -> Run:
    before, low = _reach(similar, centre, np.arange(centre - 1, -1, -1), level)
    after, high = _reach(similar, centre, np.arange(centre + 1, len(similar)), level)
    return Run(centre - before, centre + after, centre, min(low, high))


def _reach(similar: Similarity, centre: int, others: np.ndarray, level: float) -> tuple[int, float]:
    """How many of the others, from the first on, are that similar to the centre, and how much the least of them is."""
    count, least, size = 0, 1.0, BLOCK
    while count < len(others):
        part = others[count : count + size]
        m = similar.spatial(centre, part) + similar.gamma * similar.semantic(centre, part)
        apart = np.flatnonzero(m < level - 1e-12)
        inside = m[: apart[0]] if len(apart) else m
        count, least = count + len(inside), min(least, float(inside.min(initial=1.0)))
        if len(apart):
            break
        size *= 2
    return count, least


def _moved(similar: Similarity, run: Run, level: float) -> Run:
    """The run around the view that is most like all of it, again and again while that makes it longer."""
    for _ in range(STEPS):
        every = np.arange(run.first, run.last + 1)
        some = every[:: -(-len(every) // MOST_COMPARED)]
        total = sum(similar.spatial(int(i), some) + similar.gamma * similar.semantic(int(i), some) for i in some)
        other = _grown(similar, int(some[np.argmax(total)]), level)
        if (len(other), other.similarity) <= (len(run), run.similarity):
            break
        run = other
    return run
