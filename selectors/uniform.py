"""Views at equal steps of the capture from a random start, the paper's Uniform baseline."""

import numpy as np

from ..common.errors import UserError, nearest
from ._sharpness import sharpest_near
from ._types import Choice, Views

SEEDED = True
FACTORS = ()
PARAMETERS = {"steps": "equal", "by": "auto", "sharpness": 0.0}
STEPS = ("equal", "linspace")
BY = ("auto", "index", "time", "path")
UNEVEN = 1.5  # times the usual interval: a longer one is a gap, or the rate varies
# Position units to the radian: by how much a turn shifts the picture a step does at the depth of half a room, which is
# about 4 where the cameras fill [-4, 4].
TURN = 4.0


def select(
    views: Views,
    count: int,
    rng: np.random.Generator,
    steps: str = "equal",
    by: str = "auto",
    sharpness: float = 0.0,
) -> Choice:
    """i_k = (⌊k N / K⌋ + s) mod N for k = 0 … K − 1, with s drawn from 0 … N − 1.

    Every step, that over the end of the capture too, is ⌊N / K⌋ or one more, so that the K views are distinct and K = N
    gives all of them.

    `by` says what the steps are equal in: "index", the number of the frame; "time", its seconds, where the format has
    them; "path", the way walked and turned (distance with positions in [-4, 4], plus TURN times the angle in radians).
    By time and path the frames stand at their share of the whole, stretched to N − 1, and the K nearest to the places
    above are taken: at a constant rate that is the choice by index. Where there are no frames there is nothing to take,
    so that a gap counts as one step at most. "auto" is by time where the format has times that rise and are not evenly
    spaced (frames were dropped, the rate varies), else by index.

    `steps` = "linspace" is what the paper's authors run: ⌊k (N − 1) / (K − 1)⌋, linspace(0, N − 1, K) rounded down,
    shifted by s and wrapped. Its first and last view are 0 and N − 1 before the shift, which makes them neighbours:
    two of its K views are nearly one.

    With `sharpness` > 0 each view makes way for the sharpest one nearer to it than to its neighbours in the choice.
    Of views to keep each takes the place of the one nearest to it. Raises UserError for another word than those of
    `steps` and `by`, and by time without times or with times that fall.
    """
    for name, word, known in (("steps", steps, STEPS), ("by", by, BY)):
        if word not in known:
            raise UserError(f"unknown {name} '{word}'{nearest(word, known)} (there are: {', '.join(known)})")
    n = len(views)
    start = int(rng.integers(n))
    k = np.arange(count)
    chosen = (k * n // count if steps == "equal" else k * (n - 1) // max(1, count - 1)) + start
    chosen %= n
    places = _places(views, by, count)
    if places is not None:
        chosen = _nearest_to(places, chosen)
    if sharpness > 0 and views.sharpness is not None:
        chosen = sharpest_near(chosen, views.sharpness)
    return Choice(_with_kept(chosen, views.kept))


def _places(views: Views, by: str, count: int) -> np.ndarray | None:
    """(N,) where each view stands between 0 and N − 1; None where that is its index."""
    n = len(views)
    if by == "index" or (by == "auto" and not uneven(views.times)):
        return None
    if by == "path":
        steps = np.linalg.norm(np.diff(views.positions, axis=0), axis=1)
        turns = np.einsum("nij,nij->n", views.rotations[:-1], views.rotations[1:])  # 1 + 2 cos θ
        steps += TURN * np.arccos(np.clip((turns - 1) / 2, -1, 1))
    elif views.times is None:
        raise UserError("'uniform' has no times to go by: the format has none; use by=index or by=path")
    else:
        steps = np.diff(views.times)
        if (steps < 0).any():
            i = int((steps < 0).argmax()) + 1
            raise UserError(
                f"'uniform' cannot go by times that fall, as at view {i} (several recordings?); use by=index"
            )
    way = np.concatenate([[0.0], np.cumsum(np.minimum(steps, _longest(steps, count)))])
    return way * ((n - 1) / way[-1]) if way[-1] > 0 else None


def _longest(steps: np.ndarray, count: int) -> float:
    """The length of one of `count` equal steps, when no interval counts as more than that: L = Σ min(d, L) / K."""
    longest = float(steps.sum()) / count
    for _ in range(len(steps)):
        shorter = float(np.minimum(steps, longest).sum()) / count
        if shorter >= longest * (1 - 1e-9):
            break
        longest = shorter
    return longest


def uneven(times: np.ndarray | None) -> bool:
    """Whether times rise, some moments far more apart than usual; the cameras of a rig share their moments."""
    if times is None or (np.diff(times) < 0).any():
        return False
    intervals = np.diff(np.unique(times))
    return len(intervals) > 1 and bool(intervals.max() > UNEVEN * np.median(intervals))


def _nearest_to(places: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """For each wanted place the view nearest to it, each view once, in the order of `wanted`."""
    order = np.argsort(wanted, kind="stable")
    n, count = len(places), len(wanted)
    middles = (places[:-1] + places[1:]) / 2
    found = np.searchsorted(middles, wanted[order], side="left")
    # Distinct: push apart what fell on one view, forwards and then backwards from the end.
    found = np.maximum.accumulate(found - np.arange(count)) + np.arange(count)
    found = np.minimum(found, n - count + np.arange(count))
    chosen = np.empty(count, dtype=np.int64)
    chosen[order] = found
    return chosen


def _with_kept(chosen: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The choice with each view to keep in place of the one nearest to it; those to keep come first."""
    rest = [int(i) for i in chosen if i not in kept]
    for view in kept:
        if view not in chosen:
            rest.pop(int(np.abs(np.array(rest) - view).argmin()))
    return np.array([*map(int, kept), *rest], dtype=np.int64)
