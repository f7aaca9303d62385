"""Checks a finished study as a reader would: every cell in every place. `python -m tests.end_to_end results/NAME`."""

import csv
import sys
from pathlib import Path

from viewbench.common import settings as settings_file
from viewbench.common.files import read_json
from viewbench.reports import _tracking

COLUMNS = (
    "study,dataset,scene,backend,selector,ratio,seed,n_views,count,psnr_db,ssim,lpips,select_s,train_s,evaluate_s,"
    "iterations,peak_rss_bytes,commit,scene_sha256,selection_sha256"
)


def check(results: Path) -> str:
    """What was found, in a sentence; raises AssertionError on the first thing that is missing."""
    study = read_json(results / "study.json")
    with open(results / "results.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == study["cells"], f"{len(rows)} rows for {study['cells']} cells"
    for row in rows:
        missing = [column for column in COLUMNS.split(",") if column not in row]
        assert not missing, f"results.csv has no column {missing}"
        assert row["status"] == "ok"
        assert 5 < float(row["psnr_db"]) < 60, row
        folder = results.joinpath("cells", *(row[key] for key in _tracking.KEY))
        metrics = read_json(folder / "metrics.json")
        assert (
            abs(sum(view["psnr_db"] for view in metrics["views"]) / len(metrics["views"]) - float(row["psnr_db"]))
            < 1e-6
        )
        assert all((folder / view["file"]).is_file() for view in metrics["views"])
        assert read_json(folder / "selection.json")["count"] == int(row["count"])
    page = (results / "reports" / "index.html").read_text(encoding="utf-8")
    assert 'src="http' not in page
    assert 'href="http' not in page.replace('href="https://openreview.net', "").replace('href="http://127.0.0.1:', "")
    runs = tracked_runs(results.name)
    cells = ["/".join(row[key] for key in _tracking.KEY) for row in rows]
    assert sorted(cell for cell, _ in runs) == sorted(cells), "MLflow does not have exactly one run a cell"
    assert {status for _, status in runs} == {"FINISHED"}
    return f"{results}: {len(rows)} cells, each in results.csv, in its folder and once in MLflow; one page, offline"


def tracked_runs(study: str) -> list[tuple[str, str]]:
    """(cell, status) of every run of the study's experiment that is not deleted."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=_tracking.local_uri(settings_file.load().tracking.uri))
    experiment = client.get_experiment_by_name(study)
    assert experiment is not None, f"MLflow has no experiment '{study}'"
    runs = client.search_runs([experiment.experiment_id], max_results=5000)
    return [(run.data.tags[_tracking.CELL], run.info.status) for run in runs if _tracking.CELL in run.data.tags]


if __name__ == "__main__":
    print(check(Path(sys.argv[1])))
