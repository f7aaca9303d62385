"""Trains one cell with any backend: reads the chosen views, keeps the budget honest and writes `train.json`."""

import dataclasses
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from viewbench import __version__
from viewbench.backends import _registry
from viewbench.backends._psnr import psnr_db
from viewbench.backends._types import Budget, Probe, Report, Trained, TrainingSet
from viewbench.common.errors import UserError, nearest
from viewbench.common.files import read_json, write_json
from viewbench.common.provenance import commit, machine
from viewbench.common.seeding import seed_of
from viewbench.common.settings import Settings
from viewbench.scenes.images import load_images
from viewbench.scenes.types import Cameras, Scene

WORK = ".training"  # a killed run's folder: the next run of the same cell takes it up or clears it
PROBE_VIEWS = 8  # test views behind the curve; enough for its shape, few enough to cost nothing


def train(
    scene: Scene,
    selection: dict[str, Any],
    backend_name: str,
    out: Path,
    *,
    settings: Settings,
    seed: int,
    budget: Budget,
    width: int | None = None,
    options: dict[str, Any] | None = None,
    curve: bool = True,
    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None,
) -> dict[str, Any]:
    """Trains one model on the chosen views and returns what `train.json` in `out` says.

    `width` resizes the images (pixels); None keeps them. The files of the model appear in `out` only when all of them
    are written, `train.json` last. Raises UserError for a backend that is unavailable or unknown, an option that it
    does not have, a selection that does not fit the scene, and whatever the backend refuses.
    """
    backend = _registry.load(backend_name, settings)
    reason = backend.available()
    if reason:
        raise UserError(f"backend '{backend_name}' is not available: {reason}")
    options = _options(backend_name, backend.CAPABILITIES.options, options or {})
    _obeyed(backend_name, backend.CAPABILITIES, budget)
    if not scene.posed:
        raise UserError(f"'{scene.name}' has no poses to train with; run structure-from-motion (COLMAP) first")
    indices = check_selection(selection, scene)
    views = scene.train.subset(indices)
    images, cameras = load_images(scene.train, indices, width)
    data = TrainingSet(
        scene=scene.name,
        names=views.names,
        cameras=cameras,
        images=images,
        points=scene.points,
        chosen=indices,
        paths=views.paths,
    )
    cell_seed = seed_of("train", backend_name, scene.name, selection["selector"], len(indices), seed) % 2**31
    asked = {
        "backend": backend_name,
        "scene": scene.name,
        "names": list(views.names),
        "seed": seed,
        "width": int(cameras.width[0]),
        "budget": dataclasses.asdict(budget),
        "options": options,
        "version": backend.version(),
    }
    work = _work_folder(out, asked, resumes=backend.CAPABILITIES.resumes)
    report = Report(progress=progress, probe=_probe(scene, width) if curve and len(scene.test) else None)
    try:
        trained = backend.train(data, work / "model", cell_seed, budget, options, report)
    except (UserError, MemoryError) as error:
        for log in (work / "model").glob("*.log"):
            log.replace(out / log.name)  # what an external program said outlives its failure
        shutil.rmtree(work, ignore_errors=True)
        if isinstance(error, MemoryError):
            raise UserError(f"backend '{backend_name}' ran out of memory with {len(indices)} views") from None
        raise
    record = _record(trained, asked, selection)
    for file in sorted((work / "model").iterdir()):
        target = out / file.name
        if target.is_dir():
            shutil.rmtree(target)
        file.replace(target)
    write_json(out / "train.json", record)
    shutil.rmtree(work, ignore_errors=True)
    return record


def check_selection(selection: dict[str, Any], scene: Scene) -> np.ndarray:
    """(K,) int64 indices of the selection into the scene's training split.

    Raises UserError when the selection was made on another scene: other length, indices out of range, other names.
    """
    try:
        indices = np.asarray(selection["indices"], dtype=np.int64)
        n_views, names = int(selection["n_views"]), list(selection["names"])
        selection["selector"], selection["seed"]
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"the selection lacks or garbles {error}; make it with `viewbench select`") from None
    if n_views != len(scene.train):
        raise UserError(
            f"the selection was made of {n_views} views, scene '{scene.name}' has {len(scene.train)}; select again"
        )
    if len(indices) == 0 or indices.min() < 0 or indices.max() >= n_views or len(set(indices.tolist())) != len(indices):
        raise UserError(f"the selection's indices must be distinct and in [0, {n_views - 1}]; select again")
    for index, name in zip(indices, names, strict=False):
        if scene.train.names[index] != name:
            raise UserError(
                f"the selection calls view {index} '{name}', the scene '{scene.train.names[index]}'; select again"
            )
    return indices


def _options(backend: str, known: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    for name, value in given.items():
        if name not in known:
            raise UserError(
                f"backend '{backend}' has no option '{name}'{nearest(name, known)} (it has: {', '.join(known)})"
            )
        kind = type(known[name])
        fits = isinstance(value, (int, float)) if kind is float else isinstance(value, kind)
        if known[name] is not None and (not fits or isinstance(value, bool) != (kind is bool)):
            raise UserError(
                f"backend '{backend}': option '{name}' is {value!r}, expected something like {known[name]!r}"
            )
    return {**known, **given}


def _obeyed(backend: str, capabilities: Any, budget: Budget) -> None:
    if budget.iterations is None and budget.seconds is None:
        raise UserError("a budget needs iterations or seconds")
    for limit in ("iterations", "seconds"):
        if getattr(budget, limit) is not None and not getattr(capabilities, limit):
            raise UserError(f"backend '{backend}' cannot limit its {limit}; leave that out of the budget")


def _work_folder(out: Path, asked: dict[str, Any], resumes: bool) -> Path:
    """The folder that a run fills. One left behind by a killed run is kept when the same is asked of it again."""
    work = out / WORK
    asked_file = work / "asked.json"
    text = json.dumps(asked, sort_keys=True)
    same = asked_file.is_file() and asked_file.read_text(encoding="utf-8") == text
    if work.exists() and not (resumes and same):
        shutil.rmtree(work)
    (work / "model").mkdir(parents=True, exist_ok=True)
    asked_file.write_text(text, encoding="utf-8")
    return work


def _probe(scene: Scene, width: int | None) -> Probe:
    """Mean test PSNR over a few evenly spaced test views; only the curve sees it."""
    count = min(PROBE_VIEWS, len(scene.test))
    chosen = np.unique(np.round(np.linspace(0, len(scene.test) - 1, count)).astype(np.int64))
    truth, cameras = load_images(scene.test, chosen, width)

    def probe(render: Callable[[Cameras], Any]) -> float:
        values = [psnr_db(np.clip(image, 0, 1), view) for image, view in zip(render(cameras), truth, strict=True)]
        return float(np.mean(values))

    return probe


def _record(trained: Trained, asked: dict[str, Any], selection: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": 1,
        "backend": asked["backend"],
        "version": asked["version"],
        "seed": asked["seed"],
        "budget": asked["budget"],
        "iterations": trained.iterations,
        "seconds": trained.seconds,
        "device": trained.device,
        "threads": trained.threads,
        "peak_rss_bytes": peak_rss_bytes(),
        "n_primitives": trained.n_primitives,
        "seeding": trained.seeding,
        "curve": trained.curve,
        "scene": asked["scene"],
        "selector": selection["selector"],
        "count": len(asked["names"]),
        "width": asked["width"],
        "options": asked["options"],
        "notes": trained.notes,
        "machine": machine(),
        "commit": commit(),
        "viewbench": __version__,
    }


def peak_rss_bytes() -> int:
    """Largest resident set of this process so far, in bytes."""
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)


def load_selection(path: Path) -> dict[str, Any]:
    """Reads `selection.json`; raises UserError when it is none."""
    selection = read_json(path, "selection")
    if not isinstance(selection, dict) or "indices" not in selection:
        raise UserError(f"'{path}' is no selection; make one with `viewbench select`")
    return selection
