"""Each next view is the one least similar to those already chosen: the paper's Max-Min Distance Function z_DF."""

import time

import numpy as np

from ._nearest import Nearest
from ._sharpness import Preference
from ._similarity import describe, similarity
from ._start import first
from ._types import Choice, Views

SEEDED = True
GREEDY = True
FACTORS = ("pos", "ang", "sem")
PARAMETERS = {
    "alpha": 0.7,
    "beta": 0.2,
    "sigma": 0.5,
    "factors": ["pos", "ang", "sem"],
    "start": "random",
    "sharpness": 0.0,
}


def select(
    views: Views,
    count: int,
    rng: np.random.Generator,
    alpha: float = 0.7,
    beta: float = 0.2,
    sigma: float = 0.5,
    factors: tuple[str, ...] = FACTORS,
    start: str = "random",
    sharpness: float = 0.0,
    within: float | None = None,
) -> Choice:
    """Greedy maximiser of z_DF: k* = argmax_k min_{i ∈ S} (1 − M_ik), ties to the earlier frame.

    The gain of a pick is that minimum; of the first pick it is 1, the largest distance there is. `start` is "random"
    as in the authors' code, or "medoid", which needs no seed. O(N K) time and O(N) memory beside the features.

    With `within` it stops as soon as every view left is that near to one chosen; `uncovered` in the notes is how near.
    """
    begin = time.perf_counter()
    similar = similarity(views, alpha, beta, sigma, factors)
    prepared_s = time.perf_counter() - begin
    prefer = Preference(views.sharpness, sharpness, views.kept)
    nearest = Nearest(similar)
    chosen = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    for k in range(count):
        if k >= max(1, len(views.kept)) and within is not None and nearest.distance.max() <= within:
            chosen, gains = chosen[:k], gains[:k]
            break
        pick = prefer.best(nearest.distance) if k else first(start, similar, prefer, rng)
        chosen[k], gains[k] = pick, nearest.distance[pick] if k else 1.0
        prefer.take(pick)
        nearest.add(pick)
    notes = describe(similar, alpha, beta, factors)
    if within is not None:
        notes["uncovered"] = max(0.0, float(nearest.distance.max()))
    return Choice(chosen, gains, {"similarity": prepared_s}, notes)
