"""Copies a study's cells into MLflow: one experiment a study, one finished run a cell, however often it is repeated.

The JSON files are the truth and MLflow the window on them. Each run carries a fingerprint of its cell's files: a run
with the same fingerprint is left alone, any other run of the cell (changed files, a crash half-way) is replaced.
"""

import contextlib
import hashlib
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..common.cells import AXES, cell_folder, cell_name
from ..common.errors import UserError
from ..common.files import read_json
from ..common.settings import Tracking

CELL, FINGERPRINT = "viewbench.cell", "viewbench.fingerprint"
KEY = AXES
NO_TRACKING = "tracking.uri is empty"  # why nothing is logged where nobody wants it
FILES = ("selection.json", "train.json", "metrics.json")


def is_remote(uri: str) -> bool:
    """Whether runs are logged to a server, cell by cell, rather than into a file beside the results."""
    return uri.startswith(("http://", "https://"))


def track(
    study: str,
    cells: list[dict[str, str]],
    results: Path,
    tracking: Tracking,
    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None,
) -> dict[str, int]:
    """Logs the cells of one study; returns how many runs were "logged" and how many were "kept".

    `cells` are rows of the grid (KEY as texts), `results` is results/STUDY. Cells without all their files are left
    out. Raises UserError when the store cannot be reached: repeat the call once it can.
    """
    # A study logs hundreds of small runs: no telemetry, no long retries against a server that is down.
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("DO_NOT_TRACK", "true")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "20")
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")
    os.environ.setdefault("MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT", "true")
    import logging

    logging.getLogger("alembic").setLevel(logging.WARNING)
    from mlflow import MlflowClient
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    uri = local_uri(tracking.uri)
    try:
        client = MlflowClient(tracking_uri=uri)
        experiment = _experiment(client, study, tracking, is_remote(uri))
        known = _known_runs(client, experiment)
        done = {"logged": 0, "kept": 0}
        ready = [cell for cell in cells if all((cell_folder(results, cell) / name).is_file() for name in FILES)]
        for number, cell in enumerate(ready):
            folder = cell_folder(results, cell)
            fingerprint = _fingerprint(folder)
            name = cell_name(cell)
            runs = known.get(name, [])
            current = [run for run in runs if run[1] == fingerprint]
            for run_id, _ in [run for run in runs if run not in current[:1]]:
                client.delete_run(run_id)
            if current:
                done["kept"] += 1
            else:
                _log(client, experiment, cell, name, fingerprint, folder, tracking.renders)
                done["logged"] += 1
            progress(number + 1, len(ready), name)
    except (MlflowException, SQLAlchemyError, OSError) as error:
        text = str(error).strip().splitlines() or [type(error).__name__]
        raise UserError(f"MLflow at '{tracking.uri}' did not take the runs: {text[0][:300]}") from None
    return done


def local_uri(uri: str) -> str:
    """The URI with a relative sqlite path made absolute and its folder made; others as they are."""
    prefix = "sqlite:///"
    if not uri.startswith(prefix):
        return uri
    path = Path(uri.removeprefix(prefix)).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    return f"{prefix}{path}"


def _fingerprint(folder: Path) -> str:
    digest = hashlib.sha256()
    for name in FILES:
        digest.update((folder / name).read_bytes() + b"\0")
    return digest.hexdigest()


def _experiment(client: Any, study: str, tracking: Tracking, remote: bool) -> str:
    found = client.get_experiment_by_name(study)
    if found is not None:
        if found.lifecycle_stage == "deleted":
            client.restore_experiment(found.experiment_id)
        return found.experiment_id
    location = None if remote else (Path(tracking.artifacts).resolve() / study).as_uri()
    return client.create_experiment(study, artifact_location=location)


def _known_runs(client: Any, experiment: str) -> dict[str, list[tuple[str, str | None]]]:
    """Runs of the experiment by cell, as (run id, fingerprint); an unfinished run has no fingerprint that counts."""
    known: dict[str, list[tuple[str, str | None]]] = {}
    token = None
    while True:
        page = client.search_runs([experiment], max_results=1000, page_token=token)
        for run in page:
            fingerprint = run.data.tags.get(FINGERPRINT) if run.info.status == "FINISHED" else None
            known.setdefault(run.data.tags.get(CELL, ""), []).append((run.info.run_id, fingerprint))
        token = page.token
        if not token:
            return known


def _log(client: Any, experiment: str, cell: dict, name: str, fingerprint: str, folder: Path, renders: int) -> None:
    from mlflow.entities import Metric, Param

    selection = read_json(folder / "selection.json", "selection")
    train = read_json(folder / "train.json", "training record")
    metrics = read_json(folder / "metrics.json", "metrics")
    tags = {
        CELL: name,
        FINGERPRINT: fingerprint,
        "commit": train["commit"],
        "backend": cell["backend"],
        "backend_version": train["version"],
        "device": train["device"],
        "viewbench": train.get("viewbench", ""),
    }
    run_name = "/".join(cell[key] for key in KEY[1:])
    run_id = client.create_run(experiment, tags=tags, run_name=run_name).info.run_id
    values = {**cell, "count": selection["count"], "n_views": selection["n_views"], "width": train.get("width")}
    values |= {f"budget.{key}": value for key, value in train["budget"].items() if value is not None}
    values |= {f"option.{key}": value for key, value in train.get("options", {}).items()}
    values |= {f"selector.{key}": value for key, value in selection["parameters"].items()}
    final = {
        "psnr_db": metrics["psnr_db"],
        "ssim": metrics["ssim"],
        "lpips": metrics["lpips"],
        "select_s": sum(selection["seconds"].values()),
        "train_s": train["seconds"],
        "evaluate_s": metrics["seconds"],
        "iterations": train["iterations"],
        "peak_rss_bytes": train["peak_rss_bytes"],
        "n_primitives": train["n_primitives"],
    }
    logged = [Metric(key, value, 0, 0) for key, value in final.items() if _is_number(value)]
    for point in train["curve"]:  # by step, and with the elapsed time as the time stamp and as a step of its own
        stamp = round(1000 * (point["seconds"] or 0))
        for key, metric in (("loss", "train/loss"), ("test_psnr_db", "train/test_psnr_db")):
            if _is_number(point.get(key)):
                logged.append(Metric(metric, point[key], stamp, int(point["step"])))
                logged.append(Metric(f"{metric}_by_ms", point[key], stamp, stamp))
    params = [Param(key, str(value)[:6000]) for key, value in values.items() if value is not None]
    for start in range(0, max(len(params), len(logged)), 100):
        client.log_batch(run_id, metrics=logged[start : start + 100], params=params[start : start + 100])
    for artifact in FILES:
        client.log_artifact(run_id, str(folder / artifact))
    with contextlib.suppress(ValueError):
        for render in _samples(metrics, folder, renders):
            client.log_artifact(run_id, str(render), "renders")
    client.set_terminated(run_id, "FINISHED")


def _samples(metrics: dict, folder: Path, count: int) -> list[Path]:
    views = metrics["views"]
    step = max(1, len(views) // max(1, count))
    files = [folder / view["file"] for view in views[::step][:count] if "file" in view]
    return [file for file in files if file.is_file()]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
