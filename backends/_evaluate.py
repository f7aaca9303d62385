"""Scores a trained model: renders the test split with its backend and compares, the same way for every backend."""

import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from viewbench import __version__
from viewbench.backends import _registry
from viewbench.backends._metrics import lpips, lpips_weights, ssim
from viewbench.backends._psnr import psnr_db
from viewbench.common.errors import UserError
from viewbench.common.files import finite_or_none, read_json, write_json
from viewbench.common.settings import Settings
from viewbench.scenes.images import load_images
from viewbench.scenes.pictures import picture_name, save_png, to_uint8
from viewbench.scenes.types import Scene


def evaluate(
    model: Path,
    scene: Scene,
    out: Path,
    *,
    settings: Settings,
    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None,
) -> dict[str, Any]:
    """Renders every test view of `scene` at the model's training width, writes renders/NAME.png and `metrics.json`.

    Scores are of the 8-bit pictures that are written, so that anyone can repeat them from the files.
    Raises UserError when the model is missing, was trained on another scene, or the scene has no test split.
    """
    train = read_json(model / "train.json", "training record")
    if train.get("scene") != scene.name:
        raise UserError(f"'{model}' was trained on scene '{train.get('scene')}', not on '{scene.name}'")
    if not len(scene.test):
        raise UserError(f"scene '{scene.name}' has no test views; make a test split with --holdout")
    backend = _registry.load(train["backend"], settings)
    reason = backend.available()
    if reason:
        raise UserError(f"backend '{train['backend']}' is not available: {reason}")
    began = time.perf_counter()
    indices = np.arange(len(scene.test))
    truth, cameras = load_images(scene.test, indices, train["width"])
    weights = lpips_weights(settings.metrics.lpips_weights)
    renders = out / "renders"
    temporary = out / ".renders"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    views: list[dict[str, Any]] = []
    try:
        for number, (name, image) in enumerate(zip(scene.test.names, backend.render(model, cameras), strict=True)):
            pixels = to_uint8(image, truth[number].shape, name)
            file = picture_name(number, name)
            save_png(pixels, temporary / file)
            rendered = pixels.astype(np.float32) / 255
            views.append(
                {
                    "name": name,
                    "file": f"renders/{file}",
                    "psnr_db": finite_or_none(psnr_db(rendered, truth[number])),
                    "ssim": finite_or_none(ssim(rendered, truth[number])),
                    "lpips": None if weights is None else lpips(rendered, truth[number], weights),
                }
            )
            progress(number + 1, len(scene.test), "")
        shutil.rmtree(renders, ignore_errors=True)
        temporary.replace(renders)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    record = {
        "schema": 1,
        **{metric: _mean([view[metric] for view in views]) for metric in ("psnr_db", "ssim", "lpips")},
        "seconds": time.perf_counter() - began,
        "views": views,
        "viewbench": __version__,
    }
    write_json(out / "metrics.json", record)
    return record


def _mean(values: list[Any]) -> float | None:
    known = [value for value in values if value is not None and math.isfinite(value)]
    return float(np.mean(known)) if len(known) == len(values) and known else None
