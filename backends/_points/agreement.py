"""Whether other views found by themselves the depth that a view found: a depth that one view alone sees is chance."""

import numpy as np

from ...common.kernels import exact

BEFORE = 1e-9  # scene units: nearer to a camera's plane a point has no pixel


@exact
def agreeing(
    positions: np.ndarray,
    witnesses: np.ndarray,
    projections: np.ndarray,
    w2c: np.ndarray,
    depth: np.ndarray,
    tolerance: float,
    count: np.ndarray,
) -> None:
    """Counts in `count` (P,) int64 the witnesses that have points (P, 3) where they have their own depth.

    witnesses: (S,) int64 views; projections: (V, 3, 4) float64 to homogeneous pixels; w2c: (V, 4, 4) float64;
    depth: (V, h, w) float32; tolerance: relative.
    """
    height, width = depth.shape[1], depth.shape[2]
    for n in range(len(positions)):
        x, y, z = positions[n, 0], positions[n, 1], positions[n, 2]
        found = 0
        for j in witnesses:
            p, row = projections[j], w2c[j, 2]
            far = row[0] * x + row[1] * y + row[2] * z + row[3]
            if not far > BEFORE:
                continue
            u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / far
            v = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / far
            if u >= 0 and v >= 0 and u < width and v < height:
                found += abs(depth[j, int(v), int(u)] - far) < tolerance * far
        count[n] = found
