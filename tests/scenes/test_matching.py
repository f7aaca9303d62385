"""Neighbours of a choice are matched as structure-from-motion does it, and a chain that breaks is told."""

import json
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from viewbench.common import extras
from viewbench.common.settings import PACKAGE
from viewbench.scenes import matching
from viewbench.workflow.commands import _main

ROOM = PACKAGE / "scenes" / "generated_room" / "smooth" / "train"


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), min_size=2, max_size=12))
def test_a_break_is_where_no_pair_leads_across(values):
    inliers = np.array(values).T
    inliers[0, -1] = inliers[1, -2:] = 0
    n = inliers.shape[1]
    edges = [(k, k + step) for step in (1, 2) for k in range(n - step) if inliers[step - 1, k] >= matching.ENOUGH]
    expected = [k for k in range(n - 1) if not any(a <= k < b for a, b in edges)]
    assert matching.breaks(inliers).tolist() == expected


def turned(grey, pixels):
    """The picture moved to the side, as a camera that goes along a wall sees it."""
    return np.ascontiguousarray(grey[:, pixels : pixels + 300])


def test_overlap_is_told_from_none():
    pytest.importorskip("cv2")
    rng = np.random.default_rng(0)
    walls = [
        np.asarray(
            Image.fromarray(rng.integers(0, 255, (40, 100), np.uint8)).resize((800, 320), Image.Resampling.BICUBIC)
        )
        for _ in range(2)
    ]
    pictures = [
        turned(walls[0], 0),
        turned(walls[0], 60),
        turned(walls[1], 0),
        turned(walls[1], 60),
        turned(walls[1], 120),
    ]
    found = matching.inliers_along(pictures, 5)
    assert (found[0, [0, 2]] >= 4 * matching.ENOUGH).all()
    assert (found[0, 1], found[1, 0], found[1, 1]) < (matching.ENOUGH,) * 3
    assert matching.breaks(found).tolist() == [1]
    np.testing.assert_array_equal(found, matching.inliers_along(pictures, 5))


def test_pictures_without_features_match_nothing():
    pytest.importorskip("cv2")
    assert matching.inliers_along([np.zeros((50, 50), np.uint8)] * 3, 3).tolist() == [[0, 0, 0], [0, 0, 0]]


@pytest.fixture
def walk(tmp_path):
    """Frames of the room: eight in a row, then eight of another place."""
    folder = tmp_path / "walk"
    folder.mkdir()
    for number, source in enumerate([*range(0, 16, 2), *range(200, 216, 2)]):
        shutil.copy(ROOM / f"{source:04d}.jpg", folder / f"{number:02d}.jpg")
    return folder


def test_the_command_line_says_where_it_breaks(walk, tmp_path, capsys):
    pytest.importorskip("cv2")
    base = ["select", str(walk), "--selector", "full", "--count", "16"]
    assert _main.run([*base, "--out", str(tmp_path / "out"), "--selection", str(tmp_path / "s.json")]) == 0
    captured = capsys.readouterr()
    line = next(line for line in captured.err.splitlines() if "neighbours that match" in line)
    assert "14 of 15" in line
    assert "weakest: 07.jpg – 08.jpg" in line
    assert "may break there" in line
    assert "neighbours" not in captured.out
    for path in (tmp_path / "out" / "selection.json", tmp_path / "s.json"):
        notes = json.loads(path.read_text())["notes"]["matches"]
        assert notes["breaks"] == [["07.jpg", "08.jpg"]]
        assert notes["weakest_inliers"] < matching.ENOUGH < notes["median_inliers"]
    from viewbench.selectors._selection import load_selection

    load_selection(tmp_path / "out" / "selection.json")  # its seal is that of its content


@pytest.mark.parametrize(
    ("scene", "options", "looked"),
    [
        ("walk", ["--out", "out"], True),
        ("walk", ["--out", "out", "--no-check-matches"], False),
        ("walk", ["--dry-run"], False),
        ("walk", ["--dry-run", "--check-matches"], True),
        ("room_smooth", ["--out", "out"], False),
        ("room_smooth", ["--out", "out", "--check-matches"], True),
    ],
)
def test_when_it_is_looked(walk, tmp_path, capsys, monkeypatch, scene, options, looked):
    pytest.importorskip("cv2")
    monkeypatch.chdir(tmp_path)
    assert _main.run(["select", scene, "--selector", "uniform", "--count", "4", *options]) == 0
    assert ("neighbours that match" in capsys.readouterr().err) == looked


def test_a_video_that_is_not_written(tmp_path, capsys, monkeypatch):
    pytest.importorskip("cv2")
    pytest.importorskip("av")
    from tests.scenes.test_video import encode, scenery

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = encode(tmp_path / "walk.mp4", scenery(12, 160, 240))
    base = ["select", str(path), "--selector", "uniform", "--count", "5", "--check-matches"]
    assert _main.run([*base, "--dry-run"]) == 0
    first = capsys.readouterr().err
    assert _main.run([*base, "--out", str(tmp_path / "out")]) == 0
    said = [
        next(line for line in text.splitlines() if "neighbours" in line) for text in (first, capsys.readouterr().err)
    ]
    assert said[0] == said[1]
    assert "of 4" in said[0]


def test_without_opencv(walk, tmp_path, capsys, monkeypatch):
    found = extras.importlib.util.find_spec
    monkeypatch.setattr(
        extras.importlib.util, "find_spec", lambda name, *rest: None if name == "cv2" else found(name, *rest)
    )
    base = ["select", str(walk), "--selector", "uniform", "--count", "4"]
    assert _main.run([*base, "--out", str(tmp_path / "out")]) == 0
    assert "neighbours" not in capsys.readouterr().err
    assert _main.run([*base, "--out", str(tmp_path / "more"), "--check-matches"]) == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith("pip install 'viewbench[match]'")
    assert not (tmp_path / "more").exists()
