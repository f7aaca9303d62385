"""One run of a study in a folder at a time, in words; and jobs that end with their run."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from viewbench.common import holding
from viewbench.workflow import _alone, _follow

pytestmark = pytest.mark.skipif(holding.fcntl is None, reason="this system has no flock")
CLAIM = """
import sys
from pathlib import Path
from viewbench.workflow import _alone
with _alone.plainly():
    print("claimed" if _alone.claim(Path("results/mini"), sys.argv) else "looked", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def place(tmp_path):
    (tmp_path / "results" / "mini").mkdir(parents=True)
    return tmp_path


def begin(place: Path, *arguments: str) -> subprocess.Popen:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", CLAIM, *arguments], cwd=place, **pipes)


def run(place: Path, *arguments: str) -> tuple[int, str, str]:
    process = begin(place, *arguments)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def holder(place: Path) -> subprocess.Popen:
    process = begin(place)
    assert process.stdout is not None
    assert process.stdout.readline() == "claimed\n"
    return process


def test_a_second_run_is_refused_in_one_sentence_until_the_first_is_gone(place):
    first = holder(place)
    status, out, err = run(place)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"'results/mini' is being run already, by process {first.pid} on " in err
    status, _, err = run(place, "--unlock")
    assert status == 2, "a run that lives is not unlocked"
    assert run(place, "--summary")[:2] == (0, "looked\n")
    first.kill()
    first.communicate(timeout=60)
    assert json.loads((place / "results" / "mini" / _alone.FILE).read_text())["pid"] == first.pid
    assert run(place)[:2] == (0, "claimed\n")
    assert (place / "results" / "mini" / _alone.FILE).read_text() == ""


def test_another_study_in_the_folder_runs_beside_it(place):
    first = holder(place)
    command = [sys.executable, "-c", CLAIM.replace("mini", "other")]
    other = subprocess.run(command, cwd=place, input="", capture_output=True, text=True, timeout=60)
    assert (other.returncode, other.stdout) == (0, "claimed\n")
    first.communicate(timeout=60)


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"host": "node7", "boot": "x"}, 2),
        ({"boot": "before"}, 0),
        ({"host": "a container"}, 0),
        ({}, 0),
    ],
)
def test_what_was_left_behind(place, changes, status):
    """By a process of another machine, of this one before it was started anew, of a container, of this one."""
    (place / "results" / "mini" / _alone.FILE).write_text(json.dumps({**holding.me(), "pid": 2**22 + 1, **changes}))
    found, _, err = run(place)
    assert found == status, err
    if status:
        assert err.count("\n") == 1
        assert "on node7" in err
        assert "--unlock" in err
        assert run(place, "--unlock")[:2] == (0, "claimed\n")
        assert run(place)[:2] == (0, "claimed\n")


def test_a_record_that_was_cut_short_holds_nobody_up(place):
    (place / "results" / "mini" / _alone.FILE).write_text('{"pid": 17, "ho')
    assert run(place)[:2] == (0, "claimed\n")


def test_locks_of_snakemake_go_where_no_run_can_have_made_them(place):
    locks = place / ".snakemake" / "locks"
    locks.mkdir(parents=True)
    for name, text in {
        "0.output": "results/mini/a.json\n",
        "0.input": "x\nresults/mini/b.json\n",
        "1.output": "results/mini2/a\n",
    }.items():
        (locks / f"{name}.lock").write_text(text)
    first = holder(place)
    assert [path.name for path in locks.iterdir()] == ["1.output.lock"]
    (locks / "0.output.lock").write_text("results/mini/a.json\n")
    assert run(place)[0] == 2
    assert (locks / "0.output.lock").is_file(), "that of the run that lives"
    first.communicate(timeout=60)


FOLLOWS = """
import time
from viewbench.workflow import _follow
import signal
def stop(*_):
    raise KeyboardInterrupt
signal.signal(signal.SIGTERM, stop)
try:
    _follow.follow()
    print("follows", flush=True)
    time.sleep({seconds})
    print("ended by itself", flush=True)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="processes are watched on Linux alone")
def test_a_job_ends_with_its_run():
    run = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE)
    name = f"{run.pid} {holding.began(run.pid)} {_follow._namespace()}"

    def job(name: str, seconds: float) -> subprocess.Popen:
        command = [sys.executable, "-c", FOLLOWS.format(seconds=seconds)]
        environment = {**os.environ, _follow.RUN: name}
        return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)

    follows = job(name, 600)
    assert follows.stdout is not None
    assert follows.stdout.readline() == "follows\n"
    other = job(name.replace("pid:", "another:"), 0.1)
    assert other.communicate(timeout=60)[0] == "follows\nended by itself\n", "the number is of another namespace"
    run.send_signal(signal.SIGKILL)
    run.wait(60)
    assert follows.communicate(timeout=60)[0] == "stopped\n"
    assert job(name, 600).communicate(timeout=60)[0] == "stopped\n", "it comes when its run has gone"
