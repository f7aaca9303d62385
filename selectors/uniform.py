"""Equal steps along the capture from a random start, wrapping at its end (the paper's Uniform)."""

import numpy as np

from viewbench.selectors._types import Choice, Views

SEEDED = True
FACTORS = ()
PARAMETERS: dict = {}


def select(views: Views, count: int, rng: np.random.Generator) -> Choice:
    """Rounded `linspace(0, N − 1, K)`, shifted by a random start and wrapped; in capture order.

    The steps are at least (N − 1) / (K − 1) ≥ 1 long, so that rounding never gives a frame twice.
    """
    n = len(views)
    steps = np.floor(np.linspace(0, n - 1, count) + 0.5).astype(np.int64)
    return Choice(np.sort((steps + rng.integers(n)) % n))
