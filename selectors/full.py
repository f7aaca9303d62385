"""Every view in capture order: the full-data reference."""

import numpy as np

from ..common.errors import UserError
from ._types import Choice, Views

SEEDED = False
GREEDY = True
FACTORS = ()
PARAMETERS: dict = {}


def select(views: Views, count: int, rng: np.random.Generator) -> Choice:
    """All views. Raises UserError when fewer are asked for: that would be a choice, which `full` does not make."""
    if count != len(views):
        raise UserError(f"'full' takes all {len(views)} views, not {count}; use ratio 1 or another selector")
    return Choice(np.arange(len(views)))
