"""Moves Gaussians that have faded out onto visible ones (3DGS-MCMC, Kheradmand et al. 2024, Eq. 9)."""

import math

import numpy as np

from .backward import Moments
from .layout import LOG_SCALE, LOGIT

DEAD = 0.005  # opacity
MOST = 20  # copies of one Gaussian at a time


def relocate(gaussians: np.ndarray, moments: Moments, rng: np.random.Generator, dead_below: float = DEAD) -> int:
    """Replaces dead Gaussians by copies of living ones, drawn by opacity, so that the picture hardly changes.

    A Gaussian that becomes n gets opacity o' = 1 - (1 - o)^(1/n), and scales shrunk by o / Σᵢ Σₖ of the paper's
    Eq. 9. Their moments start anew. Returns how many were moved.
    """
    opacity = 1 / (1 + np.exp(-gaussians[LOGIT].astype(np.float64)))
    dead, alive = np.flatnonzero(opacity <= dead_below), np.flatnonzero(opacity > dead_below)
    if not len(dead) or not len(alive):
        return 0
    source = rng.choice(alive, len(dead), p=opacity[alive] / opacity[alive].sum())
    used, copies = np.unique(source, return_counts=True)
    number = np.minimum(copies + 1, MOST)
    old = opacity[used]
    new = 1 - (1 - old) ** (1 / number)
    shrink = old / np.array([_norm(o, n) for o, n in zip(new, number, strict=True)])
    gaussians[LOGIT, used] = np.log(np.clip(new, DEAD, 1 - 1e-6) / (1 - np.clip(new, DEAD, 1 - 1e-6)))
    gaussians[LOG_SCALE : LOG_SCALE + 3, used] += np.log(shrink)
    gaussians[:, dead] = gaussians[:, source]
    for moment in moments:
        moment[:, dead] = 0
        moment[:, used] = 0
    return len(dead)


def _norm(opacity: float, n: int) -> float:
    return sum(
        math.comb(i - 1, k) * (-1) ** k / math.sqrt(k + 1) * opacity ** (k + 1)
        for i in range(1, n + 1)
        for k in range(i)
    )
