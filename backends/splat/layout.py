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
SH1 = 14  # the other degrees', coefficient by coefficient, each red, green, blue
HIGHEST = 3  # degree of spherical harmonics

SH_C0 = 0.28209479177387814  # Y₀₀


def rows(degree: int) -> int:
    """How many parameters a Gaussian has: 14, 23, 38 or 59."""
    return SH0 + 3 * (degree + 1) ** 2


def degree_of(gaussians: np.ndarray) -> int:
    """Of the spherical harmonics in (rows, N) parameters."""
    return round(((len(gaussians) - SH0) / 3) ** 0.5) - 1


def empty(count: int, degree: int) -> np.ndarray:
    """(rows(degree), count) float32 of invisible unit-quaternion Gaussians."""
    gaussians = np.zeros((rows(degree), count), dtype=np.float32)
    gaussians[QUATERNION] = 1
    gaussians[LOGIT] = -10
    return gaussians
