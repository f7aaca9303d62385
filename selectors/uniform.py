"""Views at equal steps of the capture from a random start, the paper's Uniform baseline."""

import numpy as np

from ..common.errors import UserError, nearest
from ._sharpness import sharpest_near
from ._types import Choice, Views

SEEDED = True
FACTORS = ()
PARAMETERS = {"steps": "equal", "sharpness": 0.0}
STEPS = ("equal", "linspace")


def select(views: Views, count: int, rng: np.random.Generator, steps: str = "equal", sharpness: float = 0.0) -> Choice:
    """i_k = (⌊k N / K⌋ + s) mod N for k = 0 … K − 1, with s drawn from 0 … N − 1.

    Every step, that over the end of the capture too, is ⌊N / K⌋ or one more, so that the K views are distinct and K = N
    gives all of them.

    `steps` = "linspace" is what the paper's authors run: ⌊k (N − 1) / (K − 1)⌋, linspace(0, N − 1, K) rounded down,
    shifted by s and wrapped. Its first and last view are 0 and N − 1 before the shift, which makes them neighbours:
    two of its K views are nearly one.

    With `sharpness` > 0 each view makes way for the sharpest one nearer to it than to its neighbours in the choice.
    Raises UserError for another word than those of `steps`.
    """
    if steps not in STEPS:
        raise UserError(f"unknown steps '{steps}'{nearest(steps, STEPS)} (there are: {', '.join(STEPS)})")
    n = len(views)
    start = int(rng.integers(n))
    k = np.arange(count)
    chosen = (k * n // count if steps == "equal" else k * (n - 1) // max(1, count - 1)) + start
    chosen %= n
    if sharpness > 0 and views.sharpness is not None:
        chosen = sharpest_near(chosen, views.sharpness)
    return Choice(chosen)
