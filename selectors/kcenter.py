"""Farthest-first traversal in one factor alone: positions, rotations or features (Gonzalez 1985)."""

import numpy as np

from ..common.errors import UserError, nearest
from ._sharpness import Preference
from ._similarity import Similarity, similarity
from ._start import first
from ._types import FACTORS as ALL_FACTORS
from ._types import Choice, Views

SEEDED = True
GREEDY = True
FACTORS = ("pos",)
PARAMETERS = {"factors": ["pos"], "start": "random", "sharpness": 0.0}


def select(
    views: Views,
    count: int,
    rng: np.random.Generator,
    factors: tuple[str, ...] = FACTORS,
    start: str = "random",
    sharpness: float = 0.0,
) -> Choice:
    """Each next view is the one farthest from those chosen: a 2-approximation of the k-center problem.

    The distance is the factor's own, in its own unit: Euclidean with positions in [-4, 4] (`pos`), the angle of the
    rotation between two cameras in radians (`ang`), or the angle between two feature vectors (`sem`). The gain of a
    pick is its distance to the nearest view chosen before, hence the radius that the choice so far covers; of the
    first pick it is the largest distance to it. O(N K) time.

    Raises UserError unless exactly one factor is given.
    """
    if len(factors) != 1 or factors[0] not in ALL_FACTORS:
        hint = "".join(nearest(factor, ALL_FACTORS) for factor in factors[:1] if factor not in ALL_FACTORS)
        raise UserError(f"'kcenter' takes one factor of {', '.join(ALL_FACTORS)}, not '{', '.join(factors)}'{hint}")
    if factors[0] == "sem" and views.features is None:
        raise UserError("'kcenter' on the factor 'sem' needs image features; name an encoder or give --features")
    weight = {"pos": (1.0, 0.0), "ang": (0.0, 1.0), "sem": (0.0, 0.0)}[factors[0]]
    similar = similarity(views, *weight, factors=factors)
    prefer = Preference(views.sharpness, sharpness, views.kept)
    distance = np.full(len(views), np.inf)
    chosen = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    for k in range(count):
        chosen[k] = pick = prefer.best(distance) if k else first(start, similar, prefer, rng)
        prefer.take(pick)
        away = _distance(factors[0], views, similar, pick)
        gains[k] = distance[pick] if k else away.max()
        np.minimum(distance, away, out=distance)
        distance[pick] = -np.inf  # stays so: no distance is smaller
    return Choice(chosen, gains)


def _distance(factor: str, views: Views, similar: Similarity, j: int) -> np.ndarray:
    """(N,) distance of every view to the view j in one factor."""
    if factor == "pos":
        return np.linalg.norm(views.positions - views.positions[j], axis=1)
    if factor == "ang":  # trace(R_iᵀ R_j) = 1 + 2 cos θ
        return np.arccos(np.clip((similar.turns @ similar.turns[j] - 1) / 2, -1, 1))
    return np.arccos(np.clip(similar.semantic(j), -1, 1))
