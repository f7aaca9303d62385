"""How far a camera is from everything in a room, and where in it there is space for one."""

from dataclasses import dataclass

import numpy as np

from ._types import Part, Room

CLEARANCE_M = 0.2  # that a camera keeps
CELL_M = 0.1


def clearance(room: Room, points: np.ndarray) -> np.ndarray:
    """(P,) metres from (P, 3) points to the nearest part's box or wall; negative within a box or out of the room."""
    low, high = (np.asarray(corner) for corner in room.inside)
    least = np.minimum(points - low, high - points).min(axis=1)
    for part in room.parts:
        least = np.minimum(least, _distance(part, points))
    return least


def _distance(part: Part, points: np.ndarray) -> np.ndarray:
    """(P,) metres to the box of a part, negative within it."""
    beyond = np.abs((points - part.centre) @ part.axes) - part.half
    within = np.minimum(beyond.max(axis=1), 0.0)
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + within


@dataclass(frozen=True)
class Space:
    """Places of a grid where a camera keeps its clearance, each of which can be reached from all others."""

    points: np.ndarray  # (F, 3)
    low: np.ndarray  # (3,) the grid's first point
    free: np.ndarray  # (X, Y, Z) bool, every CELL_M

    def free_at(self, points: np.ndarray) -> np.ndarray:
        """(…,) bool, whether the nearest place of the grid to (…, 3) points is free."""
        index = np.round((points - self.low) / CELL_M).astype(int)
        inside = ((index >= 0) & (index < self.free.shape)).all(axis=-1)
        index = np.clip(index, 0, np.array(self.free.shape) - 1)
        return inside & self.free[index[..., 0], index[..., 1], index[..., 2]]


def space(room: Room, least: float = CLEARANCE_M) -> Space:
    """The largest connected part of the room where a camera is at least `least` metres from everything."""
    from scipy.ndimage import label

    low, high = (np.asarray(corner, dtype=np.float64) for corner in room.inside)
    first = low + least
    axes = [np.arange(first[k], high[k] - least + 1e-9, CELL_M) for k in range(3)]
    shape = tuple(len(axis) for axis in axes)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    free = (clearance(room, grid.reshape(-1, 3)) >= least).reshape(shape)
    found, _ = label(free)  # type: ignore[misc]
    sizes = np.bincount(found[free]) if free.any() else np.zeros(1)
    free = (found == int(np.argmax(sizes))) & free
    return Space(grid[free], first, free)
