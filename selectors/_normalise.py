"""Scales camera positions to [-4, 4], the units in which the paper's σ, α, β and γ are given."""

import numpy as np


def normalise(positions: np.ndarray) -> np.ndarray:
    """p ← 4 (p − c) / max|p − c|, with c the middle of the cameras' bounding box; one scale for the three axes.

    `positions` is (N, 3) in scene units and holds the training cameras only. Cameras that all stand in one place
    become zeros: no scale would move them apart.
    """
    p = np.asarray(positions, dtype=np.float64)
    p = p - (p.min(axis=0) + p.max(axis=0)) / 2
    reach = np.abs(p).max()
    return 4 * (p / reach) if reach > 0 else np.zeros_like(p)
