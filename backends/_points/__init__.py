"""The points that a training starts from: of the scene file, a plane sweep of the chosen views, rays, or a random box.

One vocabulary for every backend that starts from points, so that one line of a study holds for all of them. A start
that needs neighbouring views to overlap would make diverse subsets look bad and redundant ones good; so a sweep
believes little, falls back by the pixel, and counts what it did in the record that `train.json` keeps.
"""

import dataclasses
from typing import Any

import numpy as np

from ...common.errors import UserError, nearest
from .._surroundings import Surroundings
from .._types import SOURCES, Seeding, TrainingSet
from .drawn import along_rays, random_box
from .scene import scene_points
from .start import FEWEST, KINDS, Start
from .swept import swept

BLIND = ("sweep", "rays", "random")  # for scenes without points: a start from these knows none of them
DRAWN = 100_000  # points where nothing else says how many, as the 3DGS authors draw where a scene has none
SWEEP = 0.3  # share of all that a sweep gives where the scene has points too


@dataclasses.dataclass(frozen=True)
class Wanted:
    """Which points, and how many."""

    source: str  # of SOURCES
    most: int | None = None  # of all; None for all that the scene has, and `drawn` where it has none
    fills: bool = False  # whether there should be `most`, for a trainer that makes no more
    drawn: int = DRAWN
    sweep: float = SWEEP


def knowing(data: TrainingSet, source: str) -> TrainingSet:
    """The views with the scene's points only where a start from `source` may know them.

    Raises UserError for an unknown source.
    """
    if source not in SOURCES:
        raise UserError(f"unknown source of points '{source}'{nearest(source, SOURCES)} (known: {', '.join(SOURCES)})")
    return dataclasses.replace(data, points=None) if source in BLIND else data


def starting_points(
    data: TrainingSet, wanted: Wanted, around: Surroundings, rng: np.random.Generator
) -> tuple[list[Start], Seeding]:
    """Points, sure ones first, and what `train.json` says of them; `data` is what `knowing` left.

    "auto" are the scene's points and a sweep, "selected" those points of the scene that two chosen views see; both
    "auto" and "sweep" go on with random depths along rays where fewer than 500 points are found. Points of a scene
    file were triangulated from all its training views: "scene" tells a trainer more than the chosen views do, and the
    same of every choice. So does "random", a box around all training cameras. Raises UserError for a source that was
    asked for and has no points.
    """
    source, found = wanted.source, dict[str, Any]()
    starts: list[Start] = []
    if source in ("auto", "scene", "selected"):
        most = wanted.most
        if most is not None and source == "auto":
            most -= round(wanted.sweep * most)
        starts = scene_points(data, source, most, rng)
    total = wanted.most
    if total is None or not wanted.fills:
        known = _number(starts)
        natural = round(known / (1 - wanted.sweep)) if known and wanted.sweep < 1 else max(wanted.drawn, known)
        total = natural if total is None else min(total, natural)
    if source in ("auto", "sweep"):
        swept_starts, found = swept(data, total - _number(starts), around, rng)
        starts += swept_starts
    known = _number(starts)
    if source == "random":
        starts.append(random_box(data, total, rng))
    elif source in ("auto", "sweep", "rays") and known < min(FEWEST, total):
        starts.append(along_rays(data, total - known, around.extent, rng))
    counts = {kind: sum(len(start) for start in starts if start.kind == kind) for kind in KINDS}
    names = {
        "scene": "selected" if source == "selected" else "scene",
        "sweep": "sweep",
        "ray": "rays",
        "random": "random",
    }
    seeding = Seeding(
        points=source,
        source=" and ".join(name for kind, name in names.items() if counts[kind]),
        count=_number(starts),
        of=0 if data.points is None else len(data.points),
        **{f"{kind}_points": count for kind, count in counts.items()},
        **found,
    )
    return starts, seeding


def _number(starts: list[Start]) -> int:
    return sum(map(len, starts))
