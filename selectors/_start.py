"""The first view of a greedy order: a random one, or the one most like all others."""

import numpy as np

from ..common.errors import UserError, nearest
from ._columns import BLOCK
from ._sharpness import Preference
from ._similarity import Similarity

STARTS = ("random", "medoid")


def first(start: str, similar: Similarity, prefer: Preference, rng: np.random.Generator) -> int:
    """Index of the first view. `medoid` draws nothing and takes O(N²) time.

    Raises UserError for another word.
    """
    if start not in STARTS:
        raise UserError(f"unknown start '{start}'{nearest(start, STARTS)} (there are: {', '.join(STARTS)})")
    return prefer.any(rng, len(similar)) if start == "random" else prefer.best(total_similarity(similar))


def total_similarity(similar: Similarity) -> np.ndarray:
    """(N,) Σ_i M_ij for every view j, largest for the medoid."""
    views = np.arange(len(similar))
    return np.concatenate([similar.columns(block).sum(axis=1) for block in np.split(views, views[BLOCK::BLOCK])])
