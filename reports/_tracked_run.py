"""What MLflow is told of one cell: tags, parameters, metrics with the curve of the training, and files."""

import hashlib
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..common.cells import AXES, RECORDS, cell_name, figures, read_records

CELL, FINGERPRINT, WRITER = "viewbench.cell", "viewbench.fingerprint", "viewbench.writer"
LONGEST = 6000  # letters of a parameter that MLflow takes


@dataclass(frozen=True)
class Content:
    """A run as it is logged; `files` are pairs of a path and a folder among the artifacts, None for the first one."""

    name: str
    tags: dict[str, str]
    params: dict[str, str]
    metrics: list[tuple[str, float, int, int]]  # name, value, time stamp in milliseconds, step
    files: list[tuple[Path, str | None]]


def fingerprint(folder: Path) -> str:
    """Hash of a cell's files; raises OSError where one is missing."""
    digest = hashlib.sha256()
    for name in RECORDS:
        digest.update((folder / name).read_bytes() + b"\0")
    return digest.hexdigest()


def content(cell: dict[str, str], folder: Path, renders: int) -> Content:
    """What is logged of the cell, with so many of its renders; raises UserError for a file that cannot be read."""
    selection, train, metrics = read_records(folder)
    tags = {
        CELL: cell_name(cell),
        "commit": train["commit"],
        "backend": cell["backend"],
        "backend_version": train["version"],
        "device": train["device"],
        "viewbench": train.get("viewbench", ""),
    }
    values = {**cell, "count": selection["count"], "n_views": selection["n_views"], "width": train.get("width")}
    values |= {f"budget.{key}": value for key, value in train["budget"].items()}
    values |= {f"option.{key}": value for key, value in train.get("options", {}).items()}
    values |= {f"selector.{key}": value for key, value in selection["parameters"].items()}
    params = {key: str(value)[:LONGEST] for key, value in values.items() if value is not None}
    final = {**figures(selection, train, metrics), "n_primitives": train["n_primitives"]}
    logged = [(key, value, 0, 0) for key, value in final.items() if _is_number(value)]
    files: list[tuple[Path, str | None]] = [(folder / name, None) for name in RECORDS]
    files += [(path, "renders") for path in _samples(metrics, folder, renders)]
    name = "/".join(cell[key] for key in AXES[1:])
    return Content(name, tags, params, logged + _curve(train["curve"]), files)


def write(client: Any, experiment: str, told: Content, tags: dict[str, str], made: Callable[[str], None]) -> str:
    """Logs a run with `tags` besides its own, calls `made` with its id as soon as it has one, and ends it.

    The run is finished when all of it is there, and not before. As few requests as MLflow's limits allow: one to begin
    it, one for up to 1000 numbers, one a file, one to end it.
    """
    from mlflow.entities import Metric, Param
    from mlflow.store.artifact.artifact_repository_registry import get_artifact_repository

    run = client.create_run(experiment, tags=told.tags | tags, run_name=told.name).info
    made(run.run_id)
    params = [Param(key, value) for key, value in told.params.items()]
    # The client itself cuts this into requests of at most 1000 metrics and 100 parameters.
    client.log_batch(run.run_id, metrics=[Metric(*metric) for metric in told.metrics], params=params)
    # What client.log_artifact does, without asking for the run again to learn where its artifacts go.
    store = get_artifact_repository(run.artifact_uri, tracking_uri=client.tracking_uri)
    for path, where in told.files:
        store.log_artifact(os.fspath(path), where)
    client.set_terminated(run.run_id, "FINISHED")
    return run.run_id


def _curve(points: list[dict[str, Any]]) -> list[tuple[str, float, int, int]]:
    """By step, and with the elapsed time as the time stamp and as a step of its own."""
    curve = []
    for point in points:
        stamp = round(1000 * (point["seconds"] or 0))
        for key, metric in (("loss", "train/loss"), ("test_psnr_db", "train/test_psnr_db")):
            if _is_number(point.get(key)):
                curve.append((metric, point[key], stamp, int(point["step"])))
                curve.append((f"{metric}_by_ms", point[key], stamp, stamp))
    return curve


def _samples(metrics: dict, folder: Path, count: int) -> list[Path]:
    views = metrics["views"]
    if not count or not views:
        return []
    files = [folder / view["file"] for view in views[:: max(1, len(views) // count)][:count] if "file" in view]
    return [file for file in files if file.is_file()]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
