"""Which way is up, and the plane that a capture is looked at from above in, from camera poses alone."""

import numpy as np

SNAP_DEGREES = 20.0  # an up within this of a coordinate axis is that axis: rooms then stand square on the page
SMALLEST = 1e-6  # scene units between cameras that are not at one place
NEAR = 0.3  # scene points this far from the cameras are still shown, as a part of the cameras' extent


def plane(positions: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """(2, 3) axes to the right and up the page, seen from above.

    `positions` (N, 3) in scene units, `forward` (N, 3) unit viewing directions. People carry a camera at one height
    and look around, so up is the direction in which neither extends: the eigenvector of the smallest eigenvalue of
    Cov(positions) / tr + E[f fᵀ] / tr. Its sign is that from which the cameras look down on average.
    """
    spread = np.cov(positions.T, bias=True) if len(positions) > 1 else np.zeros((3, 3))
    looks = forward.T @ forward / len(forward)
    total = sum(part / np.trace(part) for part in (spread, looks) if np.trace(part) > 0)
    up = np.linalg.eigh(total)[1][:, 0]
    axis = int(np.argmax(np.abs(up)))
    if abs(up[axis]) > np.cos(np.radians(SNAP_DEGREES)):
        up = np.eye(3)[axis]
    if np.mean(forward @ up) > 0:
        up = -up
    # The coordinate axis that is most level points to the right, or as nearly as it can.
    level = int(np.argmin(np.abs(up)))
    right = np.eye(3)[level] - up[level] * up
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(up, right)])


def pieces(path: np.ndarray, share: float = 0.08) -> list[np.ndarray]:
    """`path` (N, 2) in capture order, cut where it jumps by more than `share` of its extent: held-out blocks and
    lost tracking leave gaps that no camera crossed."""
    if len(path) < 2:
        return [path]
    extent = np.ptp(path, axis=0).max()
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return np.split(path, np.flatnonzero(steps > share * extent) + 1)


def limits(cameras: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of what is shown: the cameras' box with room for arrows, never thinner than 2 : 5, grown
    to the points around it (walls) where they are near. Of cameras at one place, as on a tripod, the nearer half of
    the points is."""
    low, high = cameras.min(axis=0), cameras.max(axis=0)
    extent = (high - low).max()
    if extent < SMALLEST and len(points):
        extent = 2 * float(np.median(np.abs(points - low).max(axis=1)))
    extent = max(extent, SMALLEST)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.2 * extent) + 0.08 * extent
    near = points[np.all(np.abs(points - middle) < half + NEAR * extent, axis=1)]
    around = np.vstack([middle - half, middle + half, near])
    return around.min(axis=0), around.max(axis=0)


def round_length(most: float) -> float:
    """The longest of 1, 2, 5, 10, … and their tenths that is no more than `most`, which is positive."""
    power = 10 ** np.floor(np.log10(most))
    return float(max((step * power for step in (1, 2, 5) if step * power <= most), default=power))
