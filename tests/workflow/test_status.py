"""`viewbench status`: while a study runs, when it was killed, when cells have failed, and when all are done."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.conftest import ROOM, until
from tests.workflow.clones import Clone, take_frames
from viewbench.common import settings as settings_file
from viewbench.workflow import _pace, _progress_file, _standing, _study

STUDY = """
scenes: [walk]
selectors: [uniform, maxmin]
ratios: [0.2, 0.4]
seeds: [0]
backends:
  - {backend: splat, budget: {iterations: 4}}
  - {backend: command:moody, budget: {iterations: 4}, grid: {ratios: [0.2]}}
width: 48
reference: false
encoder: none
reports: [psnr_over_ratio]
"""
# Fails while there is a file that says so, and takes its time while there is another.
MOODY = """
import sys, time
from pathlib import Path
out, place = Path(sys.argv[1]), Path(sys.argv[2])
if sys.argv[3] == "train":
    (place / "training").touch()
    while (place / "slow").exists():
        time.sleep(0.1)
    if (place / "cross").exists():
        sys.exit("not today")
    (out / "model").write_text("good")
else:
    from PIL import Image
    for path in sorted((Path(sys.argv[3]) / "images").iterdir()):
        Image.open(path).save(Path(sys.argv[4]) / path.name)
"""
ENVIRONMENT = """
[scenes.walk]
path = {walk!r}
holdout = "every:4"
[tracking]
uri = ""
[command.moody]
train = [{python!r}, {moody!r}, "{{out}}", {place!r}, "train", "{{iterations}}"]
render = [{python!r}, {moody!r}, "{{out}}", {place!r}, "{{cameras}}", "{{renders}}"]
version = ["true"]
"""


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    parent = tmp_path_factory.mktemp("status")
    clone = Clone(parent, STUDY)
    (parent / "moody.py").write_text(MOODY, encoding="utf-8")
    places = {
        "walk": str(take_frames(ROOM, parent / "data" / "walk", 20)),
        "python": sys.executable,
        "moody": str(parent / "moody.py"),
        "place": str(parent),
    }
    (clone.folder / "environment.toml").write_text(ENVIRONMENT.format(**places), encoding="utf-8")
    return clone


def status(clone: Clone) -> tuple[int, dict]:
    done = clone.call("viewbench", "status", "mini", "--json")
    assert not done.stderr, done.stderr
    return done.returncode, json.loads(done.stdout)


def running(clone: Clone) -> list[dict]:
    return [cell for cell in status(clone)[1]["cells"] if cell["state"] == "running"]


def said(clone: Clone) -> str:
    return clone.call("viewbench", "status", "mini").stdout


def test_the_life_of_a_study(clone):
    """Before, while it runs, killed, failed, and done."""
    place = clone.folder.parent
    code, found = status(clone)
    assert (code, found["counts"]["to come"], found["run"]) == (3, 6, None)
    assert said(clone).startswith("mini: 0 of 6 cells done, 6 to come\nnothing runs; ")

    for name in ("slow", "cross"):
        (place / name).touch()
    run = clone.begin()
    try:
        until(lambda: any(cell["cell"].startswith("command-moody/") for cell in running(clone)))
        code, found = status(clone)
        assert (code, found["run"]["alive"], found["run"]["pid"]) == (3, True, run.pid)
        text = said(clone)
        assert f"(process {run.pid} on {socket.gethostname()}): " in text
        assert "running: " in text
    finally:
        os.killpg(run.pid, 9)
        run.wait()
    code, found = status(clone)
    assert (code, found["run"]["alive"], found["counts"]["running"]) == (3, False, 0)
    assert "the last run was killed" in said(clone)
    assert "; the same command goes on from here: snakemake -j2 --config study=mini -- reports\n" in said(clone)
    elsewhere = clone.call("viewbench", "status", "mini", "--results", str(place))
    assert f"there is no '{place / 'mini'}' here" in elsewhere.stdout
    assert sum(found["counts"].values()) == 6

    run = clone.begin()
    try:
        # Both jobs at once wait in the trainer, so that none is stopped while it still begins.
        until(lambda: [cell["cell"].split("/")[0] for cell in running(clone)] == 2 * ["command-moody"])
    finally:
        os.killpg(run.pid, signal.SIGINT)
        run.wait()
    code, found = status(clone)
    assert (code, found["counts"]["failed"], found["run"]["ended"]) == (3, 0, "stopped"), found
    assert "the last run was stopped" in said(clone)

    (place / "slow").unlink()
    assert clone.snakemake().returncode != 0
    code, found = status(clone)
    assert (code, found["counts"]) == (1, {"done": 4, "running": 0, "failed": 2, "stale": 0, "to come": 0})
    lost = [cell for cell in found["cells"] if cell["state"] == "failed"]
    assert {cell["cell"] for cell in lost} == {f"command-moody/walk/{name}/0.2/0" for name in ("uniform", "maxmin")}
    assert all("not today" in cell["words"] and Path(clone.folder / cell["log"]).is_file() for cell in lost)
    assert "the last run has failed" in said(clone)

    (place / "cross").unlink()
    clone.run()
    code, found = status(clone)
    assert (code, found["counts"]["done"], found["run"]["ended"]) == (0, 6, "finished")
    assert said(clone) == "mini: 6 of 6 cells done\nthe page: results/mini/reports/index.html\n"

    cell = clone.results / "cells" / "splat" / "walk" / "uniform" / "0.2" / "0"
    for file, words in {"model.ply": "files of the model are", "renders": "renders are"}.items():
        shutil.move(cell / file, place / "aside")
        code, found = status(clone)
        assert (code, found["counts"]["stale"]) == (3, 1)
        assert f"stale: splat/walk/uniform/0.2/0: {words} missing or cut short\n" in said(clone)
        shutil.move(place / "aside", cell / file)
    assert status(clone)[0] == 0

    clone.edit("selectors/uniform.py")
    code, found = status(clone)
    assert (code, found["counts"]["stale"], found["counts"]["done"]) == (3, 3, 3)
    assert "stale: splat/walk/uniform/0.2/0: selection.json was made with another code_sha256\n" in said(clone)


@pytest.fixture
def study(clone, monkeypatch):
    monkeypatch.setenv("VIEWBENCH_ENVIRONMENT", str(clone.folder / "environment.toml"))
    return _study.load(str(clone.folder / "workflow" / "studies" / "mini.yaml"), settings_file.load())


@pytest.mark.parametrize(
    ("rule", "wildcards", "cells"),
    [
        ("describe", {"scene": "walk"}, 6),
        ("describe", {"scene": "other"}, 0),
        ("select", {"scene": "walk", "selector": "uniform", "part": "0.2", "seed": "0"}, 2),
        ("select", {"scene": "walk", "selector": "maxmin", "part": "0.5", "seed": "0"}, 1),
        ("warm", {"trainer": "command-moody"}, 2),
        ("warm_selector", {"plugin": "maxmin"}, 3),
        ("features", {"scene": "walk"}, 0),
        ("report", {"report": "psnr_over_ratio"}, 0),
        ("page", {}, 0),
    ],
)
def test_which_cells_a_failed_job_costs(study, rule, wildcards, cells):
    job = _progress_file.Job(rule, wildcards, 0.0)
    assert sum(job.of(cell, study) for cell in study.cells()) == cells


def test_a_run_is_alive_while_its_process_is(tmp_path):
    pace = _pace.Pace()
    file = _progress_file.RunFile(tmp_path)
    file.write(pace, 12.5, "training", at_once=True)
    run = _progress_file.read(tmp_path)
    assert run is not None
    assert run.alive
    assert not replace(run, started="1").alive, "another process has its number now"
    assert not replace(run, ended="stopped").alive
    ended = subprocess.Popen(["true"])
    ended.wait()
    assert not replace(run, pid=ended.pid).alive


def test_a_run_on_another_machine_is_alive_while_it_is_heard_of(tmp_path):
    file = _progress_file.RunFile(tmp_path)
    file.write(_pace.Pace(), None, "", at_once=True)
    run = _progress_file.read(tmp_path)
    assert run is not None
    for elsewhere in (replace(run, host="node7"), replace(run, boot="an earlier start of this machine")):
        assert elsewhere.alive
        assert not replace(elsewhere, said=run.said - _progress_file.GONE_S - 1).alive


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"running": [1], "failed": []}', "\x00"])
def test_a_damaged_record_is_none(tmp_path, content):
    (tmp_path / _progress_file.FILE).write_text(content, encoding="utf-8")
    assert _progress_file.read(tmp_path) is None


def test_work_that_is_left_is_told_by_cells_of_the_same_backend():
    cells = [
        _standing.Standing("a/s/x/0.1/0", "done", seconds=10.0),
        _standing.Standing("a/s/x/0.1/1", "done", seconds=20.0),
        _standing.Standing("a/s/x/0.1/2", "to come"),
        _standing.Standing("a/s/x/0.1/3", "failed"),
    ]
    assert _standing.work_left(cells) == 30.0
    assert _standing.work_left([*cells, _standing.Standing("b/s/x/0.1/3", "to come")]) is None
    assert _standing.work_left(cells[:2]) is None
