"""The greedy maximiser of log det M_S over the chosen views (the paper's z_DPP)."""

import numpy as np

from viewbench.selectors import _similarity
from viewbench.selectors._types import Choice, Views

SEEDED = True
FACTORS = ("pos", "ang", "sem")
PARAMETERS = {"alpha": 0.7, "beta": 0.2, "sigma": 0.5, "factors": ["pos", "ang", "sem"]}
PRECISION = 1e-10  # residuals of M's unit diagonal below this are rounding, not geometry


def select(views: Views, count: int, rng: np.random.Generator, **weights: object) -> Choice:
    """Greedy picks by incremental Cholesky (Chen et al. 2018, "Fast Greedy MAP Inference for DPP"), O(N K²).

    The gain of view k is log d²ₖ with d²ₖ its squared residual against the chosen ones; all are 1 before the first
    pick, which is therefore drawn. Once the largest residual is below precision the determinant no longer tells
    views apart: from there on the max-min distance does, and the notes say from which pick.
    """
    similar, notes = _similarity.similarity(views, **weights)  # type: ignore[arg-type]
    n = len(views)
    factor = np.zeros((count, n))
    residual = np.ones(n)
    distance = np.full(n, np.inf)
    free = np.ones(n, dtype=bool)
    indices = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    exhausted = None
    pick = int(rng.integers(n))
    for rank in range(count):
        if rank:
            pick = int(np.argmax(np.where(free, residual, -np.inf)))
            if exhausted is None and residual[pick] < PRECISION:
                exhausted = rank
            if exhausted is not None:
                pick = int(np.argmax(np.where(free, distance, -np.inf)))
        indices[rank] = pick
        gains[rank] = np.log(max(residual[pick], PRECISION)) if exhausted is None else np.log(PRECISION)
        free[pick] = False
        row = similar.row(pick)
        np.minimum(distance, 1 - row, out=distance)
        if exhausted is None:
            factor[rank] = (row - factor[:rank, pick] @ factor[:rank]) / np.sqrt(residual[pick])
            residual = np.maximum(residual - factor[rank] ** 2, 0.0)
    if exhausted is not None:
        notes["below_precision_from"] = exhausted
    return Choice(indices, gains, notes=notes)
