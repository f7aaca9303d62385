import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common.errors import UserError
from viewbench.common.files import sha256_file
from viewbench.common.settings import Tracking
from viewbench.reports import _about, _tracked_view, _tracking, _tracking_page
from viewbench.reports._style import styles
from viewbench.selectors._selection import selection_sha256

ROWS = [
    {"backend": "splat", "scene": "room", "selector": selector, "ratio": "0.1", "seed": seed}
    for selector in ("random", "maxmin")
    for seed in ("0", "1")
]
GROUPS = ["splat/room/maxmin", "splat/room/random"]


def about(name="demo", rows=ROWS):
    """A study of these cells."""
    record = {
        "name": name,
        "title": "A study to log",
        "description": "Of no use.",
        "selectors": [{"name": name} for name in dict.fromkeys(row["selector"] for row in rows)],
        "scenes": ["room"],
    }
    return _about.of_study(record, rows, "demo.yaml", lambda scene: f"somewhere/{scene}")


def write_cell(results, row, psnr_db=20.0, ended="2026-01-02T03:04:20.000+00:00"):
    """A cell's files, with pictures and records that fit together."""
    folder = results.joinpath("cells", *(row[key] for key in _tracking.KEY))
    (folder / "renders").mkdir(parents=True, exist_ok=True)
    views = []
    for number in range(5):
        Image.fromarray(np.full((6, 8, 3), 40 * number, np.uint8)).save(folder / "renders" / f"{number}.png")
        views.append({"name": f"{number}", "file": f"renders/{number}.png", "psnr_db": psnr_db, "ssim": 0.5})
    (folder / "model.ply").write_bytes(b"ply" * 400)
    curve = [{"step": 10 * i, "seconds": 0.5 * i, "loss": 1 / i, "test_psnr_db": 10.0 + i} for i in range(1, 4)]
    selection = {"count": 4, "n_views": 40, "indices": [0, 10, 20, 30], "seconds": {"select": 0.25}}
    selection |= {"parameters": {"alpha": 0.7}, "selector": row["selector"]}
    train = {
        "seconds": 2.0,
        "iterations": 30,
        "peak_rss_bytes": 10**8,
        "n_primitives": 100,
        "curve": curve,
        "commit": "abc-dirty",
        "version": "1",
        "device": "cpu",
        "budget": {"iterations": 30, "seconds": None},
        "machine": {"cpu": "A processor", "cpus": 2, "system": "Linux", "python": "3.11.2"},
        "began": "2026-01-02T03:04:05.000+00:00",
        "scene_sha256": "0123456789abcdef" * 4,
        "selection_sha256": selection_sha256(selection),
        "files": {"model.ply": "0" * 64},
    }
    for name, value in {"selection": selection, "train": train}.items():
        (folder / f"{name}.json").write_text(json.dumps(value), encoding="utf-8")
    metrics = {"psnr_db": psnr_db, "ssim": 0.5, "lpips": None, "seconds": 1.0, "views": views, "ended": ended}
    metrics["train_sha256"] = sha256_file(folder / "train.json")
    (folder / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
    return folder


def describe(results, name="room"):
    """The description of the scene, on which a figure of its cameras can be drawn."""
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    positions = np.stack([np.cos(turn), np.sin(turn), 0.01 * np.sin(7 * turn)], 1)
    record = {"schema": 1, "scene": name, "n_train": 40, "n_test": 5, "width": 8, "height": 6, "points": []}
    record["train"] = {"positions": positions.tolist(), "forward": (-positions).tolist()}
    record["test"] = {"positions": positions[:5].tolist(), "forward": (-positions[:5]).tolist()}
    (results / "scenes").mkdir(parents=True, exist_ok=True)
    (results / "scenes" / f"{name}.json").write_text(json.dumps(record), encoding="utf-8")


@pytest.fixture
def store(tmp_path):
    results = tmp_path / "results" / "demo"
    for row in ROWS:
        write_cell(results, row)
    tracking = Tracking(uri=f"sqlite:///{tmp_path}/mlflow.db", artifacts=str(tmp_path / "artifacts"), renders=2)
    return results, tracking


def runs_of(tracking, kind="cell"):
    """Client and runs of one kind that are not deleted; all where the kind is ""."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=tracking.uri)
    experiment = known(client.get_experiment_by_name("demo"))
    asked = f"tags.`viewbench.kind` = '{kind}'" if kind else ""
    return client, client.search_runs([experiment.experiment_id], filter_string=asked)


def counts(done):
    return {key: done[key] for key in ("logged", "kept")}


def track(results, tracking, rows=ROWS, told=None):
    return counts(_tracking.track(told or about(), rows, results, tracking))


def history(client, run, metric):
    return [(point.step, point.value) for point in client.get_metric_history(run.info.run_id, metric)]


def test_one_finished_run_a_cell_however_often(store):
    results, tracking = store
    assert track(results, tracking, ROWS[:3]) == {"logged": 3, "kept": 0}
    assert track(results, tracking) == {"logged": 1, "kept": 3}
    assert track(results, tracking) == {"logged": 0, "kept": 4}
    client, runs = runs_of(tracking)
    assert sorted(known(run.info.run_name) for run in runs) == [
        "maxmin 10 % #0 · room",
        "maxmin 10 % #1 · room",
        "random 10 % #0 · room",
        "random 10 % #1 · room",
    ]

    # a crash half-way: an unfinished run of a cell, and a finished one logged twice
    experiment = runs[0].info.experiment_id
    half = client.create_run(experiment, tags={_tracking.CELL: "splat/room/random/0.1/0"})
    again = client.create_run(experiment, tags=runs[0].data.tags)
    client.log_metric(again.info.run_id, "psnr_db", 20.0)
    client.set_terminated(again.info.run_id)
    track(results, tracking)
    _, runs = runs_of(tracking, "")
    assert len(runs) == 4 + 2
    assert {run.info.status for run in runs} == {"FINISHED"}
    assert half.info.run_id not in {run.info.run_id for run in runs}

    # a cell that was run again replaces its run
    write_cell(results, ROWS[0], psnr_db=25.0)
    assert track(results, tracking) == {"logged": 1, "kept": 3}
    client, runs = runs_of(tracking)
    assert sorted(run.data.metrics["psnr_db"] for run in runs) == [20.0, 20.0, 20.0, 25.0]

    run = next(run for run in runs if run.data.metrics["psnr_db"] == 25.0)
    assert run.data.params["selector"] == "random"
    assert run.data.params["budget.iterations"] == "30"
    assert history(client, run, "train/test_psnr_db") == [(10, 11.0), (20, 12.0), (30, 13.0)]


def test_a_run_is_when_what_and_whose_its_cell_was(store):
    results, tracking = store
    describe(results)
    track(results, tracking)
    client, runs = runs_of(tracking)
    run = next(run for run in runs if run.info.run_name == "maxmin 10 % #1 · room")
    began_ms = 1767323045000  # 2026-01-02T03:04:05Z
    assert (run.info.start_time, run.info.end_time) == (began_ms - 250, began_ms + 15000)
    loss = client.get_metric_history(run.info.run_id, "train/loss")
    assert [point.timestamp for point in loss] == [began_ms + 500, began_ms + 1000, began_ms + 1500]
    tags = run.data.tags
    assert tags["mlflow.source.name"] == "viewbench run demo.yaml"
    assert (tags["mlflow.source.git.commit"], tags["mlflow.source.git.dirty"]) == ("abc", "True")
    assert tags["machine"] == "A processor, 2 CPUs, Linux, Python 3.11.2"
    assert tags["mlflow.user"]
    (data,) = [given.dataset for given in known(run.inputs).dataset_inputs]
    assert (data.name, data.digest) == ("room", "0123456789abcdef")
    assert json.loads(data.source) == {"uri": "somewhere/room"}
    assert json.loads(known(data.profile))["training views"] == 40
    files = {item.path: item for item in client.list_artifacts(run.info.run_id)}
    assert set(files) == {"selection.json", "train.json", "metrics.json", "renders", "cameras.png", "model"}
    assert len(client.list_artifacts(run.info.run_id, "renders")) == 2


def test_an_earlier_version_named_no_times_and_its_runs_are_replaced(store):
    results, tracking = store
    folder = write_cell(results, ROWS[0])
    for name in ("train", "metrics"):
        record = json.loads((folder / f"{name}.json").read_text())
        timeless = {key: value for key, value in record.items() if key not in ("began", "ended")}
        (folder / f"{name}.json").write_text(json.dumps(timeless))
    track(results, tracking, ROWS[:1])
    client, (run,) = runs_of(tracking)
    scored_ms = 1000 * (folder / "metrics.json").stat().st_mtime
    ended_ms = known(run.info.end_time)
    assert abs(ended_ms - scored_ms) < 2
    assert abs(ended_ms - run.info.start_time - 2250) < 1000
    # as an earlier version left it
    client.delete_run(run.info.run_id)
    tags = {_tracking.CELL: "splat/room/random/0.1/0", _tracking.FINGERPRINT: "of old"}
    client.set_terminated(client.create_run(run.info.experiment_id, tags=tags).info.run_id)
    assert track(results, tracking, ROWS[:1]) == {"logged": 1, "kept": 0}
    assert len(runs_of(tracking, "")[1]) == 2


def test_a_selector_has_the_colour_of_the_figures(store):
    results, tracking = store
    track(results, tracking)
    drawn = styles(("random", "maxmin"))
    for kind in ("cell", "summary"):
        for run in runs_of(tracking, kind)[1]:
            assert run.data.tags["mlflow.runColor"] == drawn[run.data.params["selector"]].colour


RATIOS = [
    {"backend": backend, "scene": "room", "selector": selector, "ratio": ratio, "seed": seed}
    for backend in ("splat", "other")
    for selector, ratios in (("maxmin", ("0.05", "0.1", "0.2")), ("full", ("1.0",)))
    for ratio in ratios
    for seed in ("0", "1")
]


def psnr_of(row):
    return 15.0 + 10 * float(row["ratio"]) + int(row["seed"]) + (row["backend"] == "other")


def one_backend(results):
    """Cells of one backend at several ratios, and their study."""
    rows = [row for row in RATIOS if row["backend"] == "splat"]
    for row in rows:
        write_cell(results, row, psnr_of(row))
    return rows, about(rows=rows)


def test_summaries_have_the_ratio_as_their_step(store):
    results, tracking = store
    for row in RATIOS:
        write_cell(results, row, psnr_of(row))
    _tracking.track(about(rows=RATIOS), RATIOS, results, tracking)
    client, runs = runs_of(tracking, "summary")
    found = {run.info.run_name: run for run in runs}
    assert set(found) == {"maxmin · room", "full · room", "maxmin · room · other", "full · room · other"}
    means = [(5, 16.0), (10, 16.5), (20, 17.5)]
    assert history(client, found["maxmin · room"], "psnr_db") == means
    assert history(client, found["maxmin · room"], "psnr_db/room") == means
    assert history(client, found["maxmin · room"], "ratio_percent") == [(5, 5.0), (10, 10.0), (20, 20.0)]
    for _, value in history(client, found["maxmin · room"], "psnr_db_std"):
        assert value == pytest.approx(0.5**0.5)
    # the reference is a level line in the panel, and says where it stands by itself
    assert history(client, found["full · room"], "psnr_db") == [(100, 25.5)]
    assert history(client, found["full · room"], "psnr_db/room") == [(5, 25.5), (10, 25.5), (20, 25.5)]
    assert history(client, found["maxmin · room · other"], "psnr_db/room") == []
    others = history(client, found["maxmin · room · other"], "psnr_db/room/other")
    assert [value for _, value in others] == [17, 17.5, 18.5]
    # cells are children of theirs
    for cell in runs_of(tracking)[1]:
        parent = client.get_run(cell.data.tags["mlflow.parentRunId"])
        assert parent.data.tags["viewbench.summary"] + "/" in cell.data.tags[_tracking.CELL]


def test_a_summary_is_added_to_and_made_anew_where_a_number_has_changed(store):
    results, tracking = store
    rows, told = one_backend(results)
    track(results, tracking, rows[:2], told)
    client, (first,) = runs_of(tracking, "summary")
    assert history(client, first, "psnr_db") == [(5, 16.0)]
    track(results, tracking, rows, told)
    client, runs = runs_of(tracking, "summary")
    second = next(run for run in runs if run.info.run_name == "maxmin · room")
    assert second.info.run_id == first.info.run_id
    assert history(client, second, "psnr_db") == [(5, 16.0), (10, 16.5), (20, 17.5)]

    write_cell(results, rows[2], psnr_db=30.0)
    track(results, tracking, rows, told)
    client, runs = runs_of(tracking, "summary")
    third = next(run for run in runs if run.info.run_name == "maxmin · room")
    assert history(client, third, "psnr_db") == [(5, 16.0), (10, (30.0 + 17.0) / 2), (20, 17.5)]
    parents = {run.data.tags["mlflow.parentRunId"] for run in runs_of(tracking)[1]}
    assert parents == {run.info.run_id for run in runs}

    # somebody has deleted a summary, and a parent by hand
    client.delete_run(third.info.run_id)
    track(results, tracking, rows, told)
    client, runs = runs_of(tracking, "summary")
    assert {run.data.tags["mlflow.parentRunId"] for run in runs_of(tracking)[1]} == {run.info.run_id for run in runs}
    assert len(runs) == 2


def test_shares_that_are_no_whole_percents_have_steps_of_their_own(store):
    results, tracking = store
    rows = [{**ROWS[0], "ratio": ratio} for ratio in ("0.005", "0.0125", "0.02")]
    for number, row in enumerate(rows):
        write_cell(results, row, 20.0 + number)
    track(results, tracking, rows, about(rows=rows))
    client, (run,) = runs_of(tracking, "summary")
    assert history(client, run, "psnr_db") == [(50, 20.0), (125, 21.0), (200, 22.0)]
    assert history(client, run, "ratio_percent") == [(50, 0.5), (125, 1.25), (200, 2.0)]


def test_the_experiment_is_one_of_training_and_says_what_it_is(store):
    from mlflow import MlflowClient

    results, tracking = store
    track(results, tracking)
    client = MlflowClient(tracking_uri=tracking.uri)
    tags = known(client.get_experiment_by_name("demo")).tags
    assert tags["mlflow.experimentKind"] == "custom_model_development"
    first, _, rest = tags["mlflow.note.content"].partition("\n")
    assert first.startswith("A study to log · [Figure 4](#/experiments/1/runs?")
    assert "Of no use." in rest
    views = [key for key in tags if key.startswith(_tracked_view.PREFIX)]
    assert views
    key = next(key for key in views if key == _tracked_view.PREFIX + _tracked_view.KEY)
    assert f"viewStateShareKey={key.removeprefix(_tracked_view.PREFIX)}&" in first

    # a title that is another one is told, a verdict stays
    page = results / "reports" / "index.html"
    page.parent.mkdir()
    page.write_text("<html></html>")
    client.set_experiment_tag("1", "mlflow.note.content", "A study to log · verdict")
    track(results, tracking)
    assert known(client.get_experiment_by_name("demo")).tags["mlflow.note.content"] == "A study to log · verdict"
    track(results, tracking, told=replace(about(), title="Another title"))
    assert known(client.get_experiment_by_name("demo")).tags["mlflow.note.content"].startswith("Another title · [")


def test_the_page_is_a_run_and_the_verdict_is_said(store, monkeypatch):
    from mlflow import MlflowClient

    results, tracking = store
    with pytest.raises(UserError, match="no page"):
        _tracking_page.publish(about(), results, tracking)
    page = results / "reports" / "index.html"
    page.parent.mkdir()
    page.write_text("<html></html>")
    (results / "results.csv").write_text("a,b\n")
    monkeypatch.setattr(_tracking_page._study, "load", lambda folder: None)
    monkeypatch.setattr(_tracking_page._page, "verdict", lambda study: ["maxmin is as good as uniform."])
    track(results, tracking)
    run = _tracking_page.publish(about(), results, tracking)["run"]
    assert _tracking_page.publish(about(), results, tracking)["run"] == run
    client = MlflowClient(tracking_uri=tracking.uri)
    assert {item.path for item in client.list_artifacts(run)} == {"index.html", "results.csv"}
    note = known(client.get_experiment_by_name("demo")).tags["mlflow.note.content"]
    assert f"(#/experiments/1/runs/{run}/artifacts/index.html?workflowType=machine_learning)" in note.partition("\n")[0]
    assert "maxmin is as good as uniform." in note
    page.write_text("<html> </html>")
    other = _tracking_page.publish(about(), results, tracking)["run"]
    assert other != run
    assert len(runs_of(tracking, "report")[1]) == 1
    track(results, tracking)
    assert known(client.get_experiment_by_name("demo")).tags["mlflow.note.content"] == note.replace(run, other)


@pytest.mark.parametrize(("renders", "models", "expected"), [(0, 0, set()), (1, 0, {"renders"}), (0, 1, {"model"})])
def test_files_are_as_many_as_the_settings_allow(store, renders, models, expected):
    results, tracking = store
    asked = replace(tracking, renders=renders, models=models)
    track(results, tracking, ROWS[:1])
    assert track(results, asked, ROWS[:1]) == {"logged": 1, "kept": 0}  # another setting, another run
    client, (run,) = runs_of(tracking)
    found = {item.path for item in client.list_artifacts(run.info.run_id)}
    assert found == {"selection.json", "train.json", "metrics.json"} | expected


def test_a_model_beside_the_results_takes_no_room_and_a_large_one_is_left(store, tmp_path):
    results, tracking = store
    track(results, tracking, ROWS[:1])
    folder = results / "cells" / "splat" / "room" / "random" / "0.1" / "0"
    assert (folder / "model.ply").stat().st_nlink == 2
    with open(folder / "model.ply", "ab") as file:
        file.truncate(11 * 10**6)
    train = json.loads((folder / "train.json").read_text())
    (folder / "train.json").write_text(json.dumps({**train, "seconds": 3.0}))
    track(results, tracking, ROWS[:1])
    client, (run,) = runs_of(tracking)
    assert "model" not in {item.path for item in client.list_artifacts(run.info.run_id)}


def test_a_link_for_a_model_leads_nowhere(store, tmp_path):
    results, tracking = store
    folder = results / "cells" / "splat" / "room" / "random" / "0.1" / "0"
    secret = tmp_path / "secret"
    secret.write_text("of somebody else")
    (folder / "model.ply").unlink()
    (folder / "model.ply").symlink_to(secret)
    train = json.loads((folder / "train.json").read_text())
    (folder / "train.json").write_text(json.dumps({**train, "files": {"model.ply": "", "../../1/model.ply": ""}}))
    track(results, tracking, ROWS[:1])
    client, (run,) = runs_of(tracking)
    assert "model" not in {item.path for item in client.list_artifacts(run.info.run_id)}


def test_a_server_that_is_down_is_one_sentence(store, monkeypatch):
    results, _ = store
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(UserError, match="did not take the runs"):
        track(results, Tracking(uri="http://127.0.0.1:9", patience=0))


def test_cells_without_all_their_files_are_left_out(store):
    results, tracking = store
    results.joinpath("cells", *(ROWS[0][key] for key in _tracking.KEY), "metrics.json").unlink()
    assert track(results, tracking) == {"logged": 3, "kept": 0}


def test_a_cell_that_is_out_of_date_loses_its_run_and_its_place_in_the_summary(store):
    results, tracking = store
    rows, told = one_backend(results)
    track(results, tracking, rows, told)

    def again(sound):
        stale = [row for row in rows if row not in sound]
        _tracking.track(told, sound, results, tracking, stale=stale)
        client, summaries = runs_of(tracking, "summary")
        names = {run.info.run_name: run for run in summaries}
        return client, names, {run.data.tags[_tracking.CELL] for run in runs_of(tracking)[1]}

    client, names, cells = again(rows[1:])
    assert cells == {"/".join(row.values()) for row in rows[1:]}
    assert history(client, names["maxmin · room"], "psnr_db") == [(5, 16.5), (10, 16.5), (20, 17.5)]
    client, names, cells = again(rows[6:])
    assert set(names) == {"full · room"}
    assert len(cells) == 2
    # a run that was made of other files, by another machine perhaps, stays
    track(results, tracking, rows, told)
    write_cell(results, rows[0], 12.0)
    _, _, cells = again(rows[1:])
    assert len(cells) == len(rows)
    # one whose training is new and has no score goes: it was scored here
    results.joinpath("cells", *rows[0].values(), "metrics.json").unlink()
    _, _, cells = again(rows[1:])
    assert len(cells) == len(rows) - 1


def test_what_the_study_does_not_have_any_more_goes(store):
    results, tracking = store
    track(results, tracking)
    track(results, tracking, ROWS[:2], about(rows=ROWS[:2]))
    assert [run.info.run_name for run in runs_of(tracking, "summary")[1]] == ["random · room"]
    assert {run.data.params["selector"] for run in runs_of(tracking)[1]} == {"random"}


def test_a_summary_that_is_there_twice_is_there_once(store):
    results, tracking = store
    track(results, tracking)
    client, runs = runs_of(tracking, "summary")
    twin = client.create_run(runs[0].info.experiment_id, tags=runs[0].data.tags)
    client.set_terminated(twin.info.run_id)
    track(results, tracking)
    assert len(runs_of(tracking, "summary")[1]) == 2


@pytest.mark.parametrize(("file", "change"), [("train", {"seconds": 1e300}), ("train", {"began": "9999-01-01T00:00Z"})])
def test_times_that_no_database_takes_are_named(store, file, change):
    results, tracking = store
    path = results.joinpath("cells", *ROWS[0].values(), f"{file}.json")
    record = {**json.loads(path.read_text()), **change}
    record["curve"] += [{"step": 1e30, "seconds": 1.0, "loss": 1.0}, {"step": 1, "seconds": float("nan"), "loss": 1.0}]
    if "seconds" in change:
        del record["began"]
    path.write_text(json.dumps(record))
    with pytest.raises(
        UserError, match=r"took 3 of 4 cells, first without splat/room/random/0\.1/0: .*not as viewbench"
    ):
        track(results, tracking)


def test_a_link_for_a_record_is_not_followed(store, tmp_path):
    results, tracking = store
    path = results.joinpath("cells", *ROWS[0].values(), "selection.json")
    path.rename(tmp_path / "elsewhere.json")
    path.symlink_to(tmp_path / "elsewhere.json")
    with pytest.raises(UserError, match="is a link"):
        track(results, tracking)


def test_files_of_runs_that_are_replaced_go(store, tmp_path):
    results, tracking = store
    for psnr_db in (20.0, 21.0, 22.0):
        write_cell(results, ROWS[0], psnr_db)
        track(results, tracking, ROWS[:1])
    (tmp_path / "artifacts" / "demo" / "of_the_user").mkdir()
    _, runs = runs_of(tracking)
    kept = {path.name for path in (tmp_path / "artifacts" / "demo").iterdir()}
    assert kept == {runs[0].info.run_id, "of_the_user"}


def test_names_that_mlflow_does_not_take_are_written_otherwise(store):
    results, tracking = store
    row = {**ROWS[0], "scene": "küche, [alt]"}
    write_cell(results, row)
    track(results, tracking, [row], about(rows=[row]))
    client, (run,) = runs_of(tracking, "summary")
    assert history(client, run, "psnr_db/küche_ _alt_") == [(10, 20.0)]


def test_the_figure_of_a_choice_is_drawn_once_and_anew_for_another_choice_or_scene(store, monkeypatch):
    from viewbench.reports import _run_cameras

    results, tracking = store
    describe(results)
    drawn, cameras = [], _run_cameras.cameras
    monkeypatch.setattr(_run_cameras, "cameras", lambda *given: drawn.append(given) or cameras(*given))
    track(results, tracking)
    assert len(drawn) == 2  # by selector: both seeds have one choice
    path = results.joinpath("cells", *ROWS[1].values(), "selection.json")
    path.write_text(json.dumps({**json.loads(path.read_text()), "indices": [1, 2, 3, 4]}))
    track(results, tracking)
    client, runs = runs_of(tracking)
    assert len(drawn) == 3
    figures = {Path(client.download_artifacts(run.info.run_id, "cameras.png")).read_bytes() for run in runs}
    assert len(figures) == 3
