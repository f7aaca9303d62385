"""`viewbench download` as a user meets it, and studies whose scenes are not there yet."""

import functools
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.scenes.download_server import Server
from viewbench.common import catalogue
from viewbench.common.settings import PACKAGE, Settings
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene
from viewbench.workflow.commands import _main
from viewbench.workflow.commands import run as run_command

TEXT = """
[set]
title = "A set"
home = "https://example.org/"
citation = "Somebody, Something"
source = "here"
format = "transforms"
licence = {{ name = "ours", address = "https://example.org/licence", says = "do as you like" }}
archives = {{ all = {{ address = "{address}", about_gb = 0.25 }} }}
[set.scenes]
one = {{ archive = "all", prefix = "one/" }}
two = {{ archive = "all", prefix = "two/" }}

[signed]
title = "A signed set"
home = "https://example.org/"
citation = "Somebody, Something"
source = "here"
format = "transforms"
by_hand = "ask its authors, and a scene"
licence = {{ name = "theirs", address = "https://example.org/licence", says = "sign" }}
"""


@pytest.fixture
def served(small_room, tmp_path, monkeypatch):
    """A data set of two scenes on a server of ours; DATA is a folder that is not there yet."""
    server = Server()
    scene = open_scene(str(small_room), Settings(Path()))
    write_scene(scene, np.arange(len(scene.train)), tmp_path / "written", "transforms", links="copy")
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        for name in ("one", "two"):
            for path in sorted(path for path in (tmp_path / "written").rglob("*") if path.is_file()):
                archive.write(path, f"{name}/{path.relative_to(tmp_path / 'written')}")
    server.serve("/all.zip", (tmp_path / "all.zip").read_bytes())
    (tmp_path / "catalogue.toml").write_text(TEXT.format(address=server.url("/all.zip")), encoding="utf-8")
    monkeypatch.setenv(catalogue.VARIABLE, str(tmp_path / "catalogue.toml"))
    monkeypatch.setenv("VIEWBENCH_DATA", str(tmp_path / "data sets"))
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.delenv(name, raising=False)
    yield server
    server.close()


def run(capsys, *arguments):
    status = _main.run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_a_scene_is_brought_and_the_next_line_works(served, capsys, tmp_path):
    status, out, err = run(capsys, "download", "set/one", "--accept-licence")
    folder = tmp_path / "data sets" / "set" / "one"
    assert (status, out) == (0, f"{folder}\n")
    lines = err.splitlines()
    assert lines[0] == "viewbench: A set (https://example.org/): a part of about 0.25 GB"
    assert lines[1] == "viewbench: licence: ours: do as you like (https://example.org/licence)"
    assert lines[2] == "viewbench: to cite: Somebody, Something"
    assert lines[-1] == "viewbench: next: viewbench select set/one --ratio 0.1 --out one_tenth"
    command = lines[-1].removeprefix("viewbench: next: viewbench ").split()
    status, out, _ = run(capsys, *command[:-1], tmp_path / command[-1], "--selector", "uniform")
    assert (status, len(out.split())) == (0, 1)
    assert "set/one         12 training" in run(capsys, "list", "scenes")[1]
    asked = len(served.asked)
    status, out, err = run(capsys, "download", "set/one")
    assert (status, out) == (0, f"{folder}\n")
    assert "set/one is there already" in err
    assert "licence" not in err
    assert len(served.asked) == asked


def test_all_scenes_of_a_set_come_by_its_name_and_each_once(served, capsys, tmp_path):
    status, out, err = run(capsys, "download", "set/two", "set", "--accept-licence", "--to", tmp_path / "here")
    assert status == 0
    assert out.split() == [str(tmp_path / "here" / "set" / name) for name in ("two", "one")]
    assert err.startswith("viewbench: 2 scenes of A set (https://example.org/): about 0.25 GB\n")
    assert f"select {tmp_path / 'here' / 'set' / 'two'} --ratio" in err


def test_without_consent_nothing_is_asked_of_the_server(served, capsys, monkeypatch):
    status, out, err = run(capsys, "download", "set/one")
    assert (status, out) == (2, "")
    last = err.splitlines()[-1]
    assert last == (
        "viewbench: the licence of A set is to be accepted: read https://example.org/licence, and give --accept-licence"
    )
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("click.confirm", lambda *args, **given: False)
    status, _, err = run(capsys, "download", "set/one")
    assert (status, err.splitlines()[-1]) == (2, "viewbench: not accepted, nothing was downloaded")
    assert served.asked == []
    monkeypatch.setattr("click.confirm", lambda *args, **given: True)
    assert run(capsys, "download", "set/one")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["download"], "name a scene, such as mipnerf360/room"),
        (["download", "set/on"], "has no scene 'on'; did you mean 'one'"),
        (["download", "sett"], "no data set is called 'sett'; did you mean 'set'"),
        (["download", "signed/x"], "A signed set cannot be downloaded from here: ask its authors"),
        (["download", "signed"], "goes to data.root/signed/SCENE"),
        (["download", "--list", "sett"], "no data set is called 'sett'"),
        (["info", "set/one"], "`viewbench download set/one` brings it"),
        (["info", "set/on"], "is called 'set/on'; did you mean 'set/one'"),
    ],
)
def test_a_mistake_is_one_line(served, capsys, arguments, words):
    status, out, err = run(capsys, *arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_no_folder_of_captures_is_one_line(served, capsys, monkeypatch):
    monkeypatch.delenv("VIEWBENCH_DATA")
    monkeypatch.setenv("VIEWBENCH_ENVIRONMENT", str(PACKAGE / "environment.toml"))
    status, _, err = run(capsys, "download", "set/one", "--accept-licence")
    assert (status, err.count("\n")) == (2, 1)
    assert "give --to FOLDER, or set VIEWBENCH_DATA or data.root" in err


def test_a_failure_on_the_way_is_one_line_after_what_was_said(served, capsys):
    served.files["/all.zip"].always = ("page", 0)
    status, out, err = run(capsys, "download", "set/one", "--accept-licence")
    assert (status, out) == (2, "")
    assert 'answers with a web page ("Log in to the network")' in err.splitlines()[-1]
    assert "Traceback" not in err


def test_the_sets_are_listed_with_sizes_and_licences(served, capsys):
    run(capsys, "download", "set/two", "--accept-licence")
    status, out, err = run(capsys, "download", "--list")
    assert (status, err) == (0, "")
    assert "set: A set, about 0.25 GB, ours (https://example.org/licence)" in out
    assert "set/one  a part of about 0.25 GB\n" in out
    assert "set/two  a part of about 0.25 GB [here]\n" in out
    assert "ask its authors" in out
    assert "A set" not in run(capsys, "download", "--list", "signed")[1]
    rows = run(capsys, "list", "datasets")[1].splitlines()
    assert [row.split()[0] for row in rows] == ["set", "signed"]
    assert "[unavailable: given by its authors only]" in rows[1]


@pytest.mark.parametrize("ends_by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_call_that_is_ended_is_gone_on_with_by_the_same_command(served, tmp_path, ends_by):
    size = len(served.files["/all.zip"].data)
    served.files["/all.zip"].faults = [("", 0), ("", 0), ("stall", size // 4)]
    command = [sys.executable, "-m", "viewbench", "download", "set/one", "--accept-licence"]
    # Tests that run in a shell's background have SIGINT ignored, which what they start would inherit.
    usual = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, env=os.environ, preexec_fn=usual, **pipes)
    assert served.stalled.wait(60)
    staging = tmp_path / "data sets" / "set" / ".part-one"
    deadline = time.monotonic() + 60
    while sum(path.is_file() for path in staging.rglob("*")) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(ends_by)
    out, err = process.communicate(timeout=60)
    assert out == ""
    if ends_by is signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130
        assert "what came is kept; the same command goes on from there" in err
        assert "Traceback" not in err
    served.released.set()
    before = served.sent("/all.zip")
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=True)
    assert "files are there already" in done.stderr
    assert served.sent("/all.zip") - before < size
    scene = open_scene(done.stdout.strip(), Settings(Path()))
    assert len(scene.train) == 12
    receipt = json.loads((Path(done.stdout.strip()) / "download.json").read_text(encoding="utf-8"))
    assert receipt["licence"] == {"name": "ours", "address": "https://example.org/licence"}


STUDY = {
    "scenes": ["set/one", "room_human", "set/two"],
    "selectors": ["uniform"],
    "ratios": [0.5],
    "seeds": 1,
    "backends": [{"backend": "splat", "grid": {"scenes": ["set/one"]}}],
    "budget": {"iterations": 1},
    "reference": False,
    "encoder": "none",
    "reports": ["table-psnr"],
}


@pytest.fixture
def study(served, tmp_path):
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(STUDY), encoding="utf-8")
    return tmp_path / "mine.yaml"


def test_jobs_in_another_folder_have_the_same_catalogue(monkeypatch, tmp_path):
    assert run_command.CATALOGUE == catalogue.VARIABLE
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(catalogue.VARIABLE, "mine.toml")
    assert run_command.environment(Settings(Path("environment.toml")))[catalogue.VARIABLE] == str(
        tmp_path / "mine.toml"
    )


def test_a_study_names_scenes_of_the_catalogue(study, capsys):
    status, out, err = run(capsys, "study", study)
    assert (status, err) == (0, "")
    assert "set.one" in out
    study.write_text(yaml.safe_dump({**STUDY, "scenes": ["set/oen"]}), encoding="utf-8")
    status, out, err = run(capsys, "study", study)
    assert (status, err.count("\n")) == (2, 1)
    assert "unknown scene 'set/oen'; did you mean 'set/one'?" in err
    study.write_text(yaml.safe_dump({**STUDY, "scenes": ["set/one/two"]}), encoding="utf-8")
    assert run(capsys, "study", study)[0] == 2


@pytest.mark.parametrize("name", ["mine", "paper"])
def test_a_study_whose_scenes_are_not_there_prints_the_line_that_brings_them(
    study, capsys, tmp_path, name, monkeypatch
):
    wanted = {
        "mine": "set/one set/two",
        "paper": "indoortraj/kitchen_1 indoortraj/kitchen_2 indoortraj/openplan_1 indoortraj/living_1",
    }[name]
    if name == "paper":
        monkeypatch.delenv(catalogue.VARIABLE)
    monkeypatch.setenv("VIEWBENCH_ENVIRONMENT", str(PACKAGE / "environment.toml"))
    given = study if name == "mine" else name
    status, out, err = run(capsys, "run", given, "--out", tmp_path / "lab")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"`viewbench download {wanted}` brings them" in err
    assert not (tmp_path / "lab").exists()
    snakemake = [sys.executable, "-m", "snakemake", "--snakefile", PACKAGE / "Snakefile", "--directory", tmp_path]
    config = ["--cores", "1", "--dry-run", "--config", f"study={json.dumps(str(given))}"]
    done = subprocess.run([*map(str, snakemake), *config], capture_output=True, text=True, env=os.environ)
    assert done.returncode != 0
    said = " ".join((done.stdout + done.stderr).split())
    assert f"`viewbench download {wanted}` brings them" in said
    assert "Traceback" not in said
