"""Reads the paper's published numbers, which ship in reports/published."""

import csv
from dataclasses import dataclass
from pathlib import Path

from ._statistics import Summary

FOLDER = Path(__file__).parent / "published"
SAMPLES = 5  # sample sets behind each published mean
ONE_SAMPLE = "coverage"  # has no randomness: its printed ± 0.00 is one sample
SAMPLED = "logdet-sample"  # what the published z_DPP is: the authors' code draws it from the k-DPP
MODELS = {"3dgs": "3DGS", "ingp": "instant-ngp"}
DATASETS = {
    "replica": "Replica",
    "indoortraj": "IndoorTraj",
    "mipnerf360": "Mip-NeRF 360",
    "scannet": "ScanNet",
}


@dataclass(frozen=True)
class Score:
    """One figure of the paper's Table "Results on synthetic scenes" or "Results on real-world scenes"."""

    model: str
    selector: str
    dataset: str
    scene: str
    ratio: float
    psnr_db: float
    psnr_std_db: float | None  # None for a single sample


@dataclass(frozen=True)
class Ablation:
    """One figure of the paper's Table "Ablation study on distance measures"."""

    model: str
    factors: str  # joined by "+"
    dataset: str
    scene: str
    psnr_db: float


def scores(name: str) -> list[Score]:
    """The rows of "table1_synthetic" or "table2_real"."""
    return [
        Score(
            model=row["model"],
            selector=_name(row["selector"]),
            dataset=row["dataset"],
            scene=row["scene"],
            ratio=float(row["ratio"]),
            psnr_db=float(row["psnr_db"]),
            psnr_std_db=None if row["selector"] == ONE_SAMPLE else float(row["psnr_std_db"]),
        )
        for row in _rows(name)
    ]


def ablations() -> list[Ablation]:
    """The rows of "table3_ablation"."""
    return [
        Ablation(row["model"], row["factors"], row["dataset"], row["scene"], float(row["psnr_db"]))
        for row in _rows("table3_ablation")
    ]


def selection_seconds() -> dict[tuple[str, str], str]:
    """Seconds of choosing by (selector, dataset), as printed ("<1")."""
    return {(_name(row["selector"]), row["dataset"]): row["seconds"] for row in _rows("selection_time")}


def summary_of(score: Score) -> Summary:
    """The figure with the number of samples behind it."""
    return Summary(score.psnr_db, score.psnr_std_db, 1 if score.psnr_std_db is None else SAMPLES)


def _name(selector: str) -> str:
    """What a study calls the selector that made a published figure."""
    return SAMPLED if selector == "logdet" else selector


def _rows(name: str) -> list[dict[str, str]]:
    with open(FOLDER / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
