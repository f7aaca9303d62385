"""Every view in capture order: the full-data reference."""

import numpy as np

from viewbench.selectors._types import Choice, Views

SEEDED = False
FACTORS = ()
PARAMETERS: dict = {}


def select(views: Views, count: int, rng: np.random.Generator) -> Choice:
    """All views; a count below their number takes the first ones."""
    return Choice(np.arange(count, dtype=np.int64))
