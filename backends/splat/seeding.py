"""Where the Gaussians start: points of the scene file, plane sweep of the chosen views, rays, and a shell around all.

A start that needs neighbouring views to overlap would make diverse subsets look bad and redundant ones good. So the
sweep believes little and falls back by the pixel: to the depth of the nearest pixel that is sure, in views without
any to depths found elsewhere, and without any at all to depths at random. What is not sure starts almost transparent,
so that it fades where it is wrong. Everything is counted in the record that `train.json` keeps.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...common.errors import UserError, nearest
from ...scenes.types import Points
from .._seeding import seen
from .._surroundings import Surroundings
from .._types import TrainingSet
from .layout import LOG_SCALE, LOGIT, MEAN, SH0, SH_C0, empty
from .options import Options
from .shell import shell

SOURCES = ("auto", "scene", "selected", "sweep", "rays")
FEWEST = 500  # scene points, or sure depths, that are worth starting from
GUESSED = 0.25  # share of the sweep's points whose depth is guessed
GUESSED_OPACITY, RAY_OPACITY, SHELL_OPACITY = 0.1, 0.03, 0.5
NEAR, FAR = 0.1, 1.2  # depths along rays where nothing is known, as shares of the cameras' extent


def known_points(data: TrainingSet, source: str) -> Points | None:
    """The scene's points where a start from `source` may know them: a sweep and rays are for scenes without any."""
    return None if source in ("sweep", "rays") else data.points


def seed(
    data: TrainingSet, o: Options, around: Surroundings, rng: np.random.Generator
) -> tuple[np.ndarray, dict[str, Any]]:
    """(rows, N) parameters of the Gaussians at the start, and the record of where they come from.

    `o.points` is "auto" (scene points, where there are at least 500, and plane sweep), "scene", "selected" (scene
    points whose track has at least two chosen views), "sweep" or "rays". Raises UserError when a source that was
    asked for has no points at all.
    """
    if o.points not in SOURCES:
        raise UserError(
            f"unknown source of points '{o.points}'{nearest(o.points, SOURCES)} (known: {', '.join(SOURCES)})"
        )
    extent = around.extent
    shell_count = min(o.shell, o.gaussians // 2)
    count = o.gaussians - shell_count
    record: dict[str, Any] = {"asked": o.points, "source": "", "scene_points": 0, "sweep_points": 0}
    record |= {"guessed_points": 0, "ray_points": 0, "shell_points": shell_count}
    starts = _scene_points(data, o, count, rng, record)
    if o.points in ("auto", "sweep"):
        starts += _swept(data, count - sum(len(start.points) for start in starts), o, around, rng, record)
    known = sum(len(start.points) for start in starts)
    if o.points in ("auto", "sweep", "rays") and known < min(FEWEST, count):
        starts.append(Start(*along_rays(data, count - known, extent, rng), RAY_OPACITY))
        record["ray_points"] = count - known
    names = {"scene": "selected" if o.points == "selected" else "scene", "sweep": "sweep", "ray": "rays"}
    record["source"] = " and ".join(name for kind, name in names.items() if record[f"{kind}_points"])
    points = np.concatenate([start.points for start in starts])
    scales = o.scale * np.maximum(spacing(points), 1e-6 * extent)
    if shell_count:
        positions, colours, size = shell(data, shell_count, around)
        starts.append(Start(positions, colours, SHELL_OPACITY))
        scales = np.append(scales, np.full(shell_count, size))
    record["count"] = len(scales)
    return _gaussians(starts, scales, o.degree), record


@dataclass(frozen=True)
class Start:
    """Points with one opacity."""

    points: np.ndarray  # (P, 3)
    colours: np.ndarray  # (P, 3) in [0, 1]
    opacity: float


def _gaussians(starts: list[Start], scales: np.ndarray, degree: int) -> np.ndarray:
    gaussians = empty(len(scales), degree)
    gaussians[MEAN : MEAN + 3] = np.concatenate([start.points for start in starts]).T
    gaussians[LOG_SCALE : LOG_SCALE + 3] = np.log(scales)
    opacity = np.concatenate([np.full(len(start.points), start.opacity) for start in starts])
    gaussians[LOGIT] = np.log(opacity / (1 - opacity))
    gaussians[SH0 : SH0 + 3] = (np.concatenate([start.colours for start in starts]).T - 0.5) / SH_C0
    return gaussians


def _scene_points(
    data: TrainingSet, o: Options, count: int, rng: np.random.Generator, record: dict[str, Any]
) -> list[Start]:
    """Points of the scene file; in "auto" they leave room for those of the sweep."""
    if o.points not in ("auto", "scene", "selected"):
        return []
    points = data.points
    if points is None:
        use = np.zeros(0, np.int64)
    else:
        use = np.flatnonzero(np.isfinite(points.xyz).all(axis=1))
        if o.points == "selected":
            use = use[seen(data)[use]]
    if points is None or not len(use):
        if o.points == "auto":
            return []
        raise UserError(f"the scene has no points for '{o.points}'; use points 'sweep'")
    most = count - round(o.sweep * count) if o.points == "auto" else count
    if len(use) > most:
        use = np.sort(rng.choice(use, most, replace=False))
    record["scene_points"] = len(use)
    return [Start(points.xyz[use], points.rgb[use] / 255, o.opacity)]


def _swept(
    data: TrainingSet, count: int, o: Options, around: Surroundings, rng: np.random.Generator, record: dict[str, Any]
) -> list[Start]:
    """Points of the plane sweep, none where it found too little to go by."""
    from .depth_maps import depth_maps

    maps = depth_maps(data, around.depths, rng)
    sure, guessed = np.flatnonzero(maps.sure), np.flatnonzero(maps.guessed)
    record |= {"sweep_views": int(maps.sure.any(axis=(1, 2)).sum()), "sweep_depths": len(sure)}
    if len(sure) < FEWEST:
        record["fallback"] = f"the plane sweep was left out: {len(sure)} depths to believe are fewer than {FEWEST}"
        return []
    if count < 4:
        return []
    # Views without a sure depth are guessed at by depths of the others.
    alone = np.flatnonzero(
        np.broadcast_to(~(maps.sure | maps.guessed).any(axis=(1, 2), keepdims=True), maps.sure.shape)
    )
    fewer = min(len(sure), round((1 - GUESSED) * count))
    rest = min(count - fewer, len(guessed) + len(alone))
    by_ray = rng.binomial(rest, len(alone) / (len(guessed) + len(alone))) if rest else 0
    by_ray, by_guess = min(by_ray, len(alone)), min(rest - by_ray, len(guessed))
    record |= {"sweep_points": fewer, "guessed_points": by_guess, "ray_points": by_ray}
    starts = [Start(*maps.points(rng.choice(sure, fewer, replace=False)), o.opacity)]
    if by_guess:
        starts.append(Start(*maps.points(rng.choice(guessed, by_guess, replace=False)), GUESSED_OPACITY))
    if by_ray:
        depths = maps.depth.ravel()[rng.choice(sure, by_ray)]
        starts.append(Start(*maps.points(rng.choice(alone, by_ray, replace=False), depths), RAY_OPACITY))
    return starts


def along_rays(data: TrainingSet, count: int, extent: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points at log-uniform depths on rays through random pixels of random views, and their colours."""
    k, height, width, _ = data.images.shape
    view = rng.integers(k, size=count)
    column, row = rng.integers(width, size=count), rng.integers(height, size=count)
    depth = extent * np.exp(rng.uniform(np.log(NEAR), np.log(FAR), size=count))
    cameras = data.cameras
    x = (column + 0.5 - cameras.cx[view]) / cameras.fx[view] * depth
    y = (row + 0.5 - cameras.cy[view]) / cameras.fy[view] * depth
    inside = np.stack([x, -y, -depth], axis=1)
    points = np.einsum("nij,nj->ni", cameras.rotations[view], inside) + cameras.positions[view]
    return points, data.images[view, row, column].astype(np.float64)


def spacing(points: np.ndarray) -> np.ndarray:
    """(N,) root mean square distance to the three nearest neighbours, as 3DGS sets its first scales."""
    from scipy.spatial import cKDTree

    if len(points) < 4:
        return np.linalg.norm(points - points.mean(axis=0), axis=1)
    distance, _ = cKDTree(points).query(points, k=4)
    return np.sqrt((distance[:, 1:] ** 2).mean(axis=1))
