import contextlib
import json
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections import Counter

import pytest

from tests.conftest import known, until
from tests.reports.test_tracking import ROWS, about, counts, describe, history, runs_of, write_cell
from viewbench.common.cells import cell_folder, cell_name
from viewbench.common.settings import Tracking
from viewbench.common.settings import load as load_settings
from viewbench.reports import _tracked_link, _tracking, _tracking_follow, _tracking_turn
from viewbench.reports._tracking_follow import LOOK_S, SETTLE_S, Follower
from viewbench.workflow import _study


class Clock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def study(tmp_path):
    """results/STUDY with the description of its scene, settings, and a clock."""
    results = tmp_path / "results" / "demo"
    describe(results)
    tracking = Tracking(uri=f"sqlite:///{tmp_path}/mlflow.db", artifacts=str(tmp_path / "artifacts"), renders=1)
    return results, tracking, Clock()


def follower(study, stale=(), say=lambda text: None):
    results, tracking, clock = study
    return Follower(about(), ROWS, results, tracking, stale, say, clock=clock)


def looks(one, clock):
    """What a process does that looks twice."""
    one.due()
    clock.now += SETTLE_S
    due = one.due()
    if due and clock.now >= one.again:
        one.log(due)
    return due


def test_a_cell_is_logged_within_half_a_minute_and_a_study_of_seconds_is_left_to_its_end(study):
    results, _, clock = study
    one = follower(study)
    assert one.due() == []
    write_cell(results, ROWS[1])
    assert one.due() == []
    clock.now += SETTLE_S - 0.1
    assert one.due() == []
    clock.now += 0.1
    assert one.due() == [cell_name(ROWS[1])]
    assert LOOK_S + SETTLE_S + LOOK_S <= 20  # and MLflow is imported for the first one


def test_what_it_logs_is_what_the_end_of_the_study_logs(study):
    results, tracking, clock = study
    one = follower(study)
    for number, row in enumerate(ROWS):
        write_cell(results, row, psnr_db=20.0 + number)
        assert looks(one, clock) == [cell_name(row)]
        assert looks(one, clock) == []
        client, summaries = runs_of(tracking, "summary")
        points = {run.data.params["selector"]: history(client, run, "psnr_db") for run in summaries}
        # a ratio is drawn when all its seeds are there
        assert (
            points
            == [
                {"random": []},
                {"random": [(10, 20.5)]},
                {"random": [(10, 20.5)], "maxmin": []},
                {"random": [(10, 20.5)], "maxmin": [(10, 22.5)]},
            ][number]
        )
    before = {run.info.run_id for run in runs_of(tracking, "")[1]}
    assert counts(_tracking.track(about(), ROWS, results, tracking)) == {"logged": 0, "kept": 4}
    assert {run.info.run_id for run in runs_of(tracking, "")[1]} == before
    told = json.loads((results / "logs" / "track" / "follow.json").read_text())
    assert told["cells"] == 4
    # from which the dashboard knows where the figure is while the study runs
    assert list(_tracked_link.figures(results.parent, tracking.uri)) == ["demo"]
    assert _tracked_link.figures(results.parent, "sqlite:///another.db") == {}
    assert told["store"] == tracking.uri


def test_a_cell_that_is_scored_again_is_logged_again(study):
    results, tracking, clock = study
    one = follower(study)
    for row in ROWS[:2]:
        write_cell(results, row)
    looks(one, clock)
    write_cell(results, ROWS[0], psnr_db=30.0)
    assert looks(one, clock) == [cell_name(ROWS[0])]
    client, (summary,) = runs_of(tracking, "summary")
    assert history(client, summary, "psnr_db") == [(10, 25.0)]
    assert len(runs_of(tracking)[1]) == 2


def test_a_score_that_the_run_makes_anew_is_not_logged(study):
    results, tracking, clock = study
    for row in ROWS[:2]:
        write_cell(results, row)
    one = follower(study, stale=[cell_name(ROWS[0]), "no/such/cell"])
    assert looks(one, clock) == [cell_name(ROWS[1])]
    client, (summary,) = runs_of(tracking, "summary")
    assert history(client, summary, "psnr_db") == []
    write_cell(results, ROWS[0], psnr_db=30.0)
    assert looks(one, clock) == [cell_name(ROWS[0])]
    client, (summary,) = runs_of(tracking, "summary")
    assert history(client, summary, "psnr_db") == [(10, 25.0)]


def test_a_cell_that_is_being_made_anew_waits_for_its_score(study):
    results, tracking, clock = study
    train = write_cell(results, ROWS[0]) / "train.json"
    train.write_text(json.dumps({**json.loads(train.read_text()), "seconds": 9.0}))
    one = follower(study)
    looks(one, clock)
    assert runs_of(tracking, "")[1] == []
    write_cell(results, ROWS[0], psnr_db=21.0)
    looks(one, clock)
    assert len(runs_of(tracking)[1]) == 1


def test_nothing_is_logged_of_a_scene_that_is_not_described(study):
    results, _, clock = study
    (results / "scenes" / "room.json").unlink()
    write_cell(results, ROWS[0])
    assert looks(follower(study), clock) == []


def test_a_locked_database_is_tried_again_and_said_once(study, monkeypatch):
    results, tracking, clock = study
    monkeypatch.setattr(_tracking_follow, "WAIT_S", 0.2)
    said = []
    one = follower(study, say=said.append)
    write_cell(results, ROWS[0])
    looks(one, clock)
    write_cell(results, ROWS[1])
    path = tracking.uri.removeprefix("sqlite:///")
    one.tracked = None  # as after any trouble: the file is looked at
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        looks(one, clock)
        assert looks(one, clock) == [cell_name(ROWS[1])]  # but it is not asked yet
        clock.now += _tracking_follow.AWAY_S
        looks(one, clock)
        other.rollback()
    assert len(said) == 1
    assert "is locked" in said[0]
    clock.now += _tracking_follow.AWAY_S
    looks(one, clock)
    assert len(runs_of(tracking)[1]) == 2


def test_another_that_logs_the_study_is_not_waited_for(study):
    results, tracking, clock = study
    write_cell(results, ROWS[0])
    said = []
    one = follower(study, say=said.append)
    with _tracking_turn.turn(tracking, "demo", results, "another"):
        looks(one, clock)
    assert said == []
    clock.now += _tracking_follow.AWAY_S
    looks(one, clock)
    assert len(runs_of(tracking)[1]) == 1


def test_what_others_have_logged_meanwhile_is_not_logged_again(study):
    """As the end of the study does with its last cells, which this process was about to log."""
    results, tracking, clock = study
    one, other = follower(study), follower(study)
    write_cell(results, ROWS[0])
    looks(one, clock)
    for row in ROWS[1:]:
        write_cell(results, row)
    one.due()
    with _tracking_turn.turn(tracking, "demo", results, "the end of the study"):
        _tracking.track(about(), ROWS, results, tracking)
    clock.now += SETTLE_S
    one.log(one.due())
    looks(other, clock)
    assert sorted(run.data.tags[_tracking.CELL] for run in runs_of(tracking)[1]) == sorted(map(cell_name, ROWS))
    assert len(runs_of(tracking, "summary")[1]) == 2
    assert counts(_tracking.track(about(), ROWS, results, tracking)) == {"logged": 0, "kept": 4}


def test_many_cells_take_turns(study):
    results, tracking, clock = study
    rows = [{**ROWS[0], "seed": str(seed)} for seed in range(_tracking_follow.AT_ONCE + 2)]
    for row in rows:
        write_cell(results, row)
    one = Follower(about(rows=rows), rows, results, tracking, clock=clock)
    one.due()
    clock.now += SETTLE_S
    for count in (_tracking_follow.AT_ONCE, len(rows)):
        one.go_on(_once())
        assert len(runs_of(tracking)[1]) == count


def _once():
    """Stops after one look, and not in the middle of it."""
    waits = iter([False, True])
    return lambda wait_s: next(waits) if wait_s else False


STUDY = """title: A study to follow
scenes: [room_human]
selectors: [uniform, random]
ratios: [0.05, 0.1]
seeds: [0, 1]
backends: [{name: splat, backend: splat, budget: {iterations: 20}}]
width: 48
reference: false
"""
# `viewbench`, which looks every moment and gives way to nobody.
HURRIED = """
import sys
from viewbench.reports import _tracking_follow
from viewbench.workflow import _tracker
_tracker.give_way = lambda: None
_tracking_follow.LOOK_S, _tracking_follow.SETTLE_S, _tracking_follow.AWAY_S = 0.05, 0.0, 0.2
from viewbench.__main__ import main
sys.argv = ["viewbench", *sys.argv[1:]]
sys.exit(main())
"""


def environment_of(folder, uri):
    where = {"VIEWBENCH_TRACKING_URI": uri, "VIEWBENCH_TRACKING_ARTIFACTS": str(folder / "artifacts")}
    return {**os.environ, **where}


class Process:
    """The process that follows a run, and the run's end of what it hears."""

    def __init__(self, folder, uri):
        environment = {
            **os.environ,
            "VIEWBENCH_TRACKING_URI": uri,
            "VIEWBENCH_TRACKING_ARTIFACTS": str(folder / "artifacts"),
        }
        command = [sys.executable, "-c", HURRIED, "track", str(folder / "demo.yaml"), "--follow", "--of-run"]
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        known(self.process.stdin).write("[]\n")
        known(self.process.stdin).flush()

    def end(self):
        """Closes its standard input, as the end of a run does, also of one that is killed."""
        began = time.monotonic()
        _, said = self.process.communicate(timeout=60)
        assert "Traceback" not in said
        return time.monotonic() - began, said


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "demo.yaml").write_text(STUDY)
    describe(tmp_path / "results" / "demo", "room_human")
    return tmp_path


def cells_of(folder):
    return _study.load(str(folder / "demo.yaml"), load_settings()).cells()


def names_of(tracking):
    return Counter(run.data.tags[_tracking.CELL] for run in runs_of(tracking)[1])


def test_one_run_a_cell_however_often_the_process_is_killed(folder):
    cells, chance = cells_of(folder), random.Random(3)
    uri = f"sqlite:///{folder}/mlflow.db"
    results, tracking = folder / "results" / "demo", Tracking(uri=uri)
    for cell in cells[:2]:
        write_cell(results, cell)
    first = Process(folder, uri)
    until((results / "logs" / "track" / "follow.json").exists)
    assert len(names_of(tracking)) == 2
    seconds, said = first.end()
    assert said == ""
    assert seconds < 30
    for kill, cell in enumerate(cells[2:], start=1):
        one = Process(folder, uri)
        write_cell(results, cell)
        if kill % 2:  # at its start, or in the middle of logging
            until((folder / ".mlflow.db.writers" / "demo" / ".writer").exists)
        time.sleep(chance.uniform(0, 0.4))
        one.process.send_signal(signal.SIGKILL)
        one.process.communicate()
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-m", "viewbench", "track", "demo.yaml"],
            cwd=folder,
            env={
                **os.environ,
                "VIEWBENCH_TRACKING_URI": uri,
                "VIEWBENCH_TRACKING_ARTIFACTS": str(folder / "artifacts"),
            },
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("0 logged, 8 kept\nFigure 4 in MLflow: http://127.0.0.1:5000/#/experiments/")
    assert names_of(tracking) == Counter(map(cell_name, cells))
    client, summaries = runs_of(tracking, "summary")
    assert len(summaries) == 2
    for run in summaries:
        assert history(client, run, "psnr_db") == [(5, 20.0), (10, 20.0)]
    assert {run.info.status for run in runs_of(tracking, "")[1]} == {"FINISHED"}


def test_it_ends_with_its_run_while_a_server_does_not_answer(folder):
    cell = cells_of(folder)[0]
    write_cell(folder / "results" / "demo", cell)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        one = Process(folder, f"http://127.0.0.1:{silent.getsockname()[1]}")
        silent.settimeout(60)
        connection, _ = silent.accept()
        with connection:
            seconds, _ = one.end()
    assert seconds < 30  # five, where nothing else runs; MLflow's own patience is a minute
    assert one.process.returncode == 0
    assert cell_folder(folder / "results" / "demo", cell).is_dir()
