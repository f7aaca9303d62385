import json

import pytest

from tests.conftest import known
from viewbench.common.errors import UserError
from viewbench.common.settings import Tracking
from viewbench.reports import _tracking

ROWS = [
    {"backend": "splat", "scene": "room", "selector": selector, "ratio": "0.1", "seed": seed}
    for selector in ("random", "maxmin")
    for seed in ("0", "1")
]


def write_cell(results, row, psnr_db=20.0):
    folder = results.joinpath("cells", *(row[key] for key in _tracking.KEY))
    (folder / "renders").mkdir(parents=True, exist_ok=True)
    views = []
    for number in range(5):
        (folder / "renders" / f"{number}.png").write_bytes(b"png")
        views.append({"name": f"{number}", "file": f"renders/{number}.png", "psnr_db": psnr_db})
    curve = [{"step": 10 * i, "seconds": 0.5 * i, "loss": 1 / i, "test_psnr_db": 10.0 + i} for i in range(1, 4)]
    contents = {
        "selection": {"count": 4, "n_views": 40, "seconds": {"select": 0.1}, "parameters": {"alpha": 0.7}},
        "train": {
            "seconds": 2.0,
            "iterations": 30,
            "peak_rss_bytes": 10**8,
            "n_primitives": 100,
            "curve": curve,
            "commit": "abc",
            "version": "1",
            "device": "cpu",
            "budget": {"iterations": 30, "seconds": None},
        },
        "metrics": {"psnr_db": psnr_db, "ssim": 0.5, "lpips": None, "seconds": 1.0, "views": views},
    }
    for name, value in contents.items():
        (folder / f"{name}.json").write_text(json.dumps(value), encoding="utf-8")
    return folder


@pytest.fixture
def store(tmp_path):
    results = tmp_path / "results" / "demo"
    for row in ROWS:
        write_cell(results, row)
    tracking = Tracking(uri=f"sqlite:///{tmp_path}/mlflow.db", artifacts=str(tmp_path / "artifacts"), renders=2)
    return results, tracking


def runs_of(tracking):
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=tracking.uri)
    experiment = known(client.get_experiment_by_name("demo"))
    return client, client.search_runs([experiment.experiment_id])


def test_one_finished_run_a_cell_however_often(store):
    results, tracking = store
    assert _tracking.track("demo", ROWS[:3], results, tracking) == {"logged": 3, "kept": 0}
    assert _tracking.track("demo", ROWS, results, tracking) == {"logged": 1, "kept": 3}
    assert _tracking.track("demo", ROWS, results, tracking) == {"logged": 0, "kept": 4}
    client, runs = runs_of(tracking)
    assert sorted(known(run.info.run_name) for run in runs) == [
        "room/maxmin/0.1/0",
        "room/maxmin/0.1/1",
        "room/random/0.1/0",
        "room/random/0.1/1",
    ]

    # a crash half-way: an unfinished run of a cell, and a finished one logged twice
    experiment = runs[0].info.experiment_id
    half = client.create_run(experiment, tags={_tracking.CELL: "splat/room/random/0.1/0"})
    again = client.create_run(experiment, tags=runs[0].data.tags)
    client.log_metric(again.info.run_id, "psnr_db", 20.0)
    client.set_terminated(again.info.run_id)
    _tracking.track("demo", ROWS, results, tracking)
    _, runs = runs_of(tracking)
    assert len(runs) == 4
    assert {run.info.status for run in runs} == {"FINISHED"}
    assert half.info.run_id not in {run.info.run_id for run in runs}

    # a cell that was run again replaces its run
    write_cell(results, ROWS[0], psnr_db=25.0)
    assert _tracking.track("demo", ROWS, results, tracking) == {"logged": 1, "kept": 3}
    client, runs = runs_of(tracking)
    assert sorted(run.data.metrics["psnr_db"] for run in runs) == [20.0, 20.0, 20.0, 25.0]

    run = next(run for run in runs if run.data.metrics["psnr_db"] == 25.0)
    assert run.data.params["selector"] == "random"
    assert run.data.params["budget.iterations"] == "30"
    assert run.data.tags["commit"] == "abc"
    curve = client.get_metric_history(run.info.run_id, "train/test_psnr_db")
    assert [(point.step, point.value) for point in curve] == [(10, 11.0), (20, 12.0), (30, 13.0)]
    artifacts = {item.path for item in client.list_artifacts(run.info.run_id)}
    assert artifacts == {"selection.json", "train.json", "metrics.json", "renders"}
    assert len(client.list_artifacts(run.info.run_id, "renders")) == 2


def test_a_server_that_is_down_is_one_sentence(store, monkeypatch):
    results, _ = store
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(UserError, match="did not take the runs"):
        _tracking.track("demo", ROWS, results, Tracking(uri="http://127.0.0.1:9", patience=0))


def test_cells_without_all_their_files_are_left_out(store):
    results, tracking = store
    results.joinpath("cells", *(ROWS[0][key] for key in _tracking.KEY), "metrics.json").unlink()
    assert _tracking.track("demo", ROWS, results, tracking) == {"logged": 3, "kept": 0}
