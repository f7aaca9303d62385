"""Where a cell of a study lies: one folder for each of its five names, from the outside in."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .files import read_json

AXES = ("backend", "scene", "selector", "ratio", "seed")
RECORDS = {"selection.json": "selection", "train.json": "training record", "metrics.json": "metrics"}  # and their names


def cell_name(cell: Mapping[str, str]) -> str:
    """BACKEND/SCENE/SELECTOR/RATIO/SEED."""
    return "/".join(cell[axis] for axis in AXES)


def cell_folder(results: Path, cell: Mapping[str, str]) -> Path:
    """results/STUDY/cells/BACKEND/SCENE/SELECTOR/RATIO/SEED, with `results` results/STUDY."""
    return results / "cells" / cell_name(cell)


def read_records(folder: Path) -> list[Any]:
    """Choice, training and score of the cell in the folder, as read. Raises UserError for one that cannot be."""
    return [read_json(folder / file, what) for file, what in RECORDS.items()]


def figures(selection: dict[str, Any], train: dict[str, Any], metrics: dict[str, Any]) -> dict[str, Any]:
    """Scores (dB, SSIM, LPIPS), seconds of each step, steps and memory (bytes) of a cell, from its records."""
    return {
        "psnr_db": metrics["psnr_db"],
        "ssim": metrics["ssim"],
        "lpips": metrics["lpips"],
        "select_s": sum(selection["seconds"].values()),
        "train_s": train["seconds"],
        "evaluate_s": metrics["seconds"],
        "iterations": train["iterations"],
        "peak_rss_bytes": train["peak_rss_bytes"],
    }
