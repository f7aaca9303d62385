"""How Gaussians lie in memory: one row of float32 per parameter, one column per Gaussian.

All parameters are stored as the optimiser sees them: log scales, opacity logits, unnormalised quaternions (w, x, y, z)
and spherical-harmonics coefficients, as in the 3DGS paper (Kerbl et al. 2023, Section 5).
"""

import numpy as np

MEAN = 0  # 3 rows: x, y, z in scene units
QUATERNION = 3  # 4 rows: w, x, y, z
LOG_SCALE = 7  # 3 rows
LOGIT = 10  # 1 row: opacity before the sigmoid
SH0 = 11  # 3 rows: degree 0 of red, green, blue
SH1 = 14  # 9 rows: degree 1, coefficient by coefficient, each red, green, blue
ROWS = 23

SH_C0 = 0.28209479177387814  # Y₀₀
SH_C1 = 0.4886025119029199  # factor of y, z, x in degree 1


def empty(count: int) -> np.ndarray:
    """(ROWS, count) float32 of invisible unit-quaternion Gaussians."""
    gaussians = np.zeros((ROWS, count), dtype=np.float32)
    gaussians[QUATERNION] = 1
    gaussians[LOGIT] = -10
    return gaussians
