"""Views drawn at random without repetition, the paper's Random baseline."""

import numpy as np

from ._types import Choice, Views

SEEDED = True
GREEDY = True
FACTORS = ()
PARAMETERS: dict = {}


def select(views: Views, count: int, rng: np.random.Generator) -> Choice:
    """The first `count` of a random order of all views, so that a larger count with the same seed adds views only.

    Views to keep stand at the head of the order.
    """
    order = rng.permutation(len(views))
    return Choice(np.concatenate([views.kept, order[~np.isin(order, views.kept)]])[:count])
