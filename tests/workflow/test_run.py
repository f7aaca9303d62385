"""`viewbench run`: what it asks of snakemake, and which settings and paths hold in another folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOM
from tests.workflow.clones import take_frames
from viewbench.common import settings as settings_file
from viewbench.common.settings import PACKAGE
from viewbench.workflow.commands import run

STUDY = """
scenes: [mine]
selectors: [uniform]
ratios: [0.5]
seeds: 1
backends: [splat]
budget: {iterations: 1}
encoder: none
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder to stand in, with nothing set."""
    for name in [name for name in os.environ if name.startswith("VIEWBENCH_") or name.endswith("_NUM_THREADS")]:
        monkeypatch.delenv(name)
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def test_the_command_line():
    command = run.arguments("quick", Path("lab"), None, ("--dry-run", "--resources", "gpu=1"))
    assert command[:3] == [sys.executable, "-m", "snakemake"]
    assert command[3:5] == ["--snakefile", str(PACKAGE / "Snakefile")]
    rest = '--directory lab --cores all --dry-run --resources gpu=1 --config study="quick"'
    assert command[-9:] == rest.split()
    command = run.arguments("quick", Path("lab"), None, ("--config", "other=1", "--dry-run"))
    assert command[-4:] == ["--config", 'study="quick"', "other=1", "--dry-run"], "the last --config is the only one"
    assert "--cores 3" in " ".join(run.arguments("quick", Path(), 3))


def test_a_study_file_is_found_from_where_one_stands(here):
    assert f'study="{here / "mine.yaml"}"' in run.arguments("mine.yaml", Path("lab"), None)


def test_jobs_get_these_settings_and_this_viewbench(here, monkeypatch):
    shipped = run.environment(settings_file.load())
    assert shipped["VIEWBENCH_ENVIRONMENT"] == str(PACKAGE / "environment.toml")
    assert shipped["PATH"].split(os.pathsep)[0] == str(Path(sys.executable).parent)
    assert {shipped[name] for name in run.THREADS} == {"1"}
    assert "VIEWBENCH_DATA" not in shipped
    (here / "environment.toml").write_text("[compute]\nthreads = 3\n", encoding="utf-8")
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    mine = run.environment(settings_file.load())
    assert mine["VIEWBENCH_ENVIRONMENT"] == str(here / "environment.toml")
    assert (mine["OMP_NUM_THREADS"], mine["NUMBA_NUM_THREADS"]) == ("2", "3")


def test_what_is_read_counts_from_where_one_stands_and_what_is_written_does_not(here):
    (here / "captures").mkdir()
    (here / "alex.pth").touch()
    text = '[data]\nroot = "captures"\n[metrics]\nlpips_weights = "alex.pth"\n'
    text += '[instant_ngp]\npath = "/opt/ngp"\npython = "python3"\n[tracking]\nuri = "sqlite:///results/a.db"\n'
    (here / "environment.toml").write_text(text, encoding="utf-8")
    found = run.environment(settings_file.load())
    assert found["VIEWBENCH_DATA"] == str(here / "captures")
    assert found["VIEWBENCH_METRICS_LPIPS_WEIGHTS"] == str(here / "alex.pth")
    assert not {"VIEWBENCH_INSTANT_NGP_PATH", "VIEWBENCH_INSTANT_NGP_PYTHON", "VIEWBENCH_TRACKING_URI"} & set(found)


@pytest.fixture
def lab(here):
    """A capture and its study where one stands."""
    take_frames(ROOM, here / "captures" / "mine", 8)
    (here / "environment.toml").write_text(
        '[data]\nroot = "captures"\n[scenes.mine]\npath = "mine"\nholdout = "every:4"\n', encoding="utf-8"
    )
    (here / "mine.yaml").write_text(STUDY, encoding="utf-8")
    return here


def call(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "viewbench", "run", *arguments]
    return subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=300)


def test_a_study_of_ones_own_is_planned_in_another_folder(lab):
    done = call("mine.yaml", "--out", "lab", "--", "--dry-run")
    assert done.returncode == 0, done.stderr
    assert "reports/index.html" in done.stdout + done.stderr
    assert (lab / "lab" / "results" / "mine" / "depends").is_dir()
    assert not (lab / "results").exists()


def test_the_status_of_snakemake_is_passed_on(lab):
    done = call("mine.yaml", "--out", "lab", "--", "no_such_target")
    assert done.returncode == 1
    assert "MissingRuleException" in done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["quik"], "did you mean 'quick'"), (["none.yaml"], "unknown study"), (["quick", "-j0"], "x>=1")],
)
def test_a_mistake_is_one_line(here, arguments, words):
    done = call(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert list(here.iterdir()) == []
