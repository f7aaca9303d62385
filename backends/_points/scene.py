"""Points of the scene file: all of them, or those that the chosen views see."""

import numpy as np

from ...common.errors import UserError
from ...scenes.splits import LEAST_TRACK
from .._types import TrainingSet
from .start import Start


def scene_points(data: TrainingSet, source: str, most: int | None, rng: np.random.Generator) -> list[Start]:
    """At most `most` of the scene's points, drawn where there are more; none for "auto" where the scene has none.

    Points that are not finite are left out. Raises UserError where "scene" or "selected" finds none.
    """
    if data.points is None:
        use = np.zeros(0, np.int64)
    else:
        use = np.flatnonzero(np.isfinite(data.points.xyz).all(axis=1))
        if source == "selected" and len(use):
            use = use[seen(data)[use]]
            if not len(use):
                raise UserError(
                    f"no point of scene '{data.scene}' is seen from {LEAST_TRACK} of the {len(data.names)} chosen "
                    "views; set points=sweep or choose more views"
                )
    if data.points is None or not len(use):
        if source == "auto":
            return []
        raise UserError(f"scene '{data.scene}' has no points to start from; set points=sweep, or points=random")
    if most is not None and len(use) > most:
        use = np.sort(rng.choice(use, most, replace=False))
    return [Start(data.points.xyz[use], data.points.rgb[use] / 255, "scene")]


def seen(data: TrainingSet) -> np.ndarray:
    """(P,) bool: the points whose track has at least two chosen views.

    Raises UserError when the scene's format carries no tracks.
    """
    if data.points is None or data.points.seen_by is None:
        raise UserError(f"scene '{data.scene}' has no point tracks for points=selected; set points=scene or sweep")
    return np.array([np.isin(data.chosen, views).sum() >= LEAST_TRACK for views in data.points.seen_by])
