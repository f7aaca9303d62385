"""Where a scene is and how deep it goes, by its training poses and points: one answer for every choice of views.

A trainer needs a unit of length (its rates and radii), a near plane and a range of depths. Taken from the chosen views
they would differ between the choices that are compared, and a selector would be judged by them too.
"""

from dataclasses import dataclass

import numpy as np

from ..scenes.types import Cameras, Points

VIEWS, POINTS, FEWEST_DEPTHS = 400, 2000, 100  # looked at, at most; depths that are worth going by, at least
NEAREST, NEAR, FAR = 0.001, 0.01, 0.99  # quantiles of the depths
NEAR_PLANE = 0.25  # share of the nearest depth that trainers put their near plane at
BEYOND = 0.5, 3.0  # the range of depths, as multiples of NEAR and FAR: mirrors and windows are deeper than points
# Where there are no points: depths as multiples of the mean reach of the cameras (along the two longest of their axes),
# of which a straight path has one; and the farthest, of their extent.
GUESSED_NEAREST, NARROWEST, GUESSED_FAR = 0.2, 0.1, 4.0


@dataclass(frozen=True)
class Surroundings:
    """The same for every choice of views of one scene; lengths in scene units."""

    centre: np.ndarray  # (3,) mean of the training cameras
    extent: float  # 1.1 × the largest distance of a training camera from it, as the 3DGS authors take it
    nearest: float  # depth in front of a camera below which there is next to nothing
    depths: tuple[float, float]  # nearest and farthest depth at which a surface may be


def surroundings(training: Cameras, points: Points | None) -> Surroundings:
    """From the poses of all training views and, where a trainer may know them, the scene's points.

    With points the depths are theirs in the views that see them (by their tracks, or else by the frames alone).
    Without, they are guessed from how far the cameras reach, for a room not from the length of the path through it.
    Cameras in one place say nothing of the scene's size: then its points do, or else it is 1.
    """
    centre = training.positions.mean(axis=0)
    extent = _extent(training, centre, points)
    depths = np.zeros(0) if points is None else _depths(training, points)
    if len(depths) >= FEWEST_DEPTHS:
        nearest, near, far = np.quantile(depths, [NEAREST, NEAR, FAR])
        return Surroundings(centre, extent, float(nearest), (BEYOND[0] * float(near), BEYOND[1] * float(far)))
    nearest = GUESSED_NEAREST * _reach(training, centre, extent)
    return Surroundings(centre, extent, nearest, (BEYOND[0] * nearest, GUESSED_FAR * extent))


def _extent(training: Cameras, centre: np.ndarray, points: Points | None) -> float:
    extent = 1.1 * float(np.linalg.norm(training.positions - centre, axis=1).max())
    if extent > 1e-6 * float(np.abs(centre).max()):
        return extent
    if points is not None:
        distance = np.linalg.norm(points.xyz - centre, axis=1)
        distance = distance[np.isfinite(distance) & (distance > 0)]
        if len(distance):
            return float(np.median(distance))
    return 1.0


def _reach(training: Cameras, centre: np.ndarray, extent: float) -> float:
    """Geometric mean of the cameras' reach along the two longest of their principal axes."""
    offsets = training.positions - centre
    axes = np.linalg.svd(offsets, full_matrices=False)[2]
    along = np.sort(np.abs(offsets @ axes.T).max(axis=0, initial=0))[::-1]
    longest = float(along[0]) if len(along) and along[0] > 1e-6 * extent else extent
    second = float(along[1]) if len(along) > 1 else 0.0
    return float(np.sqrt(longest * max(second, NARROWEST * longest)))


def _depths(training: Cameras, points: Points) -> np.ndarray:
    """Depths of points in the training views that see them."""
    finite = np.flatnonzero(np.isfinite(points.xyz).all(axis=1))
    w2c = training.world_to_camera()
    if points.seen_by is not None:
        counts = np.array([len(points.seen_by[i]) for i in finite], dtype=np.int64)
        if not counts.sum():
            return np.zeros(0)
        views = np.concatenate([points.seen_by[i] for i in finite]).astype(np.int64)
        of = np.repeat(finite, counts)
        depths = np.einsum("nb,nb->n", w2c[views, 2, :3], points.xyz[of]) + w2c[views, 2, 3]
        return depths[depths > 0]
    views = np.unique(np.linspace(0, len(training) - 1, min(len(training), VIEWS)).round().astype(np.int64))
    xyz = points.xyz[finite[:: max(1, len(finite) // POINTS)]]
    depths = np.einsum("kb,nb->kn", w2c[views, 2, :3], xyz) + w2c[views, 2, 3:]
    return depths[visible(xyz, w2c[views], training[views])]


def visible(points: np.ndarray, w2c: np.ndarray, cameras: Cameras) -> np.ndarray:
    """(K, N) bool: which of the points (N, 3) lie in the frames of the cameras, (K, 4, 4) world-to-camera."""
    x, y, z = points.T
    # Written out: einsum takes ten times as long for such short sums, and BLAS other bits on other machines.
    right, down, depth = (
        w2c[:, a, 0, None] * x + w2c[:, a, 1, None] * y + w2c[:, a, 2, None] * z + w2c[:, a, 3, None] for a in range(3)
    )
    z = np.where(depth > 1e-9, depth, np.inf)
    u = cameras.fx[:, None] * right / z + cameras.cx[:, None]
    v = cameras.fy[:, None] * down / z + cameras.cy[:, None]
    in_frame = (u > 0) & (v > 0) & (u < cameras.width[:, None]) & (v < cameras.height[:, None])
    return np.isfinite(z) & in_frame
