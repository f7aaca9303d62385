import dataclasses
import json
import math
import shutil

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.settings import SceneEntry
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_subset
from viewbench.scenes.validate import check_present
from viewbench.selectors._run import run

SETTINGS = settings_file.load()
POSE = np.eye(4).tolist()


def write(folder, frames, size=(8, 6), **head):
    """A transforms.json with images of one colour each."""
    for number, frame in enumerate(frames):
        name = frame.get("image", frame.get("file_path"))
        if isinstance(name, str) and not name.startswith(("/", "..")):
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", size, (10 * number, 0, 0)).save(path, format="PNG")
    stripped = [{key: value for key, value in frame.items() if key != "image"} for frame in frames]
    (folder / "transforms.json").write_text(json.dumps({**head, "frames": stripped}), encoding="utf-8")
    return folder


def frames(*names):
    poses = []
    for number, name in enumerate(names):
        pose = np.eye(4)
        pose[0, 3] = number
        poses.append({"file_path": name, "transform_matrix": pose.tolist()})
    return poses


def opened(folder, **options):
    return open_scene(str(folder), SETTINGS, **options)


def test_blender_angles_and_missing_suffixes(tmp_path):
    listed = [{**frame, "image": f"{frame['file_path']}.png"} for frame in frames("images/b", "images/a")]
    scene = opened(write(tmp_path, listed, camera_angle_x=math.pi / 2))
    assert scene.train.names == ("images/b", "images/a")  # the order of the file is the order of the capture
    assert [path.name for path in scene.train.paths] == ["b.png", "a.png"]
    # half of 8 pixels over tan 45° is 4; one focal length for both axes; centre in the middle
    np.testing.assert_allclose([scene.train.cameras.fx, scene.train.cameras.fy], 4)
    assert (scene.train.cameras.cx[0], scene.train.cameras.cy[0]) == (4, 3)


def test_intrinsics_of_a_frame_come_before_those_of_the_file(tmp_path):
    listed = frames("a.png", "b.png")
    listed[1] |= {"fl_x": 7, "fl_y": 8, "cx": 1, "cy": 2}
    scene = opened(write(tmp_path, listed, fl_x=5, fl_y=6, w=8, h=6, k1=0.1))
    cameras = scene.train.cameras
    assert cameras.fx.tolist() == [5, 7]
    assert cameras.fy.tolist() == [6, 8]
    assert cameras.cx.tolist() == [4, 1]
    assert known(cameras.distortion)[:, 0].tolist() == [0.1, 0.1]


@pytest.mark.parametrize("name", ["with space.png", "quo'te\".png", "new\nline.png", "żółć/日本.png", "a;$(b).png"])
def test_any_name_just_works(tmp_path, name):
    scene = opened(write(tmp_path / "in", frames(name, "b.png"), fl_x=5))
    record = {"indices": [0], "names": [name]}
    write_subset(scene, record, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert again.train.names == (name,)
    assert Image.open(again.train.paths[0]).size == (8, 6)


def test_a_subset_is_the_same_scene_with_fewer_views(small_room, tmp_path):
    scene = opened(small_room)
    write_subset(scene, {"indices": [5, 2, 9]}, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert again.train.names == tuple(scene.train.names[i] for i in (2, 5, 9)), "in capture order"
    assert again.test.names == scene.test.names
    np.testing.assert_array_equal(again.train.cameras.c2w, scene.train.cameras.c2w[[2, 5, 9]])
    np.testing.assert_array_equal(again.train.times, known(scene.train.times)[[2, 5, 9]])
    np.testing.assert_allclose(known(again.points).xyz, known(scene.points).xyz, atol=1e-5)
    assert (tmp_path / "out" / "selection.json").is_file()
    assert all(path.is_symlink() for path in again.train.paths)
    write_subset(scene, {"indices": [1]}, tmp_path / "copied", links="copy")
    assert not any(path.is_symlink() for path in (tmp_path / "copied").rglob("*"))


def test_a_folder_that_is_not_empty_is_left_alone(small_room, tmp_path):
    scene = opened(small_room)
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(UserError, match="not empty"):
        write_subset(scene, {"indices": [1]}, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    with pytest.raises(UserError, match="capture itself"):
        write_subset(scene, {"indices": [1]}, small_room, force=True)
    with pytest.raises(UserError, match="capture itself"):
        write_subset(scene, {"indices": [1]}, small_room.parent, force=True)
    assert len(opened(small_room).train) == 12


def test_a_write_that_fails_leaves_nothing(small_room, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(small_room, copy)
    scene = opened(copy)
    scene.train.paths[3].unlink()
    with pytest.raises(UserError, match="missing"):
        write_subset(scene, {"indices": [1, 3]}, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy"]


def test_nerfstudio_lists_make_the_test_split_and_are_written_again(tmp_path):
    lists = {"train_filenames": ["a.png", "c.png", "d.png"], "val_filenames": ["b.png"], "applied_transform": [[1]]}
    scene = opened(write(tmp_path / "in", frames("a.png", "b.png", "c.png", "d.png"), fl_x=5, **lists))
    assert (scene.train.names, scene.test.names) == (("a.png", "c.png", "d.png"), ("b.png",))
    write_subset(scene, {"indices": [2, 0]}, tmp_path / "out")
    table = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert table["train_filenames"] == ["a.png", "d.png"]
    assert table["val_filenames"] == table["test_filenames"] == ["b.png"]
    assert table["applied_transform"] == [[1]]
    assert opened(tmp_path / "out").test.names == ("b.png",)


def test_a_held_out_split_of_a_single_file_is_written_as_lists(tmp_path):
    scene = opened(write(tmp_path / "in", frames("a.png", "b.png", "c.png", "d.png"), fl_x=5), holdout="every:2")
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert (again.train.names, again.test.names) == (("d.png",), ("a.png", "c.png"))


def test_transforms_val_is_the_test_split_where_there_is_no_other(small_room, tmp_path):
    shutil.copytree(small_room, tmp_path / "copy")
    (tmp_path / "copy" / "transforms_test.json").rename(tmp_path / "copy" / "transforms_val.json")
    assert len(opened(tmp_path / "copy").test) == 4


def test_images_outside_the_folder_only_when_asked(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    Image.new("RGB", (8, 6)).save(tmp_path / "a.png")
    write(folder, frames("../a.png", "b.png"), fl_x=5)
    with pytest.raises(UserError, match="--allow-outside"):
        opened(folder)
    scene = opened(folder, allow_outside=True)
    write_subset(scene, {"indices": [0, 1]}, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert again.train.names == ("images/00000_a.png", "b.png")
    assert all(path.is_file() for path in again.train.paths)


def test_frames_of_two_sizes_are_chosen_from_and_not_trained_on(tmp_path):
    listed = frames("a.png", "b.png", "c.png")
    listed[1] |= {"w": 16, "h": 12}
    folder = write(tmp_path / "in", listed, fl_x=5)
    Image.new("RGB", (16, 12)).save(folder / "b.png")
    scene = opened(folder)
    check_present(scene)
    record = run(scene, "maxmin", 2, 0, {"factors": ["pos", "ang"]})
    write_subset(scene, record, tmp_path / "out")
    assert len(opened(tmp_path / "out").train) == 2
    with pytest.raises(UserError, match="different sizes"):
        load_images(scene.train, np.arange(3), None)


def test_a_scene_of_the_settings_may_reach_outside_its_folder(tmp_path):
    (tmp_path / "in").mkdir()
    for name in ("a.png", "b.png"):
        Image.new("RGB", (8, 6)).save(tmp_path / name)
    folder = write(tmp_path / "in", frames("../a.png", "../b.png"), fl_x=5)
    entry = {"mine": SceneEntry(path=str(folder), allow_outside=True)}
    settings = dataclasses.replace(SETTINGS, scenes=entry)
    assert len(open_scene("mine", settings).train) == 2
    with pytest.raises(UserError, match="allow_outside = true"):
        opened(folder)


def test_hints_do_not_tell_what_was_just_done(tmp_path):
    folder = write(tmp_path / "in", frames("a.png", "b.png", "c.png", "d.png"), fl_x=5)
    for name in ("test", "train"):
        (folder / f"transforms_{name}.json").write_text((folder / "transforms.json").read_text())
    (folder / "transforms.json").rename(folder / "spare.json")
    (folder / "transforms_test.json").write_text(json.dumps({"fl_x": 5, "frames": frames("t.png")}))
    Image.new("RGB", (8, 6)).save(folder / "t.png")
    with pytest.raises(UserError, match="leave --holdout out"):
        opened(folder, holdout="every:2")
    entry = {"mine": SceneEntry(path=str(folder), holdout="every:2")}
    with pytest.raises(UserError, match=r"take `holdout` out of \[scenes\.mine\]") as error:
        open_scene("mine", dataclasses.replace(SETTINGS, scenes=entry))
    assert "--holdout" not in str(error.value)
    table = {"frames": frames("a\0.png"), "fl_x": 5}
    (folder / "transforms_train.json").write_text(json.dumps(table))
    with pytest.raises(UserError, match="no name of a file") as error:
        opened(folder, allow_outside=True)
    assert "--allow-outside" not in str(error.value)


SKEWED = [[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
BROKEN = {
    "no frames": ({"frames": 3}, "no list 'frames'"),
    "empty": ({"frames": []}, "no training views"),
    "no path": ({"frames": [{"transform_matrix": POSE}]}, "no file_path"),
    "outside": ({"frames": [{"file_path": "../a.png", "transform_matrix": POSE}]}, "leaves the scene folder"),
    "absolute": ({"frames": [{"file_path": "/etc/a.png", "transform_matrix": POSE}]}, "leaves the scene folder"),
    "no pose": ({"frames": [{"file_path": "a.png"}]}, "no transform_matrix"),
    "small pose": ({"frames": [{"file_path": "a.png", "transform_matrix": [[1]]}]}, "expected 4 x 4"),
    "text pose": ({"frames": [{"file_path": "a.png", "transform_matrix": "x"}]}, "no transform_matrix"),
    "nan pose": ({"frames": [{"file_path": "a.png", "transform_matrix": (np.eye(4) * np.nan).tolist()}]}, "NaN"),
    "skewed": ({"frames": [{"file_path": "a.png", "transform_matrix": SKEWED}]}, "no rigid motion"),
    "twice": ({"frames": [{"file_path": "a.png", "transform_matrix": POSE}] * 2}, "listed twice"),
    "no focal": ({"frames": [{"file_path": "a.png", "transform_matrix": POSE}], "fl_x": None}, "are no numbers"),
    "zero focal": ({"frames": [{"file_path": "a.png", "transform_matrix": POSE}], "fl_x": 0}, "focal length"),
    "list": ([], "no list 'frames'"),
}


@pytest.mark.parametrize("case", BROKEN, ids=str)
def test_a_broken_file_is_one_sentence(tmp_path, case):
    table, words = BROKEN[case]
    Image.new("RGB", (8, 6)).save(tmp_path / "a.png")
    if isinstance(table, dict) and "fl_x" not in table:
        table = {**table, "fl_x": 5}
    (tmp_path / "transforms.json").write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(UserError, match=words):
        opened(tmp_path)
