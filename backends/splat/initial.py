"""The Gaussians at the start: as large as their neighbours are far, at the points that backends share, in a shell."""

import dataclasses

import numpy as np

from .._points import Wanted, starting_points
from .._points.start import FAINT, Start, joined
from .._surroundings import Surroundings
from .._types import Seeding, TrainingSet
from .layout import LOG_SCALE, LOGIT, MEAN, SH0, SH_C0, empty
from .options import Options
from .shell import RADIUS, shell

CELLS = 10  # bits of a cell's number along each axis

OPACITIES = {**FAINT, "random": 0.1, "shell": 0.5}  # elsewhere the option `opacity` says it


def initial(
    data: TrainingSet, o: Options, around: Surroundings, rng: np.random.Generator
) -> tuple[np.ndarray, Seeding]:
    """(rows, N) parameters of the Gaussians, N at most `o.gaussians`, and the record of where they come from.

    Raises UserError when a source of points that was asked for has none.
    """
    shell_count = min(o.shell, o.gaussians // 2)
    wanted = Wanted(o.points, o.gaussians - shell_count, fills=True, sweep=o.sweep)
    starts, seeding = starting_points(data, wanted, around, rng)
    scales = o.scale * np.maximum(spacing(joined(starts)[0]), 1e-6 * around.extent)
    if shell_count:
        positions, colours, size = shell(data, shell_count, around)
        starts.append(Start(positions, colours, "shell"))
        scales = np.append(scales, np.full(shell_count, size))
    seeding = dataclasses.replace(seeding, count=len(scales), shell_points=shell_count)
    made = _gaussians(starts, scales, o)
    order = along_curve((made[MEAN : MEAN + 3].T - around.centre) / (RADIUS * around.extent))
    return np.ascontiguousarray(made[:, order]), seeding


def _gaussians(starts: list[Start], scales: np.ndarray, o: Options) -> np.ndarray:
    gaussians = empty(len(scales), o.sh_degree)
    points, colours = joined(starts)
    gaussians[MEAN : MEAN + 3] = points.T
    gaussians[LOG_SCALE : LOG_SCALE + 3] = np.log(scales)
    opacity = np.concatenate([np.full(len(start), OPACITIES.get(start.kind, o.opacity)) for start in starts])
    gaussians[LOGIT] = np.log(opacity / (1 - opacity))
    gaussians[SH0 : SH0 + 3] = (colours.T - 0.5) / SH_C0
    return gaussians


def spacing(points: np.ndarray) -> np.ndarray:
    """(N,) root mean square distance to the three nearest neighbours, as 3DGS sets its first scales."""
    from scipy.spatial import KDTree

    if len(points) < 4:
        return np.linalg.norm(points - points.mean(axis=0), axis=1)
    distance, _ = KDTree(points, leafsize=16).query(points, k=4)
    return np.sqrt((distance[:, 1:] ** 2).mean(axis=1))


def along_curve(points: np.ndarray) -> np.ndarray:
    """(N,) order of points (N, 3) in [-1, 1] along Morton's curve (1966), which keeps neighbours together.

    A view sees Gaussians sixteen at a time, so that those which it does not see should lie together.
    """
    cells = np.clip((points + 1) * 2.0 ** (CELLS - 1), 0, 2**CELLS - 1).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(CELLS):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
