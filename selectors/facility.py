"""Views that the others resemble most: facility location, each view served by its most similar chosen one.

f(S) = Σ_i max_{j ∈ S} M_ij, maximised by the lazy greedy algorithm (Minoux 1978), within 1 − 1/e of the best choice
(Nemhauser, Wolsey and Fisher 1978); as a way of summarising data, Lin and Bilmes 2011.
"""

import time

import numpy as np

from ._columns import BLOCK, Columns
from ._sharpness import Preference
from ._similarity import describe, similarity
from ._types import Choice, Views

SEEDED = False
GREEDY = True
FACTORS = ("pos", "ang", "sem")
PARAMETERS = {"alpha": 0.7, "beta": 0.2, "sigma": 0.5, "factors": ["pos", "ang", "sem"], "sharpness": 0.0}


def select(
    views: Views,
    count: int,
    rng: np.random.Generator,
    alpha: float = 0.7,
    beta: float = 0.2,
    sigma: float = 0.5,
    factors: tuple[str, ...] = FACTORS,
    sharpness: float = 0.0,
) -> Choice:
    """Greedy maximiser of f, ties to the earlier frame but for rounding; a similarity below 0 counts as 0.

    f is submodular: a gain computed for a smaller S bounds the gain for a larger one. So only views whose bound
    reaches the best gain are computed again, a block at a time. O(N²) time to begin with, O(N) memory.
    """
    begin = time.perf_counter()
    similar = similarity(views, alpha, beta, sigma, factors)
    prefer = Preference(views.sharpness, sharpness, views.kept)
    n = len(views)
    columns = Columns(similar.columns, n)
    served = np.zeros(n)  # max_{j ∈ S} M_ij of every view i
    bounds = np.full(n, np.inf)  # gain of every view when it was last computed; −∞ once chosen
    everyone = np.arange(n)
    for block in np.split(everyone, everyone[BLOCK::BLOCK]):
        bounds[block] = np.maximum(similar.columns(block), 0).sum(axis=1)
    prepared_s = time.perf_counter() - begin
    chosen = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    for k in range(count):
        fresh = np.zeros(n, dtype=bool)
        while not fresh[pick := prefer.best(bounds)]:
            stale = np.where(fresh, -np.inf, bounds)
            stale[pick] = np.inf  # whatever else is computed again, the leader is
            block = np.argpartition(stale, -min(BLOCK, n))[-min(BLOCK, n) :]
            block = block[stale[block] > -np.inf]
            columns.fetch([pick, *block])
            for j in block:
                if j in columns:
                    bounds[j] = np.maximum(columns[j] - served, 0).sum()
                    fresh[j] = True
        chosen[k], gains[k] = pick, bounds[pick]
        np.maximum(served, columns[pick], out=served)
        bounds[pick] = -np.inf
        prefer.take(pick)
    return Choice(chosen, gains, {"similarity": prepared_s}, describe(similar, alpha, beta, factors))
