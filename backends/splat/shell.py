"""A sphere of large Gaussians around everything: what is seen where nothing else is, in any viewer.

Where no chosen view looks, a model has holes, and the black behind them costs more than any blur. The shell takes its
colours from the pixels that look its way, and from the nearest such directions where none does; training refines
them. Skies and the world behind windows start there too.
"""

import numpy as np

from .._surroundings import Surroundings
from .._types import TrainingSet

RADIUS = 4.0  # of the cameras' extent
SIZE = 0.7  # of a Gaussian, of the mean distance to its neighbour
SAMPLES = 16  # rows and columns of pixels taken of each view


def shell(data: TrainingSet, count: int, around: Surroundings) -> tuple[np.ndarray, np.ndarray, float]:
    """(count, 3) positions, (count, 3) colours in [0, 1], and the Gaussians' standard deviation in scene units."""
    from scipy.spatial import KDTree

    directions = _even(count)
    tree = KDTree(directions, leafsize=16)  # with other leaves, another of two equally near
    cameras = data.cameras
    _, height, width, _ = data.images.shape
    rows = np.unique(np.linspace(0, height - 1, min(SAMPLES, height)).astype(np.int64))
    columns = np.unique(np.linspace(0, width - 1, min(SAMPLES, width)).astype(np.int64))
    row, column = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
    total, seen = np.zeros((count, 3)), np.zeros(count)
    for i, image in enumerate(data.images):
        x = (column + 0.5 - cameras.cx[i]) / cameras.fx[i]
        y = (row + 0.5 - cameras.cy[i]) / cameras.fy[i]
        rays = np.stack([x, -y, -np.ones(len(x))], axis=1) @ cameras.rotations[i].T
        nearest = tree.query(rays / np.linalg.norm(rays, axis=1, keepdims=True))[1]
        np.add.at(total, nearest, image[row, column])
        np.add.at(seen, nearest, 1)
    known = seen > 0
    colours = np.zeros((count, 3))
    colours[known] = total[known] / seen[known, None]
    if not known.all():
        k_nearest = min(8, int(known.sum()))
        found = KDTree(directions[known], leafsize=16).query(directions[~known], k=k_nearest)
        distance, nearest = (part.reshape(-1, k_nearest) for part in found)  # the axis of a single neighbour is dropped
        weight = 1 / (distance + 1e-3)
        colours[~known] = (colours[known][nearest] * weight[..., None]).sum(1) / weight.sum(1, keepdims=True)
    radius = RADIUS * around.extent
    return around.centre + radius * directions, colours, SIZE * radius * np.sqrt(4 * np.pi / count)


def _even(count: int) -> np.ndarray:
    """(count, 3) unit vectors, spread evenly: the Fibonacci lattice (González 2010)."""
    at = np.arange(count) + 0.5
    z, angle = 1 - 2 * at / count, np.pi * (1 + np.sqrt(5)) * at
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
