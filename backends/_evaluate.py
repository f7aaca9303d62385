"""Scores a trained model: renders the test split with its backend and compares, the same way for every backend."""

import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..common import gpu, plugins, threads
from ..common.errors import UserError
from ..common.files import finite_or_none, read_json, sealed, sha256_file, unsealed, write_json
from ..common.holding import alone
from ..common.provenance import now
from ..common.settings import Settings
from ..common.sources import code_sha256
from ..scenes.digest import scene_sha256
from ..scenes.image_files import is_file, leaves
from ..scenes.images import Picture, read_images
from ..scenes.pictures import picture_name, save_png, to_uint8
from ..scenes.types import Scene
from . import _passing, _registry
from ._metrics import lpips, lpips_sha256, lpips_weights, ssim
from ._psnr import psnr_db


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
    Raises UserError when the model is missing or was altered, was trained on another scene or on this one when it was
    different (another hold-out may have trained on what is scored now), or the scene has no test split.
    """
    train = read_json(model / "train.json", "training record")
    kinds = {"files": dict, "backend": str, "width": int}
    if not isinstance(train, dict) or not all(isinstance(train.get(key), kind) for key, kind in kinds.items()):
        raise UserError(f"'{model / 'train.json'}' is not what training writes; train again")
    train = unsealed(train, f"'{model / 'train.json'}'")
    if not len(scene.test):
        raise UserError(f"scene '{scene.name}' has no test views; select, train and evaluate with --holdout every:8")
    scene_hash = scene_sha256(scene)
    check_model(model, train, scene, scene_hash)
    backend = _registry.load(train["backend"], settings)
    _registry.hold_gpu(backend, settings)
    if "backends.gsplat" in getattr(backend, "RENDERERS", ()):
        gpu.hold(settings.compute.device)  # whose rasteriser draws where there is a GPU
    reason = backend.available()
    if reason:
        raise UserError(f"backend '{train['backend']}' is not available: {reason}")
    code = code_of(train["backend"], backend, scene.format)  # as it is when it is loaded
    threads.allow(settings.compute.threads)
    began = time.perf_counter()
    indices = np.arange(len(scene.test))
    truths, cameras = read_images(scene.test, indices, train["width"])
    weights = lpips_weights(settings.metrics.lpips_weights)
    with alone(out):
        renders = out / "renders"
        temporary = out / ".renders"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)

        def scored(drawn: tuple[int, tuple[str, Picture, np.ndarray]]) -> dict[str, Any]:
            number, (name, picture, image) = drawn
            truth = picture.pixels()
            pixels = to_uint8(image, truth.shape, name)
            file = picture_name(number, name)
            save_png(pixels, temporary / file)
            rendered = pixels.astype(np.float32) / 255
            return {
                "name": name,
                "file": f"renders/{file}",
                "bytes": (temporary / file).stat().st_size,
                "sha256": sha256_file(temporary / file),
                "psnr_db": finite_or_none(psnr_db(rendered, truth)),
                "ssim": finite_or_none(ssim(rendered, truth)),
                "lpips": None if weights is None else lpips(rendered, truth, weights),
            }

        views: list[dict[str, Any]] = []
        try:
            drawn = zip(scene.test.names, truths, backend.render(model, cameras), strict=True)
            with _passing.named(f"backend '{train['backend']}'", f"{len(indices)} views to render"):
                for view in threads.over(scored, enumerate(drawn)):
                    views.append(view)
                    progress(len(views), len(scene.test), "")
            shutil.rmtree(renders, ignore_errors=True)
            temporary.replace(renders)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        record = {
            "schema": 1,
            **{metric: _mean([view[metric] for view in views]) for metric in ("psnr_db", "ssim", "lpips")},
            "seconds": time.perf_counter() - began,
            "views": views,
            "scene_sha256": scene_hash,
            "holdout": scene.holdout,
            "train_sha256": sha256_file(model / "train.json"),
            "lpips_sha256": lpips_sha256(settings.metrics.lpips_weights),
            "code_sha256": code,
            "configuration": _registry.configuration_of(backend)["render"],
            "drawn_by": _registry.drawn_by(train["backend"], backend),
            "viewbench": __version__,
            "ended": now(),
        }
        record = sealed(record)
        write_json(out / "metrics.json", record)
        return record


def check_model(model: Path, train: dict[str, Any], scene: Scene, scene_hash: str) -> None:
    """Raises UserError when the model was not trained on this scene as it is now, or its files are not as trained."""
    if train.get("scene") != scene.name:
        raise UserError(f"'{model}' was trained on scene '{train.get('scene')}', not on '{scene.name}'")
    if train.get("scene_sha256") != scene_hash:
        raise UserError(
            f"'{model}' was trained on scene '{scene.name}' with holdout '{train.get('holdout')}' and hash "
            f"{str(train.get('scene_sha256'))[:12]}, but now it has holdout '{scene.holdout}' and hash "
            f"{scene_hash[:12]}; train again"
        )
    altered = altered_file(model, train)
    if altered is not None:
        raise UserError(f"'{model / altered}' is missing or not as training left it; train again")


def altered_file(model: Path, train: dict[str, Any]) -> str | None:
    """Name of the first file of the model that is missing or not as `train` says; None where all are well.

    One that lies outside the folder, by its name or through a link, is none of the model's.
    """
    for name, sha256 in train["files"].items():
        file = model / name
        if leaves(name) or not is_file(file) or file.is_symlink() or sha256_file(file) != sha256:
            return name
    return None


def code_of(backend_name: str, backend: Any, format_name: str) -> str:
    """Hash of the source code that a score of this backend's models depends on."""
    return code_sha256(*modules_of(backend_name, backend), plugins.source_name("scenes.formats", format_name))


def modules_of(backend_name: str, backend: Any) -> tuple[str, ...]:
    """Modules, without what they import, that a score depends on: `RENDERERS` of a backend are others that draw."""
    family = plugins.source_name("backends", backend_name.split(":")[0])
    return ("backends._evaluate", family, *getattr(backend, "RENDERERS", ()))


def _mean(values: list[Any]) -> float | None:
    known = [value for value in values if value is not None and math.isfinite(value)]
    return float(np.mean(known)) if len(known) == len(values) and known else None
