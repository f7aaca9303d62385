"""Runs one selector on a scene and returns what `selection.json` says."""

import math
import time
from typing import Any

import numpy as np

from viewbench import __version__
from viewbench.common import plugins
from viewbench.common.errors import UserError, nearest
from viewbench.common.files import plain
from viewbench.common.seeding import generator
from viewbench.scenes.types import Scene
from viewbench.selectors._normalise import normalised
from viewbench.selectors._types import Views


def count_of(ratio: float, n: int) -> int:
    """K = max(1, round(ratio · N)), halves up. Raises UserError for a ratio outside (0, 1]."""
    if not 0 < ratio <= 1:
        raise UserError(f"ratio is {ratio}, expected a share of the training views in (0, 1]")
    return min(n, max(1, math.floor(ratio * n + 0.5)))


def run(
    scene: Scene,
    selector: str,
    count: int,
    seed: int,
    parameters: dict[str, Any] | None = None,
    features: np.ndarray | None = None,
    sharpness: np.ndarray | None = None,
) -> dict[str, Any]:
    """Chooses `count` training views and returns the record of DESIGN's `selection.json`.

    `features` is (N, D), one row per training view in capture order; rows are scaled to length 1. The generator is
    named by scene, selector and seed, not by the count: a greedy order serves every ratio.
    Raises UserError for a count outside [1, N], a parameter that the selector does not have, and unfit features.
    """
    module = plugins.load("selectors", selector)
    n = len(scene.train)
    if not 1 <= count <= n:
        raise UserError(f"count is {count}, expected 1 to {n}, the number of training views of '{scene.name}'")
    given = dict(parameters or {})
    for name in given:
        if name not in module.PARAMETERS:
            known = ", ".join(module.PARAMETERS) or "none"
            hint = nearest(name, module.PARAMETERS)
            raise UserError(f"selector '{selector}' has no parameter '{name}'{hint} (it has: {known})")
    merged = {**module.PARAMETERS, **given}
    began = time.perf_counter()
    cameras = scene.train.cameras
    intrinsics = [cameras.fx, cameras.fy, cameras.cx, cameras.cy, cameras.width, cameras.height]
    views = Views(
        positions=normalised(cameras.positions),
        rotations=cameras.rotations,
        features=None if features is None else unit_rows(features, n),
        intrinsics=np.stack(intrinsics, axis=1).astype(np.float64),
        times=scene.train.times,
        sharpness=sharpness,
    )
    prepared = time.perf_counter()
    rng = generator("select", scene.name, selector, seed)
    choice = module.select(views, count, rng, **merged)
    done = time.perf_counter()
    similarity_s = prepared - began + choice.seconds.get("similarity", 0.0)
    record = {
        "schema": 1,
        "scene": scene.name,
        "selector": selector,
        "parameters": merged,
        "seed": seed,
        "n_views": n,
        "count": count,
        "indices": choice.indices,
        "names": [scene.train.names[i] for i in choice.indices],
        "gains": choice.gains,
        "seconds": {"similarity": similarity_s, "select": done - prepared - choice.seconds.get("similarity", 0.0)},
        "viewbench": __version__,
    }
    if choice.notes:
        record["notes"] = dict(choice.notes)
    return plain(record)


def unit_rows(features: np.ndarray, n: int) -> np.ndarray:
    """(N, D) float32 rows of length 1. Raises UserError for another length, NaN, or a row of zeros."""
    if features.ndim != 2 or len(features) != n:
        raise UserError(f"features are {features.shape}, expected one row for each of the {n} training views")
    if not np.isfinite(features).all():
        row = int(np.flatnonzero(~np.isfinite(features).all(axis=1))[0])
        raise UserError(f"features have NaN or infinite entries, first in row {row}")
    length = np.linalg.norm(features, axis=1, keepdims=True)
    if (length == 0).any():
        raise UserError(f"features have a row of zeros, row {int(np.argmin(length))}; it has no direction")
    return (features / length).astype(np.float32)
