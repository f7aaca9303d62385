"""Where the Gaussians of a splatting trainer start: the scene's points, those that the chosen views see, or random."""

from typing import Any

import numpy as np

from ..common.errors import UserError, nearest
from ..scenes.splits import LEAST_TRACK
from ._types import TrainingSet

SOURCES = ("scene", "selected", "random")
MARGIN = 0.5  # the random box is larger than that of the cameras by this part of its longest edge on every side


def seed_points(
    data: TrainingSet, source: str, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """(P, 3) float64 positions, (P, 3) uint8 colours, and what `train.json` says of them.

    The points of a scene file were triangulated from all its training views, so that `scene` tells a trainer more than
    the chosen views do, and the same of every choice; `random` draws `count` in a box around the training cameras, for
    every choice the same too; `selected` keeps the points seen from at least two chosen views. Raises UserError for an
    unknown source and for one that the scene has no points for.
    """
    if source not in SOURCES:
        raise UserError(f"unknown source of points '{source}'{nearest(source, SOURCES)} (known: {', '.join(SOURCES)})")
    if source == "random":
        xyz = random_box(data, rng, count)
        rgb = rng.integers(0, 256, (count, 3), dtype=np.uint8)
        return xyz, rgb, {"points": "random", "count": count}
    if data.points is None or not len(data.points):
        raise UserError(f"scene '{data.scene}' has no points to start from; set points=random")
    keep = np.ones(len(data.points), dtype=bool)
    if source == "selected":
        keep = seen(data)
    if not keep.any():
        raise UserError(
            f"no point of scene '{data.scene}' is seen from {LEAST_TRACK} of the {len(data.names)} chosen views; "
            "set points=random or choose more views"
        )
    record = {"points": source, "count": int(keep.sum()), "of": len(keep)}
    return data.points.xyz[keep], data.points.rgb[keep], record


def seen(data: TrainingSet) -> np.ndarray:
    """(P,) bool: the points whose track has at least two chosen views.

    Raises UserError when the scene's format carries no tracks.
    """
    if data.points is None or data.points.seen_by is None:
        raise UserError(f"scene '{data.scene}' has no point tracks for points=selected; set points=random or scene")
    return np.array([np.isin(data.chosen, views).sum() >= LEAST_TRACK for views in data.points.seen_by])


def random_box(data: TrainingSet, rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3) uniform positions in the bounding box of all training cameras, grown on every side.

    The margin is a part of the box' longest edge; cameras in one place have none, and get a box of 1 scene unit.
    """
    low, high = data.training.positions.min(axis=0), data.training.positions.max(axis=0)
    margin = MARGIN * float((high - low).max()) or 0.5
    return rng.uniform(low - margin, high + margin, (count, 3))
