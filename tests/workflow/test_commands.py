"""The command line as a user meets it: what it prints, where, and how it ends."""

import json

import pytest

from viewbench.common import plugins
from viewbench.common.threads import processors
from viewbench.workflow.commands import _main
from viewbench.workflow.commands._options import settings_of


def run(capsys, *arguments):
    """(exit status, standard output, standard error) of a command run in this process."""
    status = _main.run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.mark.parametrize(
    ("kind", "package"),
    [
        ("selectors", "selectors"),
        ("reports", "reports"),
        ("formats", "scenes.formats"),
        ("encoders", "scenes.encoders"),
        ("rooms", "scenes.rooms"),
    ],
)
def test_list_names_every_plugin(capsys, kind, package):
    status, out, err = run(capsys, "list", kind)
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == plugins.names(package)
    assert all(len(line.split()) > 2 for line in out.splitlines())


def test_list_says_why_something_is_unavailable(capsys, monkeypatch):
    monkeypatch.delenv("VIEWBENCH_DATA", raising=False)
    _, out, _ = run(capsys, "list", "scenes")
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert "400 training and 40 test views" in lines["room_human"]
    assert "unavailable" in lines["hololens_space"]
    assert "VIEWBENCH_DATA" in lines["hololens_space"]
    _, out, _ = run(capsys, "list", "backends")
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert "cpu" in lines["splat"]
    assert "unavailable" in lines["instant-ngp"]


def test_info_prints_json(capsys):
    status, out, _ = run(capsys, "info", "room_smooth", "--json")
    facts = json.loads(out)
    assert status == 0
    assert (facts["training_views"], facts["test_views"], facts["points"]) == (400, 40, 20000)
    assert facts["image_size"] == ["256 x 256"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["selct"], "did you mean 'select'"),
        (["info", "room_humna"], "did you mean 'room_human'"),
        (["list", "thing"], "thing"),
        (["info", "room_human", "--formt", "x"], "--formt"),
        (["study", "quik"], "did you mean 'quick'"),
        (["report", "/nowhere"], "results.csv"),
        (["record", "/nowhere"], "study"),
        (["train", "room_human", "--selection", "/nowhere.json", "--out", "/tmp/never"], "nowhere.json"),
        (["evaluate", "/nowhere", "room_human", "--out", "/tmp/never"], "train.json"),
        (["collect", "quick", "--results", "/nowhere"], "selection.json"),
        (["convert", "room_human", "--to", "colmapp", "--out", "/tmp/never"], "did you mean 'colmap'"),
    ],
)
def test_a_mistake_ends_in_one_line_and_status_2(capsys, arguments, words):
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("viewbench: ")
    assert words in err


def test_settings_on_the_command_line():
    given = settings_of(("a=1", "b=0.5", "c=pos,ang", "d=true", "e=x=y"))
    assert given == {"a": 1, "b": 0.5, "c": ["pos", "ang"], "d": True, "e": "x=y"}


def test_a_study_is_shown_with_its_defaults(capsys):
    status, out, _ = run(capsys, "study", "tiny")
    shown = json.loads(out)
    assert status == 0
    assert shown["cells"] == 4
    assert shown["encoder"]


def test_threads_change_the_time_and_no_number(capsys, small_room, tmp_path):
    chosen = tmp_path / "selection.json"
    assert run(capsys, "select", small_room, "--selector", "uniform", "--count", 6, "--selection", chosen)[0] == 0
    found = []
    for threads in (1, 3):
        model = tmp_path / f"model{threads}"
        asked = ["--selection", chosen, "--iterations", 12, "--width", 170, "--out", model, "--threads", threads]
        assert run(capsys, "train", small_room, *asked)[0] == 0
        assert run(capsys, "evaluate", model, small_room, "--out", model, "--threads", threads)[0] == 0
        assert json.loads((model / "train.json").read_text())["threads"] == min(threads, processors())
        files = [model / "model.ply", *sorted((model / "renders").iterdir())]
        metrics = json.loads((model / "metrics.json").read_text())
        found.append(([path.read_bytes() for path in files], metrics["views"], metrics["psnr_db"]))
    assert len(found[0][0]) == 5
    assert found[0] == found[1]
    status, _, err = run(capsys, "train", small_room, *asked[:-1], 0)
    assert status == 2
    assert "--threads" in err
