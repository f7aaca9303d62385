"""`viewbench redundancy`, `select --auto` and `--sheet` as people use them on their own captures."""

import csv
import json
import os

import numpy as np
import pytest
from PIL import Image

from viewbench.workflow.commands import _choice_options, _main

PLACES = ("--factors", "pos,ang")  # no encoder
SCENE = ("room_human", *PLACES)


def run(capsys, *arguments):
    """(exit status, standard output, standard error)."""
    status = _main.run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def facts(capsys, *arguments):
    status, out, err = run(capsys, "redundancy", *arguments, "--json")
    assert status == 0, err
    return json.loads(out)


@pytest.fixture
def unposed(tmp_path):
    """Twenty pictures, the 6th to the 15th of which are the same but for noise, with features that say so."""
    root = tmp_path / "photos"
    root.mkdir()
    rng = np.random.default_rng(0)
    rows = np.abs(rng.normal(size=(20, 8)))
    rows[5:15] = rows[5] + 1e-3 * rng.normal(size=(10, 8))
    for i, row in enumerate(rows):
        Image.new("RGB", (64, 48), tuple(int(60 * value) % 256 for value in row[:3])).save(root / f"{i:02d}.png")
    np.save(tmp_path / "f.npy", rows)
    return root, "--features", tmp_path / "f.npy"


def test_redundancy_and_auto_say_the_same(capsys, tmp_path):
    found = facts(capsys, *SCENE, "--at", 0.9, "--at", 0.8)
    assert [level["similarity"] for level in found["levels"]] == [0.9, 0.8]
    for level in found["levels"]:
        distance = round(1 - level["similarity"], 6)
        path = tmp_path / "s.json"
        status, out, err = run(capsys, "select", *SCENE, "--auto", distance, "--selection", path, "--dry-run")
        assert status == 0
        selection = json.loads(path.read_text())
        assert selection["count"] == level["enough"] == len(out.splitlines())
        assert level["nothing_new"] == 400 - level["enough"]
        auto = selection["notes"]["auto"]
        assert auto["distance"] == distance >= auto["reached"] > 0
        assert f"{selection['count']} of 400 views: every one left out is within {distance:g} of a chosen one" in err


def test_the_table_is_the_curve_until_the_finest_similarity(capsys, tmp_path):
    path = tmp_path / "curve.csv"
    status, out, _ = run(capsys, "redundancy", *SCENE, "--out", path)
    assert status == 0
    rows = list(csv.DictReader(path.open(encoding="utf-8")))
    left = [float(row["uncovered"]) for row in rows]
    assert [int(row["views"]) for row in rows] == list(range(1, len(rows) + 1))
    assert left == sorted(left, reverse=True)
    assert left[-1] <= 0.01 < left[-2]
    shown = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.startswith(" ") and "%" in line}
    for similarity, words in shown.items():
        enough = next(k for k, value in enumerate(left, start=1) if value <= 1 - float(similarity) + 1e-9)
        assert (words[0], words[2]) == (str(enough), str(400 - enough))
    assert len(shown) == 6


def test_what_stands_still_is_named_without_poses(capsys, unposed):
    found = facts(capsys, *unposed)
    assert list(found["weights"]) == ["sem"]
    longest = found["runs"][0]
    assert (longest["first"], longest["last"], longest["frames"]) == (5, 14, 10)
    assert longest["names"][:2] == ["05.png", "14.png"]
    status, out, _ = run(capsys, "redundancy", *unposed)
    assert status == 0
    assert "frames 5 to 14 (05.png to 14.png): 10 frames" in out


def test_a_capture_that_repeats_nothing_needs_all_views(capsys, unposed, tmp_path):
    np.save(tmp_path / "f.npy", np.eye(20))
    found = facts(capsys, *unposed)
    assert {level["enough"] for level in found["levels"]} == {20}
    assert found["runs"] == []
    status, _, err = run(capsys, "select", *unposed, "--auto", "--dry-run")
    assert status == 2
    assert "no choice short of all 20 views is within 0.1" in err


@pytest.mark.parametrize(
    "arguments", [("--auto", *SCENE), (*SCENE, "--auto"), (*SCENE, "--auto", str(_choice_options.DISTANCE))]
)
def test_auto_may_stand_anywhere_without_a_number(capsys, arguments):
    chosen = [run(capsys, "select", *given, "--dry-run") for given in (arguments, (*SCENE, "--auto=0.1"))]
    assert chosen[0] == chosen[1]
    assert chosen[0][0] == 0


def test_a_name_that_looks_like_the_option_is_a_name(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    status, _, err = run(capsys, "select", "--count", 3, "--dry-run", "--", "--auto")
    assert status == 2
    assert "'--auto'" in err


@pytest.mark.parametrize("kind", ["jpg", "html"])
def test_a_sheet_and_a_strip_without_poses(capsys, unposed, tmp_path, kind):
    sheet, plot = tmp_path / f"sheet.{kind}", tmp_path / f"plot.{'png' if kind == 'jpg' else kind}"
    status, out, err = run(capsys, "select", *unposed, "--count", 4, "--dry-run", "--sheet", sheet, "--plot", plot)
    assert status == 0, err
    assert len(out.splitlines()) == 4
    assert plot.stat().st_size > 10_000
    if kind == "jpg":
        assert Image.open(sheet).size[0] > 1000
    else:
        assert all(f">{name}<" in sheet.read_text(encoding="utf-8") for name in out.splitlines())


def test_a_sheet_of_a_choice_that_compares_nothing(capsys, unposed, tmp_path):
    given = (unposed[0], "--encoder", "none", "--selector", "uniform", "--count", 4, "--dry-run")
    status, _, err = run(capsys, "select", *given, "--sheet", tmp_path / "s.html", "--plot", tmp_path / "p.png")
    assert status == 0, err
    assert "by place in the capture" in (tmp_path / "s.html").read_text(encoding="utf-8")


MISTAKES = {
    "auto 0": (["--auto", "0"], "expected one in (0, 1)"),
    "auto 1": (["--auto", "1"], "expected one in (0, 1)"),
    "auto below 0": (["--auto", "-0.1"], "expected one in (0, 1)"),
    "auto nan": (["--auto", "nan"], "expected one in (0, 1)"),
    "auto and count": (["--auto", "--count", "3"], "--auto"),
    "auto and ratio": (["--auto", "0.1", "--ratio", "0.1"], "--auto"),
    "auto random": (["--auto", "--selector", "random"], "'random' does not compare views"),
    "auto coverage": (["--auto", "--selector", "coverage"], "'coverage' does not compare views"),
    "auto uniform": (["--auto", "--selector", "uniform"], "'uniform' does not compare views"),
    "auto sample": (["--auto", "--selector", "logdet", "--sample"], "leave out --sample"),
    "sheet": (["--count", "3", "--sheet", "a.gif"], "--sheet 'a.gif': expected"),
    "sheet folder": (["--count", "3", "--sheet", "there.jpg"], "is a folder"),
    "plot below a file": (["--count", "3", "--plot", "file/a.png"], "is a file"),
    "selection folder": (["--count", "3", "--selection", "there.jpg"], "is a folder"),
    "out is not empty": (["--count", "3", "--out", "full"], "is not empty"),
    "out is a file": (["--count", "3", "--out", "file"], "is not empty"),
    "out below a file": (["--count", "3", "--out", "file/out"], "is a file"),
    "count": (["--count", "401"], "[1, 400]"),
    "sigma": (["--count", "3", "--sigma", "0"], "sigma"),
    "alpha": (["--count", "3", "--alpha", "2"], "alpha"),
    "parameter": (["--count", "3", "--set", "sigm=1"], "did you mean 'sigma'"),
    "factor": (["--count", "3", "--factors", "pos,semm"], "did you mean 'sem'"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_said_before_any_picture_is_embedded(capsys, tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.jpg").mkdir()
    (tmp_path / "full").mkdir()
    for name in ("file", "full/file"):
        (tmp_path / name).write_text("kept")
    monkeypatch.setattr("viewbench.scenes.features.features", lambda *_: pytest.fail("features were computed"))
    arguments, words = MISTAKES[case]
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run(capsys, "select", "room_human", "--out", "out", *arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert words in err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--at", "1"], "expected a similarity in (0, 1)"),
        (["--at", "nan"], "expected a similarity in (0, 1)"),
        (["--out", "a.txt"], "--out 'a.txt': expected a file ending in .csv"),
        (["--plot", "a.gif"], ".png"),
        (["--runs", "-1"], "--runs"),
        (["--beta", "2"], "beta"),
    ],
)
def test_a_mistake_about_redundancy_is_one_line(capsys, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, "redundancy", *SCENE, *arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert words in err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_read_only_is_named_at_once(capsys, tmp_path, monkeypatch):
    """The one above --out that is there; root may write anywhere, so the system's answer is put in its mouth."""
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: path != tmp_path and allowed(path, mode))
    monkeypatch.setattr("viewbench.scenes.load.open_scene", lambda *_, **__: pytest.fail("the scene was opened"))
    for option, name in (("--out", "a/b"), ("--sheet", "a.jpg"), ("--plot", "a.png"), ("--selection", "a.json")):
        given = () if option == "--out" else ("--dry-run",)
        status, _, err = run(capsys, "select", *SCENE, "--count", 3, *given, option, tmp_path / name)
        assert status == 2
        assert f"{option}: folder '{tmp_path}' cannot be written to" in err
