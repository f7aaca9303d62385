"""The view whose nearest chosen view is farthest, one after another (the paper's z_DF)."""

import numpy as np

from viewbench.common.errors import UserError
from viewbench.selectors import _similarity
from viewbench.selectors._types import Choice, Views

SEEDED = True
FACTORS = ("pos", "ang", "sem")
PARAMETERS = {"alpha": 0.7, "beta": 0.2, "sigma": 0.5, "factors": ["pos", "ang", "sem"], "start": "random"}


def select(views: Views, count: int, rng: np.random.Generator, start: str = "random", **weights: object) -> Choice:
    """Greedy argmax over k of min over i in S of 1 − M[i, k] (paper, Eq. 5), ties to the lower index.

    `start` is "random", as the paper's, or "medoid", the view with the highest mean similarity, which needs no seed.
    O(N K) similarities, O(N) memory.
    """
    similar, notes = _similarity.similarity(views, **weights)  # type: ignore[arg-type]
    n = len(views)
    if start not in ("random", "medoid"):
        raise UserError(f"start is '{start}', expected random or medoid")
    first = int(rng.integers(n)) if start == "random" else medoid(similar)
    indices = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    indices[0], gains[0] = first, 0.0
    distance = 1 - similar.row(first)
    distance[first] = -np.inf
    for rank in range(1, count):
        pick = int(np.argmax(distance))
        indices[rank], gains[rank] = pick, distance[pick]
        np.minimum(distance, 1 - similar.row(pick), out=distance)
        distance[pick] = -np.inf
    return Choice(indices, gains, notes=notes)


def medoid(similar: _similarity.Similarity) -> int:
    """The view most like all others."""
    return int(np.argmax([similar.row(i).mean() for i in range(len(similar))]))
