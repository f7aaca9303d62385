"""Gathers a study's cells into `results.csv`: one row a cell, read from its JSON files and checked (`_stale.py`)."""

import csv
from pathlib import Path
from typing import Any

from .. import __version__
from ..common.cells import RECORDS, cell_folder, cell_name, figures, read_records
from ..common.errors import UserError
from ..common.files import sha256_file, whole, write_text
from ..common.settings import Settings
from ..reports._study import NOT_RUN
from ._progress import STOPPED
from ._stale import Asked
from ._study import Study

TABLE_SEAL = ".results.csv.sha256"  # the hash of results.csv as it was written
COLUMNS = (
    "study",
    "dataset",
    "scene",
    "backend",
    "selector",
    "ratio",
    "seed",
    "n_views",
    "count",
    "psnr_db",
    "ssim",
    "lpips",
    "select_s",
    "train_s",
    "evaluate_s",
    "iterations",
    "peak_rss_bytes",
    "peak_gpu_bytes",
    "commit",
    "scene_sha256",
    "selection_sha256",
    "viewbench",
    "status",
)

NUMBER, MAYBE = (int, float), (int, float, type(None))
# What is taken from each record, and its types.
FIGURES: dict[str, dict[str, Any]] = {
    "selection.json": {"n_views": int, "count": int, "seconds": dict},
    "train.json": {
        "seconds": NUMBER,
        "iterations": (int, type(None)),
        "peak_rss_bytes": MAYBE,
        "peak_gpu_bytes": MAYBE,
        "commit": (str, type(None)),
        "selection_sha256": str,
    },
    "metrics.json": {"psnr_db": MAYBE, "ssim": MAYBE, "lpips": MAYBE, "seconds": NUMBER},
}


def collect(study: Study, results: Path, settings: Settings, partial: bool = False) -> list[dict[str, Any]]:
    """Writes and returns the rows, in the order of the grid.

    `results` is results/STUDY. A cell whose files are not all there, do not fit together, or were made from something
    else than what the study, the settings, the data and the source code are now raises UserError, or with `partial`
    becomes a row with empty figures whose `status` says why.
    """
    asked = Asked(study, results, settings)
    rows = []
    for cell in study.cells():
        folder = cell_folder(results, cell)
        row: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {"study": study.name, "status": "ok"} | cell
        try:
            row |= _figures(cell, folder, asked)
        except UserError as error:
            if not partial:
                raise
            row["status"] = _last_words(results, cell, folder / "metrics.json") or (
                str(error) if (folder / "metrics.json").is_file() else NOT_RUN
            )
        rows.append(row)
    with whole(results / "results.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    write_text(results / TABLE_SEAL, sha256_file(results / "results.csv") + "\n")
    return rows


def without_stale(cells: list[dict[str, str]], results: Path) -> list[dict[str, str]]:
    """The cells that `results.csv` calls ok; all of them where it has not been written."""
    try:
        with open(results / "results.csv", newline="", encoding="utf-8") as file:
            sound = {cell_name(row) for row in csv.DictReader(file) if row["status"] == "ok"}
    except (OSError, KeyError):
        return cells
    return [cell for cell in cells if cell_name(cell) in sound]


def _figures(cell: dict[str, str], folder: Path, asked: Asked) -> dict[str, Any]:
    selection, train, metrics = read_records(folder)
    asked.check(cell, folder, selection, train, metrics)
    scene = asked.scene(cell["scene"])
    _complete(folder, dict(zip(RECORDS, (selection, train, metrics), strict=True)))
    values = {
        "dataset": scene.dataset,
        "n_views": selection["n_views"],
        "count": selection["count"],
        **figures(selection, train, metrics),
        "peak_gpu_bytes": train["peak_gpu_bytes"],
        "commit": train["commit"],
        "scene_sha256": scene.sha256,
        "selection_sha256": train["selection_sha256"],
        "viewbench": train.get("viewbench", __version__),
    }
    return {key: "" if value is None else value for key, value in values.items()}


def _complete(folder: Path, records: dict[str, dict[str, Any]]) -> None:
    """Raises UserError where a record lacks a figure of the row, or has something else in its place."""
    for file, keys in FIGURES.items():
        for key, kinds in keys.items():
            value = records[file].get(key, ...)
            numbers = value.values() if isinstance(value, dict) else [value]
            fits = isinstance(value, kinds) and not any(isinstance(one, bool) for one in numbers)
            if not fits or (kinds is dict and not all(isinstance(one, int | float) for one in numbers)):
                raise UserError(
                    f"cell '{folder}': {file} has no {key}, or one that is none; delete {file} there and run the study "
                    "again"
                )


def _logs(results: Path, cell: dict[str, str]) -> dict[Path, str]:
    """Logs of the steps that the cell needs, with the name of the step."""
    logs = results / "logs"
    found = {logs / step / f"{cell_name(cell)}.log": step for step in ("train", "evaluate")}
    found |= dict.fromkeys(logs.glob(f"select/{cell['scene']}/{cell['selector']}/*/*.log"), "select")
    return found | {logs / "features" / f"{cell['scene']}.log": "features"}


def _last_words(results: Path, cell: dict[str, str], score: Path) -> str:
    """Last line of the newest of the cell's logs since it had a score: the step that failed wrote it. A step that was
    stopped with the run has not failed."""
    scored_at = score.stat().st_mtime_ns if score.is_file() else 0
    logs = {path: step for path, step in _logs(results, cell).items() if path.is_file()}
    logs = {path: step for path, step in logs.items() if path.stat().st_mtime_ns > scored_at}
    for path in sorted(logs, key=lambda path: path.stat().st_mtime_ns, reverse=True):
        lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
        if lines and lines[-1] not in STOPPED:
            return f"{logs[path]}: {lines[-1]}"
    return ""
