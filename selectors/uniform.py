"""Views at equal steps of the capture from a random start, the paper's Uniform baseline."""

import numpy as np

from viewbench.selectors._sharpness import sharpest_near
from viewbench.selectors._types import Choice, Views

SEEDED = True
FACTORS = ()
PARAMETERS = {"sharpness": 0.0}


def select(views: Views, count: int, rng: np.random.Generator, sharpness: float = 0.0) -> Choice:
    """i_k = (⌊k (N − 1) / (K − 1)⌋ + s) mod N for k = 0 … K − 1, with s drawn from 0 … N − 1.

    This is linspace(0, N − 1, K) rounded down in whole numbers, shifted and wrapped. Its step is at least 1, so the
    K views are distinct for every K ≤ N, and K = N gives all of them. K = 1 is the view s.

    With `sharpness` > 0 each view makes way for the sharpest one nearer to it than to its neighbours in the choice.
    """
    n = len(views)
    start = int(rng.integers(n))
    chosen = (np.arange(count) * (n - 1) // max(1, count - 1) + start) % n
    if sharpness > 0 and views.sharpness is not None:
        chosen = sharpest_near(chosen, views.sharpness)
    return Choice(chosen)
