"""Points drawn where nothing is known: at random depths along the rays of the chosen views, or in a random box."""

import numpy as np

from .._types import TrainingSet
from .start import Start

NEAR, FAR = 0.1, 1.2  # depths along rays, as shares of the cameras' extent
MARGIN = 0.5  # the random box is larger than that of the cameras by this part of its longest edge on every side


def along_rays(data: TrainingSet, count: int, extent: float, rng: np.random.Generator) -> Start:
    """`count` points at log-uniform depths on rays through random pixels of random views, with their colours."""
    k, height, width, _ = data.images.shape
    view = rng.integers(k, size=count)
    column, row = rng.integers(width, size=count), rng.integers(height, size=count)
    depth = extent * np.exp(rng.uniform(np.log(NEAR), np.log(FAR), size=count))
    cameras = data.cameras
    x = (column + 0.5 - cameras.cx[view]) / cameras.fx[view] * depth
    y = (row + 0.5 - cameras.cy[view]) / cameras.fy[view] * depth
    inside = np.stack([x, -y, -depth], axis=1)
    points = np.einsum("nij,nj->ni", cameras.rotations[view], inside) + cameras.positions[view]
    colours = np.zeros((count, 3))
    for i in np.unique(view):
        of = np.flatnonzero(view == i)
        colours[of] = data.images[int(i)][row[of], column[of]]
    return Start(points, colours, "ray")


def random_box(data: TrainingSet, count: int, rng: np.random.Generator) -> Start:
    """`count` uniform points of random colours in the bounding box of all training cameras, grown on every side.

    The margin is a part of the box' longest edge; cameras in one place have none, and get a box of 1 scene unit.
    """
    low, high = data.training.positions.min(axis=0), data.training.positions.max(axis=0)
    margin = MARGIN * float((high - low).max()) or 0.5
    positions = rng.uniform(low - margin, high + margin, (count, 3))
    return Start(positions, rng.integers(0, 256, (count, 3), dtype=np.uint8) / 255, "random")
