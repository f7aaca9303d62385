"""Models in memory (rows of parameters) as PLY files in the layout of the 3DGS authors, and back."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from .. import _gaussian_ply
from .layout import HIGHEST, LOG_SCALE, LOGIT, MEAN, QUATERNION, SH0, SH1, empty


def write(path: Path, gaussians: np.ndarray) -> None:
    """Writes (rows, N) parameters, whole or not at all."""
    stored = _gaussian_ply.Gaussians(
        means=gaussians[MEAN : MEAN + 3].T,
        scales=gaussians[LOG_SCALE : LOG_SCALE + 3].T,
        quats=gaussians[QUATERNION : QUATERNION + 4].T,
        opacities=gaussians[LOGIT],
        sh0=gaussians[SH0 : SH0 + 3].T,
        shn=gaussians[SH1:].T.reshape(gaussians.shape[1], -1, 3),
    )
    _gaussian_ply.save(path, stored)


def read(path: Path) -> np.ndarray:
    """(rows, N) float32 parameters, as many rows as the file's degree has.

    Raises UserError for a missing file and one that is no splat model.
    """
    stored = _gaussian_ply.load(path)
    if stored.degree > HIGHEST or stored.shn.shape[1] != (stored.degree + 1) ** 2 - 1:
        raise UserError(
            f"model '{path}' has {1 + stored.shn.shape[1]} coefficients of spherical harmonics; expected 1, 4, 9 or 16"
        )
    gaussians = empty(len(stored), stored.degree)
    gaussians[MEAN : MEAN + 3] = stored.means.T
    gaussians[LOG_SCALE : LOG_SCALE + 3] = stored.scales.T
    gaussians[QUATERNION : QUATERNION + 4] = stored.quats.T
    gaussians[LOGIT] = stored.opacities
    gaussians[SH0 : SH0 + 3] = stored.sh0.T
    gaussians[SH1:] = stored.shn.reshape(len(stored), -1).T
    return gaussians
