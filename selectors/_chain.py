"""No two neighbouring views of a choice too far apart in the capture: fills the gaps, within the same count.

Structure-from-motion follows a chain of views that overlap; a choice of views that differ may break it. For a gap S the
choice is the longest prefix of the selector's order which, with the fewest frames that fill what is left between its
views and at both ends of the capture, has no more than K views. A view more in the prefix never needs more frames of
fill than before (it stands between two of the frames of an optimal fill, or is one), so that the count grows by one or
stays, and the longest prefix gives K exactly.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..common.errors import UserError
from ..scenes.types import Split


def gap_of(text: str, split: Split, numbers: np.ndarray | None = None) -> tuple[float, np.ndarray, str]:
    """(S, (N,) places of the frames, unit) of what `--max-gap` says: "0.8" or "0.8s" in seconds, "30f" in frames.

    A plain number is in seconds where the capture has times, and in frames where it has none. `numbers` are the frames'
    in the capture where some were left out, else they are those of the training split.
    Raises UserError for other words, and for seconds where there are no times or they do not grow.
    """
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*([sf]?)\s*", text)
    if not match or float(match[1]) <= 0:
        raise UserError(f"--max-gap is '{text}', expected seconds or frames above 0, as 0.8s or 30f")
    unit = match[2] or ("f" if split.times is None else "s")
    if unit == "f":
        return float(match[1]), np.arange(len(split)) * 1.0 if numbers is None else numbers * 1.0, "frames"
    if split.times is None:
        raise UserError("the capture has no times, so --max-gap cannot be in seconds; give frames, as 30f")
    if not (np.diff(split.times) >= 0).all():
        raise UserError("the times of the capture do not grow from frame to frame; give --max-gap in frames, as 30f")
    return float(match[1]), split.times, "s"


def largest_gap(chosen: Sequence[int] | np.ndarray, at: np.ndarray, allowed: np.ndarray | None = None) -> float:
    """The largest gap between neighbours of the choice, and between the ends of the capture and the nearest of it."""
    places = at if allowed is None else at[allowed]
    return float(np.diff([places[0], *np.sort(at[np.asarray(chosen, dtype=np.int64)]), places[-1]]).max())


def fill(
    chosen: Sequence[int] | np.ndarray,
    at: np.ndarray,
    gap: float,
    allowed: np.ndarray | None = None,
    sharpness: np.ndarray | None = None,
) -> list[int]:
    """The fewest frames, sorted, that leave no gap larger than `gap` between the chosen ones and at both ends.

    `at` is (N,) and does not fall; `allowed` (N,) bool says which frames may be taken, else all. Within what the gap
    allows each is the sharpest frame, or without `sharpness` the one nearest to equal steps. The ends are those of the
    allowed frames. Raises UserError where two allowed neighbours are farther apart than that.
    """
    usable = np.arange(len(at)) if allowed is None else np.flatnonzero(allowed)
    places = at[usable]
    limit = gap * (1 + 1e-9)  # sums of steps of a frame are not exact
    wide = np.diff(places, prepend=places[0])
    if wide.max() > limit:
        i = int(wide.argmax())
        raise UserError(
            f"the capture itself has a gap of {wide[i]:g} between frames {usable[i - 1]} and {usable[i]}, "
            f"so no choice keeps --max-gap {gap:g}"
        )
    result: list[int] = []
    borders = np.sort(at[np.asarray(chosen, dtype=np.int64)])
    # Beyond an end of the capture there is nothing, and the end itself is not among the chosen.
    for low, high in zip([places[0], *borders], [*borders, places[-1]], strict=True):
        earliest = _backward(low, high, places, limit)
        now = low
        for left, first in zip(range(len(earliest), 0, -1), earliest, strict=True):
            last = int(np.searchsorted(places, now + limit, side="right"))
            window = np.arange(first, max(last, first + 1))  # both borders are rounded, each its own way
            if sharpness is None:
                pick = window[np.abs(places[window] - (now + (high - now) / (left + 1))).argmin()]
            else:
                pick = window[sharpness[usable[window]].argmax()]
            result.append(int(usable[pick]))
            now = places[pick]
    return result


def _backward(low: float, high: float, places: np.ndarray, limit: float) -> list[int]:
    """For each frame of the shortest fill between two places the earliest one from which the rest can be reached."""
    earliest: list[int] = []
    while high - low > limit:
        first = int(np.searchsorted(places, high - limit, side="left"))
        earliest.append(first)
        high = places[first]
    return earliest[::-1]


def fewest(at: np.ndarray, gap: float, allowed: np.ndarray | None = None) -> int:
    """How many views a bare chain has. Raises UserError where the capture itself has a larger gap."""
    return max(1, len(fill([], at, gap, allowed)))


def check_count(count: int, at: np.ndarray, gap: float, allowed: np.ndarray | None = None) -> None:
    """Raises UserError, with a count and a gap that would do, where a bare chain has more than `count` views."""
    need = fewest(at, gap, allowed)
    if need > count:
        raise UserError(
            f"--max-gap {gap:g} needs at least {need} views, and {count} were asked for; "
            f"give --count {need}, or --max-gap {smallest_gap(at, count, allowed):g}"
        )


def smallest_gap(at: np.ndarray, count: int, allowed: np.ndarray | None = None) -> float:
    """The smallest gap, rounded up to a thousandth, that a chain of `count` views keeps."""
    places = at if allowed is None else at[allowed]
    low, high = float(np.diff(places, prepend=places[0]).max()), float(places[-1] - places[0]) or 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if fewest(at, middle, allowed) <= count else (middle, high)
    return float(np.ceil(round(high * 1000, 6)) / 1000)


def chained(
    choose: Callable[[int], Sequence[int]],
    greedy: bool,
    count: int,
    at: np.ndarray,
    gap: float,
    allowed: np.ndarray | None = None,
    sharpness: np.ndarray | None = None,
) -> tuple[list[int], list[int]]:
    """(views in the selector's order, frames of fill) that are `count` together and leave no gap larger than `gap`.

    `choose` gives the selector's views for a count; a greedy one is asked once, another for smaller and smaller counts.
    Of those the frames over are put into the middles of the largest gaps.
    Raises UserError, which names a count and a gap that would do, where a bare chain has more views than `count`.
    """
    check_count(count, at, gap, allowed)
    order = [int(i) for i in choose(count)]
    if greedy:
        few, many = 0, count
        while few < many:  # the longest prefix that fits
            middle = (few + many + 1) // 2
            fits = middle + len(fill(order[:middle], at, gap, allowed)) <= count
            few, many = (middle, many) if fits else (few, middle - 1)
        return order[:few], fill(order[:few], at, gap, allowed, sharpness)
    while (over := len(order) + len(fill(order, at, gap, allowed)) - count) > 0:
        smaller = len(order) - max(1, over // 2)
        order = [int(i) for i in choose(smaller)] if smaller > 0 else []
    extra = fill(order, at, gap, allowed, sharpness)
    while len(order) + len(extra) < count:
        extra.append(_widest(order + extra, at, allowed))
    return order, sorted(extra)


def _widest(chosen: list[int], at: np.ndarray, allowed: np.ndarray | None) -> int:
    """The frame not chosen that is farthest from the nearest chosen one."""
    usable = np.setdiff1d(np.arange(len(at)) if allowed is None else np.flatnonzero(allowed), chosen)
    if not chosen:
        return int(usable[len(usable) // 2])
    places = np.sort(at[chosen])
    right = np.searchsorted(places, at[usable])
    after = np.where(right < len(places), np.abs(places[np.minimum(right, len(places) - 1)] - at[usable]), np.inf)
    before = np.where(right > 0, np.abs(at[usable] - places[np.maximum(right - 1, 0)]), np.inf)
    return int(usable[np.minimum(after, before).argmax()])


def record_of(record: dict[str, Any], split: Split, views: list[int], extra: list[int], **notes: Any) -> dict[str, Any]:
    """The selection with the fill after the views, which keep their order; `notes` are added to its own."""
    indices = views + extra
    kept = {key: value for key, value in record.get("notes", {}).items() if key != "below_precision_from"}
    return {
        **record,
        "count": len(indices),
        "indices": indices,
        "names": [split.names[i] for i in indices],
        "gains": None,  # the fill was not chosen by gain
        "greedy": False,  # a smaller count has another fill
        "notes": {**kept, **notes},
    }
