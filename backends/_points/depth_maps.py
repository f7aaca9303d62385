"""Depths of the chosen views by plane sweep: which of them to believe, and what to put where there are none."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from ...common import threads
from ...scenes.types import Cameras
from .._shrink import cameras_shrunk, images_shrunk
from .._types import TrainingSet
from .agreement import agreeing
from .neighbours import neighbours
from .plane_sweep import sweep

SIDE = 64  # pixels: about the geometric mean of the sides of the pictures that are compared
PLANES = 48
VIEWS = 60  # at most so many views get depths, evenly chosen
SOURCES = 3  # neighbours that a view is compared with
LEAST_VALUE = 0.02  # of a neighbour that is of any use
LEAST_SCORE = 0.7  # correlation of a depth that is believed
WITNESSES, AGREEING = 8, 2  # of so many other views, so many must have found the same depth by themselves,
TOLERANCE = 0.06  # relative
LEAST_SURE = 0.02  # share of a view's depths that are believed, below which the others are not guessed from them


@dataclass(frozen=True)
class DepthMaps:
    """Depths of V views of h x w pixels."""

    cameras: Cameras  # V, of the small pictures
    images: np.ndarray  # (V, h, w, 3) float32
    depth: np.ndarray  # (V, h, w) float32, scene units along the optical axis
    sure: np.ndarray  # (V, h, w) bool: compares well, and other views agree
    guessed: np.ndarray  # (V, h, w) bool: not sure, `depth` is that of the nearest sure pixel of the view

    def points(self, which: np.ndarray, depth: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(P, 3) positions and (P, 3) colours of flat pixel indices (P,), at their depths or at those given (P,)."""
        view, row, column = np.unravel_index(which, self.depth.shape)
        z = (self.depth[view, row, column] if depth is None else depth).astype(np.float64)
        cameras = self.cameras
        x = (column + 0.5 - cameras.cx[view]) / cameras.fx[view] * z
        y = (row + 0.5 - cameras.cy[view]) / cameras.fy[view] * z
        inside = np.stack([x, -y, -z], axis=1)
        positions = np.einsum("pij,pj->pi", cameras.rotations[view], inside) + cameras.positions[view]
        return positions, self.images[view, row, column].astype(np.float64)


def depth_maps(data: TrainingSet, depths: tuple[float, float], rng: np.random.Generator) -> DepthMaps:
    """Depth maps of the chosen views, all of them or VIEWS evenly chosen ones.

    `depths` are the nearest and the farthest that are tried, in scene units.
    """
    k, height, width, _ = data.images.shape
    shrink = max(1, round(math.sqrt(height * width) / SIDE))
    cameras = cameras_shrunk(data.cameras, shrink)
    views = np.unique(np.linspace(0, k - 1, min(k, VIEWS)).round().astype(np.int64))
    near, far = depths
    planes = np.geomspace(near, far, PLANES)
    inner, w2c = _intrinsics(cameras), cameras.world_to_camera()
    sources, value = neighbours(cameras, views, SOURCES, near, far, rng)
    # Of thousands of views most are never looked at: those in use alone are kept, small, at these places.
    used = np.union1d(views, sources[value > LEAST_VALUE])
    place = np.searchsorted(used, np.arange(k))
    images = images_shrunk((data.images[int(i)] for i in used), shrink)
    grey = np.ascontiguousarray(images.mean(axis=-1, dtype=np.float32))
    depth = np.zeros((len(views), *grey.shape[1:]), np.float32)
    score = np.full(depth.shape, -1, np.float32)

    def look(row: int) -> None:
        i, use = views[row], sources[row][value[row] > LEAST_VALUE]
        if not len(use):
            return
        relative = w2c[use] @ np.linalg.inv(w2c[i])
        homographies = np.empty((len(use), 3, 4))
        homographies[:, :, :3] = inner[use] @ relative[:, :3, :3] @ np.linalg.inv(inner[i])
        homographies[:, :, 3] = np.einsum("sab,sb->sa", inner[use], relative[:, :3, 3])
        sweep(grey[place[i]], grey[place[use]], homographies, planes, depth[row], score[row])

    for _ in threads.over(look, range(len(views))):
        pass
    believed = DepthMaps(cameras[views], images[place[views]], depth, score > LEAST_SCORE, np.zeros(depth.shape, bool))
    believed.sure[:] &= _agreed(believed, near, far, rng)
    _guess(believed)
    return believed


def _agreed(maps: DepthMaps, near: float, far: float, rng: np.random.Generator) -> np.ndarray:
    """(V, h, w) bool: pixels whose depth enough of the views that overlap most have found too."""
    count, height, width = maps.depth.shape
    if count < 2:
        return np.zeros(maps.depth.shape, bool)
    w2c = maps.cameras.world_to_camera()
    projections = _intrinsics(maps.cameras) @ w2c[:, :3]
    witnesses, _ = neighbours(maps.cameras, np.arange(count), WITNESSES, near, far, rng)
    agreed = np.zeros((count, height * width), bool)
    for i in range(count):
        candidates = np.flatnonzero(maps.sure[i])
        positions, _ = maps.points(candidates + i * height * width)
        found = np.zeros(len(candidates), np.int64)
        agreeing(positions, witnesses[i], projections, w2c, maps.depth, TOLERANCE, found)
        agreed[i, candidates] = found >= min(AGREEING, count - 1)
    return agreed.reshape(maps.depth.shape)


def _guess(maps: DepthMaps) -> None:
    """Gives pixels that are not sure the depth of the nearest that is, in views that have enough of these."""
    from scipy.ndimage import distance_transform_edt

    for depth, sure, guessed in zip(maps.depth, maps.sure, maps.guessed, strict=True):
        if sure.mean() >= LEAST_SURE:
            nearest = distance_transform_edt(~sure, return_distances=False, return_indices=True)
            row, column = cast(np.ndarray, nearest)
            depth[:] = depth[row, column]
            guessed[:] = ~sure


def _intrinsics(cameras: Cameras) -> np.ndarray:
    """(N, 3, 3)."""
    inner = np.zeros((len(cameras), 3, 3))
    inner[:, 0, 0], inner[:, 1, 1], inner[:, 2, 2] = cameras.fx, cameras.fy, 1
    inner[:, 0, 2], inner[:, 1, 2] = cameras.cx, cameras.cy
    return inner
