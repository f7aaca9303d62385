"""Positions as selection sees them: the training cameras' bounding box scaled to [-4, 4]."""

import numpy as np

EXTENT = 4.0


def normalised(positions: np.ndarray) -> np.ndarray:
    """p ← 4 (p − c) / max|p − c| with c the middle of the bounding box, one scale for the three axes.

    positions: (N, 3) camera centres in scene units. Cameras in a single point stay at 0.
    (Paper, Implementation Details: "all the camera locations are scaled to the range [-4,4]".)
    """
    centred = positions - (positions.min(axis=0) + positions.max(axis=0)) / 2
    extent = np.abs(centred).max()
    return EXTENT * centred / extent if extent > 0 else centred
