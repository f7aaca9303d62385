"""Models in memory (rows of parameters) as PLY files in the layout of the 3DGS authors, and back."""

from pathlib import Path

import numpy as np

from viewbench.backends import _gaussian_ply
from viewbench.backends.splat.layout import LOG_SCALE, LOGIT, MEAN, QUATERNION, SH0, SH1, empty

REST = 3  # coefficients of degree 1


def write(path: Path, gaussians: np.ndarray) -> None:
    """Writes (ROWS, N) parameters, whole or not at all."""
    stored = _gaussian_ply.Gaussians(
        means=gaussians[MEAN : MEAN + 3].T,
        scales=gaussians[LOG_SCALE : LOG_SCALE + 3].T,
        quats=gaussians[QUATERNION : QUATERNION + 4].T,
        opacities=gaussians[LOGIT],
        sh0=gaussians[SH0 : SH0 + 3].T,
        shn=gaussians[SH1:].T.reshape(-1, REST, 3),
    )
    _gaussian_ply.save(path, stored)


def read(path: Path) -> np.ndarray:
    """(ROWS, N) float32 parameters; coefficients beyond degree 1 are left out.

    Raises UserError for a missing file and one that is no splat model.
    """
    stored = _gaussian_ply.load(path)
    gaussians = empty(len(stored))
    gaussians[MEAN : MEAN + 3] = stored.means.T
    gaussians[LOG_SCALE : LOG_SCALE + 3] = stored.scales.T
    gaussians[QUATERNION : QUATERNION + 4] = stored.quats.T
    gaussians[LOGIT] = stored.opacities
    gaussians[SH0 : SH0 + 3] = stored.sh0.T
    if stored.degree >= 1:
        gaussians[SH1:] = stored.shn[:, :REST].reshape(len(stored), -1).T
    return gaussians
