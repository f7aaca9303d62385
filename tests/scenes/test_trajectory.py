"""A folder of images with a trajectory: which pose is whose, what the camera is, and what is said to a wrong file."""

import json

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from tests.scenes.test_transforms import opened
from tests.scenes.walks import between, matrices, walk
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.settings import SceneEntry, Settings
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats import _timed
from viewbench.scenes.load import detect, open_scene
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.scenes.types import OPENCV
from viewbench.workflow.commands import _main

PLACES = ("--factors", "pos,ang")
LENS = "50,51,31.5,23.5"
N = 12


def picture(path, number=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (64, 48), (number, 0, 0)).save(path)


def capture(root, kind="made up", name=lambda i, stamp: f"{stamp:.6f}.png", shift=0.0012):
    """Images on the path, a frame every twenty rows and a bit after them, and traj.tum; returns the path and times."""
    times, positions, turns = known(walk(kind))
    rows = np.column_stack([times, positions, turns.as_quat()])
    root.mkdir(parents=True, exist_ok=True)
    np.savetxt(root / "traj.tum", rows, fmt="%.9f", header="time tx ty tz qx qy qz qw")
    wanted = times[5:-5:20][:N] + shift
    for i, stamp in enumerate(wanted):
        picture(root / "images" / name(i, stamp), i)
    return (times, positions, turns), wanted


def numbers(scene):
    """Which image each frame is, by its colour."""
    return [np.asarray(Image.open(path))[0, 0, 0] for path in scene.train.paths]


NAMES = {
    "seconds": lambda i, stamp: f"{stamp:.6f}.png",
    "nanoseconds": lambda i, stamp: f"{round(stamp * 1e9)}.png",
    "microseconds": lambda i, stamp: f"left_{round(stamp * 1e6)}.png",
    "milliseconds": lambda i, stamp: f"{round(stamp * 1e3)}.png",
}


@pytest.mark.parametrize("kind", ["made up", "real"])
@pytest.mark.parametrize("unit", NAMES)
def test_images_are_matched_by_the_times_in_their_names(tmp_path, kind, unit):
    if walk(kind) is None:
        pytest.skip("the real captures are not here: VIEWBENCH_DATA is not set")
    path, times = capture(tmp_path, kind, NAMES[unit])
    scene = opened(tmp_path)
    assert scene.format == "trajectory"
    assert numbers(scene) == list(range(N))
    told = np.round(times, 3) if unit == "milliseconds" else times
    np.testing.assert_allclose(known(scene.train.times), told, atol=1e-6)
    wanted = between(*path, told) @ OPENCV
    np.testing.assert_allclose(scene.train.cameras.c2w, wanted, atol=2e-4)  # a microsecond, and nine decimals


def test_times_of_a_file_by_name_and_in_order(tmp_path):
    _, times = capture(tmp_path, name=lambda i, stamp: f"{i}.png")
    wanted = capture(tmp_path / "named")
    whole = opened(tmp_path / "named").train.cameras.c2w
    by_name = tmp_path / "by name.txt"
    lines = [f"{times[i]:.6f} images/{i}.png" for i in reversed(range(N))]
    by_name.write_text("\n".join(["# time name", *lines]))
    in_order = tmp_path / "times.txt"
    in_order.write_text("\r\n".join(str(round(time * 1e9)) for time in times))
    for file in (by_name, in_order):
        scene = opened(tmp_path, times=str(file))
        assert numbers(scene) == list(range(N))  # 0.png to 11.png, in natural order
        np.testing.assert_allclose(scene.train.cameras.c2w, whole, atol=1e-5)
    by_name.write_text("\n".join(lines[:-2]))
    scene = opened(tmp_path, times=str(by_name))
    assert numbers(scene) == list(range(2, N))
    assert any("2 of 12 images dropped" in note for note in scene.notes)
    assert len(wanted[1]) == N


def test_images_far_from_any_pose_are_dropped_and_counted(tmp_path):
    _, times = capture(tmp_path)
    rows = (tmp_path / "traj.tum").read_text().splitlines()
    near = [row for row in rows if row.startswith("#") or abs(float(row.split()[0]) - times[4]) > 0.0201]
    (tmp_path / "traj.tum").write_text("\n".join(near))
    scene = opened(tmp_path)
    assert numbers(scene) == [i for i in range(N) if i != 4]
    assert any("1 of 12 images dropped" in note for note in scene.notes)


@pytest.mark.parametrize("columns", [8, 12, 16])
def test_without_times_row_and_image_are_matched_in_order(tmp_path, columns):
    """KITTI's and whole matrices have no times at all; rows of TUM with times of another clock serve so too."""
    times, positions, turns = known(walk("made up"))
    poses = matrices(positions, turns)[:N]
    tum = np.column_stack([times, positions, turns.as_quat()])[:N]
    rows = {8: tum, 12: poses[:, :3].reshape(N, 12), 16: poses.reshape(N, 16)}[columns]
    for i in range(N):
        picture(tmp_path / f"frame{i}.png", i)
    np.savetxt(tmp_path / "poses.txt", rows, fmt="%.12f")
    scene = opened(tmp_path, poses=str(tmp_path / "poses.txt"))
    assert numbers(scene) == list(range(N))
    np.testing.assert_allclose(scene.train.cameras.c2w, poses @ OPENCV, atol=1e-9)
    assert (scene.train.times is not None) == (columns == 8)
    rows[3, -1] = np.nan
    np.savetxt(tmp_path / "poses.txt", rows)
    lost = opened(tmp_path, poses=str(tmp_path / "poses.txt"))
    assert numbers(lost) == [i for i in range(N) if i != 3]
    np.testing.assert_allclose(lost.train.cameras.c2w, np.delete(poses, 3, axis=0) @ OPENCV, atol=1e-9)


def test_rows_in_any_order_with_dates_in_names(tmp_path):
    """IMG_20240131120000 is a date and no time in milliseconds: rows are taken one by one."""
    times, positions, turns = known(walk("made up"))
    tum = np.column_stack([times[::-1], positions[::-1], turns.as_quat()[::-1]])[:N]  # as the file has them
    for i in range(N):
        picture(tmp_path / f"IMG_{20240131120000 + i}.png", i)
    np.savetxt(tmp_path / "a.tum", tum, fmt="%.9f")
    np.testing.assert_allclose(opened(tmp_path).train.cameras.positions, tum[:, 1:4], atol=1e-8)


@pytest.mark.parametrize("place", ["", "images", "beside"])
def test_the_camera_is_found_beside_images_and_trajectory(tmp_path, place):
    capture(tmp_path / "in")
    (tmp_path / "beside").mkdir()
    (tmp_path / "in" / "traj.tum").rename(tmp_path / "beside" / "traj.tum")
    folder = tmp_path / "beside" if place == "beside" else tmp_path / "in" / place
    (folder / "camera.txt").write_text("50 51 31.5 23.5 0.1 -0.2 0.001 0.002\n")
    scene = opened(tmp_path / "in", poses=str(tmp_path / "beside" / "traj.tum"))
    camera = scene.train.cameras[0]
    assert [float(v[0]) for v in (camera.fx, camera.fy, camera.cx, camera.cy)] == [50, 51, 32, 24]
    np.testing.assert_array_equal(known(camera.distortion)[0], [0.1, -0.2, 0.001, 0.002, 0])
    hashes = {scene_sha256(scene)}
    (folder / "camera.txt").write_text("50 0 31.5\n0 51 23.5\n0 0 1\n")  # K
    again = opened(tmp_path / "in", poses=str(tmp_path / "beside" / "traj.tum"))
    assert (again.train.cameras.cx[0], again.train.cameras.distortion) == (32, None)
    hashes.add(scene_sha256(again))
    given = opened(tmp_path / "in", poses=str(tmp_path / "beside" / "traj.tum"), intrinsics="60,60,31.5,23.5")
    assert given.train.cameras.fx[0] == 60
    hashes.add(scene_sha256(given))
    assert len(hashes) == 3


def test_without_intrinsics_views_are_chosen_and_not_written(tmp_path, capsys):
    capture(tmp_path / "in")
    arguments = ["select", str(tmp_path / "in"), "--count", "3", *PLACES]
    assert _main.run([*arguments, "--dry-run"]) == 0
    chosen = capsys.readouterr().out.splitlines()
    assert len(chosen) == 3
    assert _main.run(["info", str(tmp_path / "in"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["focal_length"] == []
    assert _main.run([*arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "--intrinsics" in error
    assert "camera.txt" in error
    assert not (tmp_path / "out").exists()
    assert _main.run(["select", str(tmp_path / "in"), "--count", "3", "--selector", "coverage", "--dry-run"]) == 2
    assert "intrinsics" in capsys.readouterr().err
    assert _main.run([*arguments, "--intrinsics", LENS, "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.splitlines() == chosen
    again = opened(tmp_path / "out")
    assert (again.format, again.train.cameras.fx[0], again.train.cameras.cy[0]) == ("transforms", 50, 24)
    write_scene(opened(tmp_path / "in"), np.arange(3), tmp_path / "pictures", "images")  # which need no camera
    assert detect(tmp_path / "pictures") == "images"


def test_every_command_takes_the_options(tmp_path, capsys):
    """One selection serves the training when both are told the same."""
    capture(tmp_path / "in", name=lambda i, stamp: f"{i}.png")
    (tmp_path / "in" / "traj.tum").rename(tmp_path / "path.txt")
    _, times = capture(tmp_path / "other")
    (tmp_path / "times.txt").write_text("\n".join(f"{time:.6f}" for time in times))
    told = ["--poses", tmp_path / "path.txt", "--times", tmp_path / "times.txt", "--intrinsics", LENS]
    told = list(map(str, told))
    assert _main.run(["info", str(tmp_path / "in"), *told, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["format"], facts["training_views"], facts["times"]) == ("trajectory", N, True)
    choose = ["select", str(tmp_path / "in"), *told, "--holdout", "every:4", "--count", "4", *PLACES]
    assert _main.run([*choose, "--selection", str(tmp_path / "s.json")]) == 0
    assert _main.run(["convert", str(tmp_path / "in"), *told, "--to", "colmap", "--out", str(tmp_path / "c")]) == 0
    assert opened(tmp_path / "c").format == "colmap"
    train = ["train", str(tmp_path / "in"), "--selection", str(tmp_path / "s.json"), "--iterations", "1"]
    train += ["--holdout", "every:4", "--out", str(tmp_path / "model")]
    assert _main.run(train) == 2  # without poses the folder is another capture
    capsys.readouterr()
    assert _main.run([*train, *told]) == 0
    evaluate = ["evaluate", str(tmp_path / "model"), str(tmp_path / "in"), "--holdout", "every:4"]
    assert _main.run([*evaluate, *told, "--out", str(tmp_path / "model")]) == 0


def test_a_scene_of_the_settings_has_the_same(tmp_path, monkeypatch):
    monkeypatch.delenv("VIEWBENCH_DATA", raising=False)
    capture(tmp_path / "walk", name=lambda i, stamp: f"{i}.png")
    (tmp_path / "walk" / "traj.tum").rename(tmp_path / "walk" / "path of odometry.txt")
    _, times = capture(tmp_path / "other")
    (tmp_path / "walk" / "times.txt").write_text("\n".join(f"{time:.6f}" for time in times))
    file = tmp_path / "environment.toml"
    file.write_text(
        f'[data]\nroot = "{tmp_path}"\n[scenes.mine]\npath = "walk"\nposes = "path of odometry.txt"\n'
        f'times = "times.txt"\nintrinsics = "{LENS}"\n'
    )
    scene = open_scene("mine", settings_file.load(file))
    assert (scene.name, scene.format, scene.train.cameras.fx[0]) == ("mine", "trajectory", 50)
    named = Settings(tmp_path, scenes={"mine": SceneEntry(str(tmp_path / "other"), intrinsics="70,70,31.5,23.5")})
    assert open_scene("mine", named).train.cameras.fx[0] == 70
    assert open_scene("mine", named, intrinsics=LENS).train.cameras.fx[0] == 50


def test_the_subset_has_the_images_names(tmp_path):
    capture(tmp_path / "in")
    scene = opened(tmp_path / "in", intrinsics=LENS)
    write_subset(scene, {"indices": [5, 0]}, tmp_path / "out")
    table = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert [frame["file_path"] for frame in table["frames"]] == [f"images/{scene.train.names[i]}" for i in (0, 5)]


def test_other_formats_keep_their_folders(tmp_path, small_room):
    """A trajectory beside transforms.json is no reason to read it, nor is a file of other numbers."""
    import shutil

    shutil.copytree(small_room, tmp_path / "room")
    capture(tmp_path / "in")
    for path in (tmp_path / "in" / "images").iterdir():
        shutil.copy(path, tmp_path / "room")
    shutil.copy(tmp_path / "in" / "traj.tum", tmp_path / "room" / "traj.txt")
    assert detect(tmp_path / "room") == "transforms"
    file = tmp_path / "in" / "traj.tum"
    text = file.read_text()
    for other in ("1 2 3\n", "a b c d e f g h\n", ""):
        file.write_text(other)
        assert detect(tmp_path / "in") == "images"
    file.write_text(text)
    assert detect(tmp_path / "in") == "trajectory"
    (tmp_path / "in" / "trajectory.txt").write_text(text)  # which of the two?
    assert detect(tmp_path / "in") == "images"


def test_text_files_as_windows_and_spreadsheets_write_them(tmp_path):
    capture(tmp_path)
    wanted = opened(tmp_path).train.cameras.c2w
    lines = (tmp_path / "traj.tum").read_text().splitlines()
    head = "timestamp,tx,ty,tz,qx,qy,qz,qw"
    text = "\ufeff" + "\r\n".join([head, *(line.replace(" ", ",") for line in lines[1:]), "", ""])
    (tmp_path / "traj.tum").write_text(text, newline="", encoding="utf-8")
    np.testing.assert_array_equal(opened(tmp_path, poses=str(tmp_path / "traj.tum")).train.cameras.c2w, wanted)


@pytest.mark.parametrize(
    ("row", "text", "words"),
    [
        (3, "1 2 3", "line 5 has 3 numbers"),
        (3, "1 2 3 4 5 6 7 x", "line 5: 'x' is no number"),
        (3, "1311868164 1 2 3 0 0 0 0", "line 5: .* quaternion"),
        (3, "1311868164 1 2 3 0.1 0.2 0.3 4", "line 5: .* quaternion"),
        (None, "", "no numbers"),
        (None, "1 2 3\n4 5 6", "3 numbers, expected 8"),
        (None, "1 0 0 0 0 1 0 0 0 0 1 0\n" * 3, "3 rows for 12 images"),
        (None, "1 0 0 0 0 1 0 0 0 0 1 0\n" * 11 + "1 0 0 0 0 2 0 0 0 0 1 0\n", "line 12 is no rigid motion"),
        (None, "0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n", "no image has a pose within"),
    ],
)
def test_a_bad_row_is_named_with_its_line(tmp_path, row, text, words):
    capture(tmp_path)
    lines = (tmp_path / "traj.tum").read_text().splitlines()
    if row is not None:
        lines[row + 1] = text
        text = "\n".join(lines)
    (tmp_path / "bad.txt").write_text(text)
    with pytest.raises(UserError, match=words) as error:
        opened(tmp_path, poses=str(tmp_path / "bad.txt"))
    assert "bad.txt" in str(error.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"poses": "/nowhere.tum"}, "missing"),
        ({"poses": "."}, "a folder"),
        ({"times": "/nowhere.txt"}, "cannot be read"),
        ({"intrinsics": "1,2,3"}, "3 numbers"),
        ({"intrinsics": "1,2,3,x"}, "should be numbers"),
        ({"intrinsics": "0,2,3,4"}, "focal"),
        ({"intrinsics": "500,500,320,240"}, "641 x 481"),
        ({"intrinsics": LENS, "format": "colmap"}, "not of format 'colmap'"),
    ],
)
def test_wrong_options_end_in_a_sentence(tmp_path, options, words):
    capture(tmp_path)
    with pytest.raises(UserError, match=words):
        opened(tmp_path, **options)


def test_matrices_have_the_times_of_all_images_or_none(tmp_path):
    """KITTI's times.txt is a time for each image."""
    _, positions, turns = known(walk("made up"))
    for i in range(N):
        picture(tmp_path / f"{i:06d}.png", i)
    np.savetxt(tmp_path / "poses.txt", matrices(positions, turns)[:N, :3].reshape(N, 12))
    np.savetxt(tmp_path / "times.txt", 0.1 * np.arange(N))
    told = {"poses": str(tmp_path / "poses.txt"), "times": str(tmp_path / "times.txt")}
    np.testing.assert_allclose(known(opened(tmp_path, **told).train.times), 0.1 * np.arange(N))
    (tmp_path / "times.txt").write_text("0.5 000003.png")
    assert opened(tmp_path, **told).train.times is None


def test_intrinsics_are_not_for_captures_that_have_them(small_room):
    with pytest.raises(UserError, match="not of format 'transforms'"):
        opened(small_room, intrinsics=LENS)


def test_a_video_is_no_folder_of_images(tmp_path):
    capture(tmp_path)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    with pytest.raises(UserError, match="folder of images"):
        opened(tmp_path / "walk.mp4", poses=str(tmp_path / "traj.tum"))


def test_what_macos_leaves_beside_images_is_none(tmp_path):
    capture(tmp_path)
    for path in list((tmp_path / "images").iterdir()):
        path.with_name(f"._{path.name}").write_bytes(b"\0\5\x16\7")
    assert len(opened(tmp_path).train) == N


def test_images_without_any_time_say_what_to_give(tmp_path):
    capture(tmp_path, name=lambda i, stamp: f"{i:06d}.png")
    with pytest.raises(UserError, match="--times"):
        opened(tmp_path)


def test_options_without_a_trajectory_ask_for_one(tmp_path):
    picture(tmp_path / "a.png")
    picture(tmp_path / "b.png")
    with pytest.raises(UserError, match="--poses"):
        opened(tmp_path, intrinsics=LENS)


@pytest.mark.parametrize("seed", range(20))
def test_depth_is_associated_as_the_data_sets_script_does(seed):
    """associate() of associate.py in TUM's rgbd_benchmark_tools: every pair that is near enough, the nearest first."""
    rng = np.random.default_rng(seed)
    first, second = (np.sort(rng.uniform(0, 1, rng.integers(1, 40))) for _ in range(2))
    pairs = sorted((abs(a - b), a, b) for a in first for b in second if abs(a - b) < 0.02)
    left, right, wanted = set(first), set(second), {}
    for _, a, b in pairs:
        if a in left and b in right:
            left.remove(a)
            right.remove(b)
            wanted[a] = b
    found = _timed.associate(first, second)
    assert [None if j is None else second[j] for j in found] == [wanted.get(a) for a in first]
