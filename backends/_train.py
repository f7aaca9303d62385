"""Trains one cell with any backend: reads the chosen views, keeps the budget honest and writes `train.json`.

`train.json` says what the model was made from: the hashes of the scene, of the choice and of the code, and those of
the model's own files. `selection.json` is put beside it.
"""

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..common import plugins, threads
from ..common.errors import PassingError, UserError, nearest
from ..common.files import read_json, sealed, sha256_folder, write_json
from ..common.holding import alone
from ..common.provenance import commit, machine, now
from ..common.rng import seed_of
from ..common.settings import Settings
from ..common.sources import code_sha256
from ..scenes.digest import scene_sha256
from ..scenes.images import read_images
from ..scenes.lenses import pinholes
from ..scenes.types import Cameras, Scene
from ..selectors._selection import check_selection, selection_sha256
from . import _passing, _registry
from ._memory import peak_rss_bytes
from ._pictures import KEPT_BYTES, Pictures
from ._psnr import psnr_db
from ._types import SOURCES, WITHOUT, Budget, Job, Probe, Report, Trained, TrainingSet

OURS = ("selection.json", "train.json", "metrics.json", "renders")  # beside a model: no file of it may be called so
LEFT = ".files.json"  # names of the model's files, for the training that replaces it
WORK = ".training"  # a killed run's folder: the next run of the same cell takes it up or clears it
PROBE_VIEWS = 8  # test views behind the curve; enough for its shape, few enough to cost nothing


def train(
    scene: Scene,
    selection: dict[str, Any],
    job: Job,
    out: Path,
    *,
    settings: Settings,
    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None,
) -> dict[str, Any]:
    """Trains one model on the chosen views and returns what `train.json` in `out` says.

    The files of the model appear in `out` only when all of them are written, `train.json` last. Raises UserError for
    a backend that is unavailable or unknown, an option that it does not have, a selection that does not fit the
    scene, a folder that another process is writing, and whatever the backend refuses; PassingError
    where memory was short.
    """
    threads.allow(settings.compute.threads)
    backend = _registry.load(job.backend, settings)
    lease = _registry.hold_gpu(backend, settings)
    began = now()  # when it need not wait for a GPU any more
    reason = backend.available()
    if reason:
        raise UserError(f"backend '{job.backend}' is not available: {reason}")
    options = all_options(job.backend, backend.CAPABILITIES.options, job.options)
    _obeyed(job.backend, backend.CAPABILITIES, job.budget)
    if not scene.posed:
        raise UserError(f"'{scene.name}' has no poses to train with; run structure-from-motion (COLMAP) first")
    scene_hash = scene_sha256(scene)
    indices = check_selection(selection, scene, scene_hash)
    views = scene.train.subset(indices)
    read, cameras = read_images(scene.train, indices, job.width)
    # Neither selector nor count is in it: what is drawn beside the views (which of the scene's points, say) is then
    # the same for every choice.
    cell_seed = seed_of("train", job.backend, scene.name, job.seed) % 2**31
    asked = {
        "backend": job.backend,
        "scene": scene.name,
        "scene_sha256": scene_hash,
        "holdout": scene.holdout,
        "selection_sha256": selection_sha256(selection),
        "code_sha256": code_of(job.backend, scene.format),
        "seed": job.seed,
        "width": int(cameras.width[0]),
        "budget": dataclasses.asdict(job.budget),
        "options": options,
        "version": backend.version(),
        "configuration": _registry.configuration_of(backend)["train"],
    }
    with alone(out):
        work = _work_folder(out, asked, resumes=backend.CAPABILITIES.resumes)
        try:
            report = Report(
                progress=progress, probe=_probe(scene, job.width) if job.curve and len(scene.test) else None
            )
            with Pictures(read, (int(cameras.height[0]), int(cameras.width[0]), 3), work, KEPT_BYTES) as images:
                data = TrainingSet(
                    scene=scene.name,
                    names=views.names,
                    cameras=cameras,
                    images=images,
                    points=scene.points,
                    chosen=indices,
                    training=pinholes(
                        scene.train.cameras if job.width is None else scene.train.cameras.scaled(job.width)
                    ),
                )
                with _passing.named(f"backend '{job.backend}'", f"{len(indices)} views"):
                    trained = backend.train(data, work / "model", cell_seed, job.budget, options, report)
        except UserError as error:
            for log in (work / "model").glob("*.log"):
                log.replace(out / log.name)  # what an external program said outlives its failure
            if not (backend.CAPABILITIES.resumes and isinstance(error, PassingError)):  # else the next attempt goes on
                shutil.rmtree(work, ignore_errors=True)
            raise
        taken = next((file.name for file in (work / "model").iterdir() if file.name in OURS), None)
        if taken is not None:
            shutil.rmtree(work, ignore_errors=True)
            raise UserError(f"backend '{job.backend}' left a file '{taken}', a name of viewbench's own; rename it")
        record = _record(trained, asked, selection, sha256_folder(work / "model"))
        record["bytes"] = {name: (work / "model" / name).stat().st_size for name in record["files"]}
        record["gpu"] = None if lease is None else lease.record()
        record["began"] = began
        _replace_model(work / "model", out)
        write_json(out / "selection.json", sealed(selection))
        record = sealed(record)
        write_json(out / "train.json", record)
        shutil.rmtree(work, ignore_errors=True)
        return record


def all_options(backend: str, known: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
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
    points = given.get("points")
    sources = (*SOURCES, WITHOUT) if backend.startswith("command:") else SOURCES
    if points is not None and points not in sources:
        raise UserError(
            f"backend '{backend}' cannot start from points '{points}'{nearest(str(points), sources)} "
            f"(known: {', '.join(sources)})"
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
    if work.is_symlink() or (work / "model").is_symlink():  # none of ours: it would lead what is written elsewhere
        raise UserError(f"'{work}' leads through a link; remove it, or name another folder")
    asked_file = work / "asked.json"
    text = json.dumps(asked, sort_keys=True)
    same = asked_file.is_file() and asked_file.read_text(encoding="utf-8") == text
    if work.exists() and not (resumes and same):
        shutil.rmtree(work)
    (work / "model").mkdir(parents=True, exist_ok=True)
    for half_written in (work / "model").glob(".part-*"):
        half_written.unlink()
    asked_file.write_text(text, encoding="utf-8")
    return work


def _probe(scene: Scene, width: int | None) -> Probe:
    """Mean test PSNR over a few evenly spaced test views; only the curve sees it."""
    count = min(PROBE_VIEWS, len(scene.test))
    chosen = np.unique(np.round(np.linspace(0, len(scene.test) - 1, count)).astype(np.int64))
    read, cameras = read_images(scene.test, chosen, width)
    truth = list(read)

    def probe(render: Callable[[Cameras], Any]) -> float:
        drawn = zip(render(cameras), truth, strict=True)
        return float(np.mean([psnr_db(np.clip(image, 0, 1), picture.pixels()) for image, picture in drawn]))

    return probe


def _replace_model(model: Path, out: Path) -> None:
    """Moves the files of a model to `out`, in place of all those of the one that was there, and of its scores."""
    for name in ("train.json", "metrics.json"):  # their model is about to go
        (out / name).unlink(missing_ok=True)
    shutil.rmtree(out / "renders", ignore_errors=True)
    names = sorted(file.name for file in model.iterdir())
    before = read_json(out / LEFT, "list of files") if (out / LEFT).is_file() else []
    mine = (name for name in before if isinstance(name, str) and name not in ("", "..") and Path(name).name == name)
    for name in {*names, *mine}:
        target = out / name
        if target.is_dir() and not target.is_symlink():
            shutil.rmtree(target)
        else:
            target.unlink(missing_ok=True)
    write_json(out / LEFT, names)
    for name in names:
        (model / name).replace(out / name)


def code_of(backend_name: str, format_name: str) -> str:
    """Hash of the source code that a training by this backend, on a scene read from this format, depends on."""
    return code_sha256(*modules_of(backend_name), plugins.source_name("scenes.formats", format_name))


def modules_of(backend_name: str) -> tuple[str, str]:
    """Modules, without what they import, that a training depends on."""
    return "backends._train", plugins.source_name("backends", backend_name.split(":")[0])


def _record(
    trained: Trained, asked: dict[str, Any], selection: dict[str, Any], files: dict[str, str]
) -> dict[str, Any]:
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
        "peak_rss_bytes": max(peak_rss_bytes(), trained.peak_rss_bytes or 0),
        "peak_gpu_bytes": trained.peak_gpu_bytes,
        "n_primitives": trained.n_primitives,
        "seeding": dataclasses.asdict(trained.seeding),
        "curve": trained.curve,
        "scene": asked["scene"],
        **{key: asked[key] for key in ("scene_sha256", "holdout", "selection_sha256", "code_sha256", "configuration")},
        "files": files,
        "selector": selection["selector"],
        "count": len(selection["indices"]),
        "width": asked["width"],
        "options": asked["options"],
        "notes": trained.notes,
        "machine": machine(),
        "commit": commit(),
        "viewbench": __version__,
    }
