"""Gathers a study's cells into `results.csv`: one row a cell, read from its JSON files."""

import csv
from pathlib import Path
from typing import Any

from viewbench import __version__
from viewbench.common.errors import UserError
from viewbench.common.files import read_json, sha256_file, whole
from viewbench.workflow._study import Study

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
    "commit",
    "scene_sha256",
    "selection_sha256",
    "viewbench",
    "status",
)


def cell_folder(results: Path, row: dict[str, str]) -> Path:
    """results/STUDY/cells/BACKEND/SCENE/SELECTOR/RATIO/SEED."""
    return results.joinpath("cells", *(row[key] for key in ("backend", "scene", "selector", "ratio", "seed")))


def collect(study: Study, results: Path, partial: bool = False) -> list[dict[str, Any]]:
    """Writes and returns the rows, in the order of the grid.

    `results` is results/STUDY. A cell whose files are not all there raises UserError, or with `partial` becomes a
    row with empty figures whose `status` is the last line of its log.
    """
    rows = []
    for cell in study.cells():
        folder = cell_folder(results, cell)
        row: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {"study": study.name, "status": "ok"} | cell
        try:
            row |= _figures(folder, results / "scenes" / f"{cell['scene']}.json")
        except UserError as error:
            if not partial:
                raise
            row["status"] = _last_words(results, cell) or str(error)
        rows.append(row)
    with whole(results / "results.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return rows


def _figures(folder: Path, scene_file: Path) -> dict[str, Any]:
    selection = read_json(folder / "selection.json", "selection")
    train = read_json(folder / "train.json", "training record")
    metrics = read_json(folder / "metrics.json", "metrics")
    scene = read_json(scene_file, "scene description")
    values = {
        "dataset": scene["dataset"],
        "n_views": selection["n_views"],
        "count": selection["count"],
        "psnr_db": metrics["psnr_db"],
        "ssim": metrics["ssim"],
        "lpips": metrics["lpips"],
        "select_s": sum(selection["seconds"].values()),
        "train_s": train["seconds"],
        "evaluate_s": metrics["seconds"],
        "iterations": train["iterations"],
        "peak_rss_bytes": train["peak_rss_bytes"],
        "commit": train["commit"],
        "scene_sha256": scene["sha256"],
        "selection_sha256": sha256_file(folder / "selection.json"),
        "viewbench": train.get("viewbench", __version__),
    }
    return {key: "" if value is None else value for key, value in values.items()}


def log_file(results: Path, stage: str, cell: dict[str, str]) -> Path:
    """results/STUDY/logs/STAGE/BACKEND/SCENE/SELECTOR/RATIO/SEED.log."""
    parts = [cell[key] for key in ("backend", "scene", "selector", "ratio", "seed")]
    return results.joinpath("logs", stage, *parts[:-1], f"{parts[-1]}.log")


def _last_words(results: Path, cell: dict[str, str]) -> str:
    """Last line that the stage which failed wrote to its log."""
    for stage in ("evaluate", "train"):
        path = log_file(results, stage, cell)
        if path.is_file():
            lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
            if lines:
                return f"{stage}: {lines[-1]}"
    return ""
