"""A study through Snakemake in a copy of the package that the test may edit: what runs, and what runs again."""

import csv
import fcntl
import json

import pytest

from tests.conftest import ROOM
from tests.workflow.clones import Clone, take_frames

STUDY = """
title: A study of two cells
scenes: [room_human]
selectors: [uniform, maxmin]
ratios: [0.02]
seeds: [0]
backends: [splat]
width: 48
budget: {iterations: 20}
encoder: none
reference: false
reports: [psnr_over_ratio, table_psnr]
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    clone = Clone(tmp_path_factory.mktemp("finished"), STUDY)
    assert clone.planned()["evaluate"] == 2
    shown = clone.run()
    assert "2 of 2 cells" in shown
    return clone


@pytest.fixture
def clone(finished, tmp_path):
    other = finished.copied(tmp_path)
    assert other.planned() == {}
    return other


def cell(clone, selector="maxmin"):
    return clone.results / "cells" / "splat" / "room_human" / selector / "0.02" / "0"


def rows(clone):
    """results.csv by selector."""
    with open(clone.results / "results.csv", newline="", encoding="utf-8") as file:
        return {row["selector"]: row for row in csv.DictReader(file)}


AFTER = {"collect": 1, "track": 1, "report": 2, "page": 1, "publish": 1, "reports": 1}


def test_a_finished_study_is_not_run_again(clone):
    before = {path: path.stat().st_mtime_ns for path in clone.results.rglob("cells/**/*.json")}
    clone.run()
    assert {path: path.stat().st_mtime_ns for path in clone.results.rglob("cells/**/*.json")} == before


def test_a_deleted_score_is_the_only_thing_redone(clone):
    (cell(clone) / "metrics.json").unlink()
    kept = (cell(clone, "uniform") / "metrics.json").stat().st_mtime_ns
    assert clone.planned() == {"evaluate": 1, **AFTER}
    clone.run()
    assert (cell(clone, "uniform") / "metrics.json").stat().st_mtime_ns == kept
    done = clone.call("tests.end_to_end", "results/mini")
    assert done.returncode == 0, done.stderr


def test_a_failed_cell_is_named_and_the_rest_reported(clone):
    broken = clone.folder / "selectors" / "maxmin.py"
    text = broken.read_text(encoding="utf-8")
    broken.write_text(text + "\n\ndef select(views, count, rng, **parameters):\n    raise ValueError('no luck')\n")
    done = clone.snakemake()
    assert done.returncode != 0
    assert "no luck" in done.stderr
    assert {name: row["status"] for name, row in rows(clone).items()} == {
        "uniform": "ok",
        "maxmin": "select: ValueError: no luck",
    }
    broken.write_text(text, encoding="utf-8")
    clone.run()
    assert clone.planned() == {}


def test_what_a_failure_left_behind_is_never_ok(clone):
    """The trainer changed and its kernels do not compile: both cells have all their files, and none counts."""
    clone.edit("backends/splat/raster.py", "def render(", "def renderer(")
    assert clone.snakemake().returncode != 0
    assert (cell(clone) / "metrics.json").is_file()
    for row in rows(clone).values():
        assert (row["psnr_db"], "another code_sha256" in row["status"]) == ("", True), row["status"]


def test_a_file_of_another_cell_is_found(clone):
    wrong = {
        "train.json": "another selection_sha256; delete train.json there",
        "selection.json": "another selector; delete selection.json there",
    }
    for name, words in wrong.items():
        other = clone.copied(clone.folder.parent / name)
        (cell(other) / name).write_bytes((cell(other, "uniform") / name).read_bytes())
        done = other.call("viewbench", "collect", "mini")
        assert (done.returncode, words in done.stderr) == (2, True), done.stderr


def test_a_model_that_was_altered_is_not_scored(clone):
    for name, change in {
        "model.ply": lambda data: data[:-4] + b"\0\0\0\0",
        "splat.json": lambda data: data + b" ",
    }.items():
        path = cell(clone) / name
        before = path.read_bytes()
        path.write_bytes(change(before))
        done = clone.call("viewbench", "evaluate", str(cell(clone)), "room_human", "--out", str(cell(clone)))
        assert done.returncode == 2
        assert f"{name}' is missing or not as training left it; train again" in done.stderr
        path.write_bytes(before)


def test_what_was_damaged_is_made_again(clone):
    """A model that cannot be scored, an edited choice, an edited score: the next run takes each of them up."""
    model = cell(clone) / "model.ply"
    model.write_bytes(model.read_bytes()[:-4])
    (cell(clone) / "metrics.json").unlink()
    clone.run()
    selection = clone.results / "selections" / "room_human" / "maxmin" / "0.25" / "0.json"
    selection.write_text(selection.read_text().replace("train/0000", "train/9999", 1).replace('"seed": 0', '"seed": 1'))
    score = cell(clone, "uniform") / "metrics.json"
    good = score.read_text()
    score.write_text(good.replace('"psnr_db": 1', '"psnr_db": 4', 1))
    clone.run()
    assert json.loads(selection.read_text())["seed"] == 0
    assert json.loads(score.read_text())["psnr_db"] == json.loads(good)["psnr_db"]
    assert clone.planned() == {}


def test_another_test_split_is_refused_by_every_step(tmp_path):
    """A model is never scored on views that it was trained on."""
    walk = take_frames(ROOM, tmp_path / "walk", 12)
    clone = Clone(tmp_path / "clone", STUDY)
    step = {"holdout": "every:4", "select": tmp_path / "s.json", "model": tmp_path / "model"}

    def select(holdout):
        options = ["--selector", "uniform", "--count", "3", "--holdout", holdout, "--selection", str(step["select"])]
        return clone.call("viewbench", "select", str(walk), *options)

    def train(holdout):
        options = ["--selection", str(step["select"]), "--iterations", "2", "--width", "48", "--holdout", holdout]
        return clone.call("viewbench", "train", str(walk), *options, "--out", str(step["model"]))

    def evaluate(holdout):
        out = str(step["model"])
        return clone.call("viewbench", "evaluate", out, str(walk), "--out", out, "--holdout", holdout)

    assert select("every:4").returncode == 0
    refused = train("every:3")
    assert refused.returncode == 2
    assert "holdout 'every:4'" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert train("every:4").returncode == 0
    refused = evaluate("every:3")
    assert refused.returncode == 2
    assert "was trained on scene 'walk' with holdout 'every:4'" in refused.stderr
    assert evaluate("every:4").returncode == 0


def test_a_study_whose_test_split_changes_is_made_anew(tmp_path):
    walk = take_frames(ROOM, tmp_path / "walk", 12)
    clone = Clone(tmp_path / "clone", STUDY.replace("room_human", "walk").replace("0.02", "0.3"))
    settings = f"[scenes.walk]\npath = {str(walk)!r}\nholdout = 'every:4'\n"
    (clone.folder / "environment.toml").write_text(settings, encoding="utf-8")
    clone.run()
    files = [path for path in clone.results.rglob("cells/**/*.json") if not path.name.startswith(".")]
    before = {path: json.loads(path.read_text()) for path in files}
    clone.edit("environment.toml", "every:4", "every:3")
    clone.run()
    for path, old in before.items():
        new = json.loads(path.read_text())
        if path.name != "splat.json":
            assert (old["holdout"], new["holdout"]) == ("every:4", "every:3")
            assert old["scene_sha256"] != new["scene_sha256"]
        if path.name == "metrics.json":
            assert (len(old["views"]), len(new["views"])) == (3, 4)
    assert clone.planned() == {}


def test_two_clones_in_different_folders_have_the_same_numbers(finished, tmp_path):
    other = Clone(tmp_path / "somewhere" / "else", STUDY)
    other.run()
    for selector, row in rows(finished).items():
        same = rows(other)[selector]
        for column in set(row) - {"select_s", "train_s", "evaluate_s", "peak_rss_bytes"}:
            assert row[column] == same[column], column
        for file in ("model.ply", "splat.json"):
            assert (cell(finished, selector) / file).read_bytes() == (cell(other, selector) / file).read_bytes()


def test_a_second_run_in_the_same_folder_is_told_why_it_cannot(clone):
    (cell(clone) / "metrics.json").unlink()
    locks = clone.folder / ".snakemake" / "locks"
    locks.mkdir(parents=True, exist_ok=True)
    wanted = (cell(clone) / "metrics.json").relative_to(clone.folder)
    (locks / "0.output.lock").write_text(f"{wanted}\n", encoding="utf-8")
    with open(clone.results / ".run.json", "r+") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        done = clone.snakemake()
        assert done.returncode == 2
        said = [line for line in done.stderr.splitlines() if line.startswith("viewbench: ")]
        assert len(said) == 1
        assert "is being run already" in said[0]
        assert "Traceback" not in done.stderr
    clone.run()  # what the killed run of a Snakemake left is no lock


def test_an_error_of_snakemake_itself_is_said(clone):
    (cell(clone) / "metrics.json").unlink()
    needed = "depends=WIRING.scoring,"
    clone.edit("workflow/rules/cells.smk", needed, f'{needed}\n        nowhere="nowhere.txt",')
    done = clone.snakemake()
    assert done.returncode != 0
    assert "MissingInputException" in done.stderr
    assert "nowhere.txt" in done.stderr


def test_a_tracking_server_that_is_down_is_named_and_tried_again(clone):
    (cell(clone) / "metrics.json").unlink()
    clone.run(VIEWBENCH_TRACKING_URI="http://127.0.0.1:9", VIEWBENCH_TRACKING_PATIENCE="1")
    assert (cell(clone) / "metrics.json").is_file()
    page = clone.results / "reports" / "index.html"
    assert "not logged: MLflow at" in page.read_text(encoding="utf-8")
    clone.run()
    told = json.loads((clone.results / "tracked.json").read_text())
    assert (told["logged"], told["kept"]) in ((1, 1), (2, 0))
    # the page says where the figure is, which is what the run has said, and is in MLflow itself
    assert told["figure"].replace("&", "&amp;") in page.read_text(encoding="utf-8")
    assert "run" in json.loads((clone.results / "published.json").read_text())
    assert told["figure"] in clone.call("viewbench", "dashboard", "mini", "--links").stdout
    assert "not logged" not in page.read_text(encoding="utf-8")
    assert clone.planned() == {}


def test_without_a_target_everything_is_made(clone):
    (cell(clone) / "metrics.json").unlink()
    done = clone.call("snakemake", "-n", "--config", "study=mini")
    assert "evaluate room_human: maxmin" in done.stdout + done.stderr


def test_a_study_can_be_recorded(clone, tmp_path):
    kept = tmp_path / "kept"
    done = clone.call("viewbench", "record", "results/mini", "--into", str(kept), "--note", "by a test")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (kept / "mini").iterdir()) == [
        "about.json",
        "psnr_over_ratio.png",
        "results.csv",
    ]
    about = json.loads((kept / "mini" / "about.json").read_text(encoding="utf-8"))
    assert about["notes"] == "by a test"
    assert about["machine"]["cpus"] >= 1
    assert about["versions"]["numba"]
    assert about["date"].endswith("+00:00")


def test_a_wrong_study_is_one_sentence(clone):
    done = clone.snakemake(study="mimi")
    assert done.returncode != 0
    assert "did you mean 'mini'" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
