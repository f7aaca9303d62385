"""`viewbench select` with lists of views, links, points and the command to type next."""

import json
import shlex

import numpy as np
import pytest

from tests.scenes.test_transforms import opened
from tests.scenes.test_written import colmap
from tests.workflow.test_select import PLACES, names, run
from viewbench.workflow.commands import _next

SIX = [f"walk/frame{number:02d}.png" for number in range(6)]


@pytest.fixture
def walk(tmp_path):
    return colmap(tmp_path / "walk", SIX)


def test_lists_are_names_patterns_and_files(capsys, walk, tmp_path):
    (tmp_path / "list.txt").write_text("# bad ones\nwalk/frame00.png\n\nframe01.png\n", encoding="utf-8-sig")
    chosen = names(
        capsys, walk, "--count", 3, *PLACES, "--exclude", tmp_path / "list.txt", "--keep", "frame04", "--dry-run"
    )
    assert chosen[0] == SIX[4]
    assert not set(chosen) & set(SIX[:2])
    assert names(capsys, walk, "--count", 2, *PLACES, "--keep", "*05.png,frame02.png", "--dry-run") == [SIX[5], SIX[2]]


def test_every_third_frame_is_a_candidate(capsys, walk, tmp_path):
    chosen = names(capsys, walk, "--count", 2, *PLACES, "--stride", 3, "--out", tmp_path / "out")
    assert sorted(chosen) == [SIX[0], SIX[3]]
    record = json.loads((tmp_path / "out" / "selection.json").read_text())
    assert (record["n_views"], sorted(record["indices"])) == (6, [0, 3]), "indices are into the capture"
    assert list(opened(tmp_path / "out").train.names) == [SIX[0], SIX[3]]


CASES = {
    "no such view": (["--keep", "frame9.png"], "'frame9.png' is no training view; did you mean"),
    "no such file": (["--exclude", "list.txt"], "there is no file 'list.txt'"),
    "both": (["--keep", "frame01.png", "--exclude", "frame0[0-2]*"], "kept and excluded"),
    "nothing left": (["--exclude", "*"], "leaves none of the 6"),
    "too few left": (["--exclude", "walk/frame0[0-4].png"], "more than the 1 of 6"),
    "held out": (["--keep", "frame00.png", "--holdout", "every:3"], "is a test view, which is never chosen"),
    "no times": (["--fps", "3"], "no times"),
    "two links": (["--copy", "--relative"], "either --copy or --relative"),
    "auto and gap": (["--max-gap", "2"], None),
}


@pytest.mark.parametrize("case", CASES)
def test_a_list_that_cannot_be_obeyed_is_one_line(capsys, walk, tmp_path, case):
    options, words = CASES[case]
    status, out, err = run(capsys, walk, "--count", 2, *PLACES, *options, "--out", tmp_path / "out")
    if words is None:
        (tmp_path / "out").rename(tmp_path / "first")
        status, out, err = run(capsys, walk, "--auto", *PLACES, *options, "--out", tmp_path / "out")
        words = "--max-gap fills gaps of a count"
    assert status == 2
    assert out == ""
    assert words in err.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_names_in_two_folders_want_the_folder(capsys, tmp_path):
    folder = colmap(tmp_path / "in", ["left/00.png", "right/00.png", "left/01.png", "right/01.png"])
    status, _, err = run(capsys, folder, "--count", 2, *PLACES, "--keep", "00.png", "--dry-run")
    assert status == 2
    assert "may be 'left/00.png', 'right/00.png'" in err
    assert names(capsys, folder, "--count", 2, *PLACES, "--keep", "right/00.png", "--dry-run")[0] == "right/00.png"


def test_links_are_as_asked(capsys, walk, tmp_path):
    run(capsys, walk, "--count", 2, *PLACES, "--relative", "--out", tmp_path / "out")
    links = list((tmp_path / "out" / "images").rglob("*.png"))
    assert links
    assert all(path.is_symlink() and not path.readlink().is_absolute() and path.is_file() for path in links)


def test_the_next_command_is_in_the_tools_words(capsys, walk, tmp_path):
    out = tmp_path / "my 'out'"
    _, _, err = run(capsys, walk, "--count", 2, *PLACES, "--out", out)
    lines = [line.partition(": ")[2].partition(": ")[2] for line in err.splitlines() if "next, " in line]
    assert [shlex.split(line)[:3] for line in lines] == [
        ["python", "train.py", "-s"],
        ["ns-train", "splatfacto", "--data"],
        ["python", "simple_trainer.py", "default"],
    ]
    assert all(str(out) in shlex.split(line) for line in lines)


@pytest.mark.parametrize("held", [False, True])
def test_every_form_that_is_written_has_a_next_command(tmp_path, small_room, held):
    (tmp_path / "transforms.json").write_text("{}")
    assert "ns-train" in _next.commands(tmp_path, "transforms", held)[0]
    assert "--depth-unit-scale-factor 0.0002" in _next.commands(tmp_path, "transforms", held, 0.0002)[0]
    assert "automatic_reconstructor" in _next.commands(tmp_path, "images", held)[0]
    # The names of this room's images have suffixes, which no reader of Blender's form but its own takes.
    lines = _next.commands(small_room, "transforms", held)
    assert len(lines) == 1
    assert "viewbench convert" in lines[0]
    blender = tmp_path / "blender"
    listed = [{"file_path": "./train/r_0"}]
    (blender / "train").mkdir(parents=True)
    (blender / "train" / "r_0.png").write_bytes(b"")
    (blender / "transforms_train.json").write_text(json.dumps({"frames": listed}))
    assert "viewbench convert" in _next.commands(blender, "transforms", held)[0], "no angle of view"
    (blender / "transforms_train.json").write_text(json.dumps({"camera_angle_x": 1.0, "frames": listed}))
    assert _next.commands(blender, "transforms", held)[0].endswith("--eval") == held
    (blender / "transforms_val.json").write_text(json.dumps({"frames": listed}))
    assert _next.commands(blender, "transforms", held)[0].endswith("blender-data")


def test_a_camera_that_3dgs_refuses_is_undistorted_first(capsys, tmp_path):
    folder = colmap(tmp_path / "bent", SIX, model="OPENCV", params=[10, 11, 6, 4, 0.1, 0, 0, 0])
    _, _, err = run(capsys, folder, "--count", 2, *PLACES, "--out", tmp_path / "out")
    assert "next, 3DGS: colmap image_undistorter" in err
    smaller = colmap(tmp_path / "small", SIX, (6, 4), "images_2")
    _, _, err = run(capsys, smaller, "--count", 2, *PLACES, "--out", tmp_path / "out2")
    assert [line.split(": ")[1] for line in err.splitlines() if "next, " in line] == ["next, 3DGS"]
    assert "-i images_2" in err


def test_points_of_the_chosen_views_alone(capsys, tmp_path, small_room):
    status, _, err = run(capsys, small_room, "--count", 3, *PLACES, "--points", "chosen", "--out", tmp_path / "out")
    assert (status, "which views see a point" in err) == (2, True)
    assert np.isfinite(len(opened(small_room).train))


def test_what_may_not_be_chosen_is_not_opened(capsys, walk, tmp_path):
    """A cut picture, a missing one and those between the candidates hold nobody up."""
    (walk / "images" / SIX[1]).write_bytes(b"cut")
    (walk / "images" / SIX[2]).unlink()
    status, _, err = run(capsys, walk, "--count", 2, "--sharpness", 1, *PLACES, "--dry-run")
    assert (status, "is missing" in err or "cannot be read" in err) == (2, True)
    gone = ("--exclude", "frame01.png,frame02.png")
    chosen = names(capsys, walk, "--count", 2, "--sharpness", 1, *PLACES, *gone, "--out", tmp_path / "out")
    assert not set(chosen) & set(SIX[1:3])
    assert names(capsys, walk, "--count", 2, *PLACES, "--stride", 3, "--dry-run")


def test_a_gap_in_frames_is_said_to_be(capsys, walk):
    _, _, err = run(capsys, walk, "--count", 3, *PLACES, "--max-gap", "3", "--dry-run")
    assert "in frames, 3f" in err
    _, _, err = run(capsys, walk, "--count", 3, *PLACES, "--max-gap", "3f", "--dry-run")
    assert "no times" not in err


def test_a_path_that_is_not_there_is_called_one(capsys, tmp_path):
    for name in (tmp_path / "walk.mp4", "../nosuch", "nosuch.mov"):
        status, _, err = run(capsys, name, "--count", 3, "--dry-run")
        assert (status, err.strip()) == (2, f"viewbench: there is no file or folder '{name}'")
    _, _, err = run(capsys, "room_humann", "--count", 3, "--dry-run")
    assert "did you mean 'room_human'" in err


def test_features_of_a_folder_without_results_are_kept_for_the_user(capsys, tmp_path, small_room, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    names(capsys, small_room, "--count", 2, "--sharpness", 1, *PLACES, "--dry-run")
    assert not (tmp_path / "results").exists()
    assert list((tmp_path / "cache" / "viewbench" / "features").rglob("*.npy"))
    (tmp_path / "results").mkdir()
    names(capsys, small_room, "--count", 2, "--sharpness", 1, *PLACES, "--dry-run")
    assert list((tmp_path / "results" / "features").rglob("*.npy"))
