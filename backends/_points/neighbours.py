"""Which views can say how deep the pixels of a view are: those that see the same space at a useful angle."""

import numpy as np

from ...scenes.types import Cameras
from .._surroundings import visible

ANGLE, NARROWER, WIDER = 8.0, 4.0, 14.0  # degrees between two rays: best to match, and how fast others are worse
SAMPLES = 96  # points in a view's frustum


def neighbours(
    cameras: Cameras, views: np.ndarray, most: int, near: float, far: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """(V, most) of all K cameras for each of `views` (V,), best first, and how good each is, (V, most), 0 for useless.

    A neighbour is as good as the share of random points in the view's frustum, at depths from `near` to `far`, that
    it sees too, each weighted by the angle between the two rays, with 1 at the best angle for matching (the scores of
    MVSNet, Yao et al. 2018, with points of the frustum in place of those of a reconstruction). No common focus of the
    cameras is needed, whichever way they face.
    """
    k = len(cameras)
    depth = np.exp(rng.uniform(np.log(near), np.log(far), SAMPLES))
    across, down = rng.uniform(0, 1, (2, SAMPLES))
    w2c = cameras.world_to_camera()
    best = np.zeros((len(views), min(most, k - 1)), np.int64)
    value = np.zeros(best.shape)
    for row, i in enumerate(views):
        x = (across * cameras.width[i] - cameras.cx[i]) / cameras.fx[i] * depth
        y = (down * cameras.height[i] - cameras.cy[i]) / cameras.fy[i] * depth
        points = np.stack([x, -y, -depth], axis=1) @ cameras.rotations[i].T + cameras.positions[i]
        inside = visible(points, w2c, cameras)
        # Angles of the points that are seen alone: they are few, and the rest weighs nothing.
        other, point = np.nonzero(inside)
        mine, theirs = points[point] - cameras.positions[i], points[point] - cameras.positions[other]
        lengths = np.linalg.norm(mine, axis=-1) * np.linalg.norm(theirs, axis=-1)
        angle = np.degrees(np.arccos(np.clip((mine * theirs).sum(-1) / np.maximum(lengths, 1e-12), -1, 1)))
        off = (angle - ANGLE) / np.where(angle < ANGLE, NARROWER, WIDER)
        good = np.zeros(inside.shape)
        good[other, point] = np.exp(-0.5 * off**2)
        weight = good.mean(axis=1)
        weight[i] = -1
        best[row] = np.argsort(-weight, kind="stable")[: best.shape[1]]
        value[row] = weight[best[row]]
    return best, value
