"""Any views, each subset as likely as any other (the paper's Random)."""

import numpy as np

from viewbench.selectors._types import Choice, Views

SEEDED = True
FACTORS = ()
PARAMETERS: dict = {}


def select(views: Views, count: int, rng: np.random.Generator) -> Choice:
    """The first `count` of a random permutation, so that a larger ratio adds views to those of a smaller one."""
    return Choice(rng.permutation(len(views))[:count].astype(np.int64))
