import getpass
import json
import shutil
from datetime import datetime

import pytest

from tests.conftest import known
from tests.reports.fixtures import make_study
from tests.reports.test_tracking import about, history
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE, Tracking
from viewbench.reports import _page, _run, _study, _tracking, _tracking_import, recorded
from viewbench.reports._study import FULL

QUICK = PACKAGE / "reports" / "recorded" / "quick"


@pytest.fixture
def tracking(tmp_path):
    return Tracking(uri=f"sqlite:///{tmp_path}/mlflow.db", artifacts=str(tmp_path / "artifacts"))


def bring(folder, tracking, name=None):
    return _tracking_import.bring(folder, name, tracking, lambda done, total, text: None, lambda text: None)


def runs_of(tracking, name, kind):
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=tracking.uri)
    experiment = known(client.get_experiment_by_name(name))
    asked = f"tags.`viewbench.kind` = '{kind}'"
    return client, experiment, client.search_runs([experiment.experiment_id], filter_string=asked, max_results=5000)


def test_a_recording_is_an_experiment_with_its_means(tracking, tmp_path):
    recording = recorded.read(QUICK)
    some = [cell for cell in recording.cells if cell.seed < 2 and cell.scene == "room_human"]
    small = tmp_path / "small"
    small.mkdir()
    shutil.copy(QUICK / "about.json", small)
    rows = (QUICK / "results.csv").read_text().splitlines(keepends=True)
    wanted = [row for row in rows[1:] if ",room_human," in row and row.split(",")[6] in ("0", "1")]
    (small / "results.csv").write_text("".join([rows[0], *wanted]))
    done = bring(small, tracking)
    assert done["logged"] == len(some) == len(wanted)
    client, experiment, cells = runs_of(tracking, "small, recorded", "cell")
    assert len(cells) == len(some)
    title = json.loads((small / "about.json").read_text())["title"]
    assert title in experiment.tags["mlflow.note.content"]
    assert experiment.tags["mlflow.experimentKind"] == "custom_model_development"
    _, _, summaries = runs_of(tracking, "small, recorded", "summary")
    for run in summaries:
        scene, selector, backend = (run.data.params[key] for key in ("scene", "selector", "backend"))
        for step, value in history(client, run, "psnr_db"):
            here = [
                cell.psnr_db
                for cell in some
                if (cell.scene, cell.selector, cell.backend) == (scene, selector, backend)
                and round(100 * cell.ratio) == step
            ]
            assert value == pytest.approx(sum(map(known, here)) / len(here))
    assert any(run.data.params["selector"] == FULL for run in summaries)
    # of when it was made, and by nobody here
    made = 1000 * datetime.fromisoformat(json.loads((QUICK / "about.json").read_text())["date"]).timestamp()
    assert {run.info.end_time for run in cells} == {round(made)}
    assert all(run.data.tags.get("mlflow.user") != getpass.getuser() for run in cells)
    # once more, and after somebody has touched the files: nothing is new
    (small / "results.csv").touch()
    assert bring(small, tracking)["kept"] == len(some)
    # under another name it is another experiment
    assert bring(small, tracking, "quick")["logged"] == len(some)


def test_all_recordings_that_ship_can_be_read_for_it(tracking):
    for folder in sorted(path.parent for path in QUICK.parent.glob("*/about.json")):
        cells = {_tracking_import.cell_name(_tracking_import._axes(cell)): cell for cell in recorded.read(folder).cells}
        told = about("x", [_tracking_import._axes(cell) for cell in cells.values()])
        source = _tracking_import.TableCells(told, cells, 10**12)
        for cell in cells.values():
            run = source.content(_tracking_import._axes(cell), {}, folder)
            assert {name: value for name, value, _, _ in run.metrics}["psnr_db"] == cell.psnr_db
            assert run.started_ms <= run.ended_ms


def test_a_study_of_another_machine_is_logged_with_its_files(tracking, tmp_path):
    study = make_study(tmp_path, scenes=("room_human",), selectors=("uniform", "maxmin"), ratios=(0.1,), seeds=(0, 1))
    done = bring(study, tracking)
    client, _, cells = runs_of(tracking, "fake, imported", "cell")
    assert done["logged"] == len(cells) == 5
    for run in cells:
        files = {item.path for item in client.list_artifacts(run.info.run_id)}
        assert {"selection.json", "train.json", "metrics.json", "cameras.png", "renders"} <= files
    assert bring(study, tracking)["kept"] == 5
    # with its page, once that has been drawn
    _run.run(study, "psnr-over-ratio")
    _run.run(study, "table-psnr")
    _run.page(study)
    assert "run" in bring(study, tracking)
    _, experiment, (report,) = runs_of(tracking, "fake, imported", "report")
    assert report.info.run_id in experiment.tags["mlflow.note.content"].partition("\n")[0]
    assert _page.verdict(_study.load(study))[0] in experiment.tags["mlflow.note.content"]


def test_a_folder_that_is_neither_is_named(tracking, tmp_path):
    with pytest.raises(UserError, match=r"neither about\.json nor study\.json"):
        bring(tmp_path, tracking)
    for name in ("../../evil", "", " x", "/tmp/evil"):
        with pytest.raises(UserError, match="no name of an experiment"):
            bring(QUICK, tracking, name or "..")
    with pytest.raises(UserError, match="nothing to log to"):
        bring(QUICK, Tracking(uri=""))
    (tmp_path / "about.json").write_text("{}")
    with pytest.raises(UserError, match="lacks or garbles 'title'"):
        bring(tmp_path, tracking)


def test_track_names_what_it_wants(run_viewbench, tmp_path):
    failed = run_viewbench("track", cwd=tmp_path)
    assert failed.returncode == 2
    assert "name a study, or a folder with --import" in failed.stderr
    failed = run_viewbench("track", "tiny", cwd=tmp_path)
    assert "run the study first" in failed.stderr
    assert list(tmp_path.iterdir()) == []
    for options in (["tiny"], ["--follow"], ["--only", "page"]):
        failed = run_viewbench("track", "--import", QUICK, *options, cwd=tmp_path)
        assert failed.returncode == 2
        assert "--import does not go with" in failed.stderr
    (tmp_path / "results" / "tiny").mkdir(parents=True)
    assert _tracking.NO_TRACKING in run_viewbench("track", "tiny", cwd=tmp_path, VIEWBENCH_TRACKING_URI="").stdout
