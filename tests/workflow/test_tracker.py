"""The process that logs a run's cells while the run goes on."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import known, until
from tests.reports.test_tracking import ROWS, about, describe, write_cell
from viewbench.common.settings import Tracking
from viewbench.reports import _tracked_link, _tracking
from viewbench.workflow import _tracker

STUDY = """scenes: [room_human]
selectors: [uniform]
ratios: [0.05]
seeds: [0]
backends: [{name: splat, backend: splat, budget: {iterations: 20}}]
reference: false
"""
# A run as far as the tracker knows it, which says the number of the process that it has begun.
RUN = """
import signal
import sys
from pathlib import Path
from viewbench.workflow import _tracker

signal.signal(signal.SIGINT, signal.default_int_handler)  # which is ignored in what a script runs in the background

class Job:
    def __init__(self, rule, **axes):
        self.rule = type("Rule", (), {"name": rule})
        self.wildcards_dict = axes

class Workflow:
    is_main_process = True
    class dag:
        @staticmethod
        def needrun_jobs():
            axes = dict(backend="splat", scene="room_human", selector="uniform", ratio="0.05", seed="0")
            return [Job("evaluate", **axes), Job("describe", scene="room_human")]

assert _tracker._stale(Workflow()) == ["splat/room_human/uniform/0.05/0"]
assert _tracker._stale(object()) == []
_tracker.start(Workflow(), "demo.yaml", Path("results/demo"), sys.argv[1])
print("begun", flush=True)
sys.stdin.readline()
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "demo.yaml").write_text(STUDY)
    describe(tmp_path / "results" / "demo")
    return tmp_path


def begin(folder, uri):
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, uri],
        cwd=folder,
        env={**os.environ, "VIEWBENCH_TRACKING_URI": uri},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert known(run.stdout).readline() == "begun\n"
    return run


def followers(folder):
    """Numbers of the processes that follow a run in this folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if b"--follow" in (process / "cmdline").read_bytes() and (process / "cwd").readlink() == folder:
                found.append(int(process.name))
        except OSError:
            continue
    return found


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="this system has no /proc")
@pytest.mark.parametrize("how", ["it ends", "it is killed", "Ctrl-C"])
def test_it_ends_with_its_run(folder, how):
    run = begin(folder, f"sqlite:///{folder}/mlflow.db")
    until(lambda: len(followers(folder)) == 1)
    if how == "Ctrl-C":
        os.killpg(run.pid, signal.SIGINT)  # which is not for the tracker: it hears of the end
    if how == "it is killed":
        run.kill()
    if how == "it ends":
        known(run.stdin).write("\n")
        known(run.stdin).flush()
    run.wait(60)
    until(lambda: followers(folder) == [])
    said = (folder / "results" / "demo" / "logs" / "track" / "follow.log").read_text()
    assert said == ""


def test_nothing_is_begun_where_nothing_is_logged(folder):
    run = begin(folder, "")
    assert followers(folder) == []
    run.communicate("\n")
    assert not (folder / "results" / "demo" / "logs").exists()


def test_a_run_says_where_its_figure_is(tmp_path, capsys):
    results = tmp_path / "results" / "demo"
    results.mkdir(parents=True)
    database, server = f"sqlite:///{tmp_path}/a.db", "https://ann:secret@example.org/mlflow/"
    for uri in ("", database, server):
        _tracker.say_where(str(results), uri)
    assert capsys.readouterr().err == ""
    write_cell(results, ROWS[0])
    done = _tracking.track(about(), ROWS[:1], results, Tracking(uri=database, artifacts=str(tmp_path / "artifacts")))
    _tracker.say_where(str(results), database)
    assert (
        f"dashboard` runs): http://127.0.0.1:5000/#/experiments/{done['experiment']}/runs?" in capsys.readouterr().err
    )
    # of a server what was said when the study was logged to it, and to none other
    (results / "tracked.json").write_text(json.dumps({"experiment": "7", "store": _tracked_link.store(server)}))
    _tracker.say_where(str(results), "https://other.org")
    assert capsys.readouterr().err == ""
    _tracker.say_where(str(results), server)
    said = capsys.readouterr().err
    assert "in MLflow: https://example.org/mlflow/#/experiments/7/runs?" in said
    assert "secret" not in said + (results / "tracked.json").read_text()


def test_the_dashboard_says_what_is_missing(run_viewbench, tmp_path):
    def says(*arguments, **variables):
        done = run_viewbench("dashboard", *arguments, cwd=tmp_path, **variables)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
        return done.stderr

    assert "run a study first" in says(VIEWBENCH_TRACKING_URI="sqlite:///results/mlflow.db")
    assert "tracking.uri is empty" in says(VIEWBENCH_TRACKING_URI="")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "mlflow.db").touch()
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert f"port {port} is taken" in says("--port", port, VIEWBENCH_TRACKING_URI="sqlite:///results/mlflow.db")
    assert "no study 'nosuch'" in says("nosuch", "--links", VIEWBENCH_TRACKING_URI="sqlite:///results/mlflow.db")


def test_the_dashboard_serves_what_was_logged(tmp_path):
    import urllib.request

    from viewbench.backends._command_line import free_port

    results = tmp_path / "results" / "demo"
    write_cell(results, ROWS[0])
    uri = f"sqlite:///{tmp_path}/results/mlflow.db"
    done = _tracking.track(about(), ROWS[:1], results, Tracking(uri=uri, artifacts=str(tmp_path / "artifacts")))
    port = free_port()
    with open(tmp_path / "said.txt", "wb") as said:
        served = subprocess.Popen(
            [sys.executable, "-m", "viewbench", "dashboard", "--port", str(port)],
            cwd=tmp_path,
            env={**os.environ, "VIEWBENCH_TRACKING_URI": "sqlite:///results/mlflow.db"},
            stdout=said,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    address = f"http://127.0.0.1:{port}"

    def answers():
        assert served.poll() is None, (tmp_path / "said.txt").read_text()
        try:
            with urllib.request.urlopen(f"{address}/health", timeout=5):
                return True
        except OSError:
            return False

    try:
        until(answers)
        named = f"{address}/api/2.0/mlflow/experiments/get-by-name?experiment_name=demo"
        with urllib.request.urlopen(named, timeout=30) as answer:
            assert json.load(answer)["experiment"]["experiment_id"] == done["experiment"]
    finally:
        os.killpg(served.pid, signal.SIGKILL)
        served.wait()
    assert (
        f"Figure 4 of demo in MLflow: {address}/#/experiments/{done['experiment']}/runs?"
        in (tmp_path / "said.txt").read_text()
    )
