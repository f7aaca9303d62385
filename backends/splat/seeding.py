"""Where the Gaussians start: points of the scene file, or points along the rays of the chosen views.

A start that needs neighbouring views to overlap would make diverse subsets look bad and redundant ones good. Neither
of these does: scene points are the same for every subset, and rays need one view each.
"""

from typing import Any

import numpy as np

from viewbench.backends._seeding import seen
from viewbench.backends._types import TrainingSet
from viewbench.backends.splat.layout import LOG_SCALE, LOGIT, MEAN, SH0, SH_C0, empty
from viewbench.common.errors import UserError, nearest

SOURCES = ("auto", "scene", "selected", "rays")
FEWEST = 500  # scene points below which rays are added
NEAR, FAR = 0.1, 1.2  # depths along rays, as shares of the cameras' extent


def seed(
    data: TrainingSet, count: int, source: str, rng: np.random.Generator, opacity: float, scale: float
) -> tuple[np.ndarray, dict[str, Any]]:
    """(ROWS, N) Gaussians to start from, N at most `count`, and what `train.json` records of them.

    `source` is "auto" (scene points where there are at least 500, else rays), "scene", "selected" (scene points whose
    track has at least two chosen views) or "rays". Raises UserError when the source has no points at all.
    """
    if source not in SOURCES:
        raise UserError(f"unknown source of points '{source}'{nearest(source, SOURCES)} (known: {', '.join(SOURCES)})")
    points, colours = np.zeros((0, 3)), np.zeros((0, 3))
    record: dict[str, Any] = {"asked": source, "source": "rays", "scene_points": 0, "ray_points": 0}
    if source in ("auto", "scene", "selected") and data.points is not None:
        use = np.flatnonzero(np.isfinite(data.points.xyz).all(axis=1))
        if source == "selected":
            use = use[seen(data)[use]]
        if len(use) > count:
            use = np.sort(rng.choice(use, count, replace=False))
        points, colours = data.points.xyz[use], data.points.rgb[use] / 255
        record |= {"source": "scene" if source == "auto" else source, "scene_points": len(use)}
    if source in ("scene", "selected") and not len(points):
        raise UserError(f"the scene has no points for '{source}'; use points 'rays'")
    if source == "rays" or (source == "auto" and len(points) < FEWEST):
        more, shades = along_rays(data, count - len(points), rng)
        points, colours = np.concatenate([points, more]), np.concatenate([colours, shades])
        record |= {"source": "scene and rays" if record["scene_points"] else "rays", "ray_points": len(more)}
    record["count"] = len(points)
    gaussians = empty(len(points))
    gaussians[MEAN : MEAN + 3] = points.T
    gaussians[LOG_SCALE : LOG_SCALE + 3] = np.log(scale * spacing(points))
    gaussians[LOGIT] = np.log(opacity / (1 - opacity))
    gaussians[SH0 : SH0 + 3] = (colours.T - 0.5) / SH_C0
    return gaussians, record


def along_rays(data: TrainingSet, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points at log-uniform depths on rays through random pixels of random views, and their colours."""
    k, height, width, _ = data.images.shape
    view = rng.integers(k, size=count)
    column, row = rng.integers(width, size=count), rng.integers(height, size=count)
    extent = camera_extent(data)
    depth = extent * np.exp(rng.uniform(np.log(NEAR), np.log(FAR), size=count))
    cameras = data.cameras
    x = (column + 0.5 - cameras.cx[view]) / cameras.fx[view] * depth
    y = (row + 0.5 - cameras.cy[view]) / cameras.fy[view] * depth
    inside = np.stack([x, -y, -depth], axis=1)
    points = np.einsum("nij,nj->ni", cameras.rotations[view], inside) + cameras.positions[view]
    return points, data.images[view, row, column].astype(np.float64)


def camera_extent(data: TrainingSet) -> float:
    """1.1 × the largest distance of a chosen camera from their middle (3DGS), at least a little."""
    positions = data.cameras.positions
    return max(1.1 * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max()), 1e-3)


def spacing(points: np.ndarray) -> np.ndarray:
    """(N,) root mean square distance to the three nearest neighbours, as 3DGS sets its first scales."""
    from scipy.spatial import cKDTree

    if len(points) < 4:
        return np.full(len(points), 0.1)
    distance, _ = cKDTree(points).query(points, k=4)
    return np.clip(np.sqrt((distance[:, 1:] ** 2).mean(axis=1)), 1e-5, None)
