"""A written transforms.json as the tools that it is for read it, with their default options.

Nerfstudio's reader is its own code; what the 3DGS authors' code does (scene/dataset_readers.py,
`readCamerasFromTransforms` and `readNerfSyntheticInfo`) is restated, since no package has it.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.nerfstudio_code import dataparser
from tests.scenes.test_euroc import euroc
from tests.scenes.test_kitti import kitti
from tests.scenes.test_rgbd import replica, scannet, seven, tum
from tests.scenes.test_scannetpp import dslr
from tests.scenes.test_trajectory import capture
from tests.scenes.test_transforms import frames, opened, write
from tests.scenes.test_written import files, picture
from viewbench.scenes.subset import write_scene, write_subset

NAMES = [f"images/frame_{number:05d}.png" for number in range(40)]  # as ns-process-data has them
LARGE = (1700, 4)  # above nerfstudio's 1600 pixels, where it looks for pictures of half the size


@pytest.fixture(scope="module")
def nerfstudio():
    """Nerfstudio's default reader."""
    with dataparser("nerfstudio_dataparser") as module:
        yield module


def outputs(module, folder: Path, split: str, **options):
    return module.NerfstudioDataParserConfig(data=folder, **options).setup().get_dataparser_outputs(split)


def names_of(module, folder: Path, split: str) -> list[str]:
    return [path.name for path in outputs(module, folder, split).image_filenames]


def processed(folder, size=(8, 6), **head):
    """A folder as `ns-process-data` writes it: images/, images_2/, masks/ and depths/ with their halves."""
    listed = frames(*NAMES)
    for frame in listed:
        name = Path(frame["file_path"]).name
        frame |= {"mask_path": f"masks/{name}", "depth_file_path": f"depths/{name}", "colmap_im_id": 7}
        for kind in ("images", "masks", "depths"):
            picture(folder / kind / name, size)
            picture(folder / f"{kind}_2" / name, (size[0] // 2, size[1] // 2))
    head = {"w": size[0], "h": size[1], "fl_x": 5.0, "fl_y": 5.0, "cx": size[0] / 2, "cy": size[1] / 2, **head}
    return write(folder, listed, size=size, camera_model="OPENCV", applied_transform=np.eye(4)[:3].tolist(), **head)


def test_all_chosen_views_are_trained_on(tmp_path, nerfstudio):
    """By default a tenth would be left out for evaluation."""
    scene = opened(processed(tmp_path / "in"))
    chosen = list(range(0, 40, 2))
    write_subset(scene, {"indices": chosen[::-1]}, tmp_path / "out")
    assert names_of(nerfstudio, tmp_path / "in", "train") != [Path(name).name for name in NAMES], "nerfstudio's default"
    assert names_of(nerfstudio, tmp_path / "out", "train") == [Path(NAMES[i]).name for i in chosen]
    assert 0 < len(names_of(nerfstudio, tmp_path / "out", "val")) <= 2
    again = opened(tmp_path / "out")
    assert (list(again.train.names), len(again.test)) == ([NAMES[i] for i in chosen], 0)


def test_test_views_are_no_training_views(tmp_path, nerfstudio):
    scene = opened(processed(tmp_path / "in"), holdout="every:8")
    write_subset(scene, {"indices": [3, 9, 20]}, tmp_path / "out")
    held = [Path(name).name for name in scene.test.names]
    assert names_of(nerfstudio, tmp_path / "out", "train") == [Path(scene.train.names[i]).name for i in (3, 9, 20)]
    assert names_of(nerfstudio, tmp_path / "out", "val") == names_of(nerfstudio, tmp_path / "out", "test") == held


def test_smaller_pictures_masks_and_depths_come_along(tmp_path, nerfstudio):
    """Above 1600 pixels nerfstudio takes images_2, and then masks_2 and depths_2 too, by their names alone."""
    scene = opened(processed(tmp_path / "in", LARGE))
    write_subset(scene, {"indices": [4, 7]}, tmp_path / "out")
    for folder, names in ((tmp_path / "in", None), (tmp_path / "out", ["frame_00004.png", "frame_00007.png"])):
        found = outputs(nerfstudio, folder, "train")
        groups = {
            "images_2": found.image_filenames,
            "masks_2": found.mask_filenames,
            "depths_2": found.metadata["depth_filenames"],
        }
        for name, paths in groups.items():
            assert all(path.parent.name == name and path.is_file() for path in paths)
            assert names is None or [path.name for path in paths] == names
        assert int(found.cameras.width[0]) == 850


def test_smaller_pictures_with_a_gap_stay_away(tmp_path, nerfstudio):
    folder = processed(tmp_path / "in", LARGE)
    (folder / "masks_2" / "frame_00007.png").unlink()
    _, notes = write_subset(opened(folder), {"indices": [4, 7]}, tmp_path / "out")
    assert "masks_2/frame_00007.png" in notes[0]
    found = outputs(nerfstudio, tmp_path / "out", "train")
    assert [path.parent.name for path in found.image_filenames] == ["images", "images"]
    assert all(path.is_file() for path in found.mask_filenames)


def test_three_lists_stay_three(tmp_path, nerfstudio):
    lists = {"train_filenames": NAMES[:20], "val_filenames": NAMES[20:25], "test_filenames": NAMES[25:30]}
    folder = processed(tmp_path / "in", **lists)
    scene = opened(folder)
    assert (len(scene.train), len(scene.test)) == (20, 5)
    assert "10 of 40 frames are in none of its lists" in scene.notes[0]
    write_subset(scene, {"indices": [2]}, tmp_path / "out")
    for split, wanted in (("train", NAMES[2:3]), ("val", NAMES[20:25]), ("test", NAMES[25:30])):
        assert names_of(nerfstudio, tmp_path / "out", split) == [Path(name).name for name in wanted]


def read_by_3dgs(folder: Path, name: str) -> list[tuple[Path, np.ndarray, float, tuple[int, int]]]:
    """Images, poses, angles and sizes as the 3DGS authors' code takes them."""
    contents = json.loads((folder / name).read_text())
    found = []
    for frame in contents["frames"]:
        c2w = np.array(frame["transform_matrix"])
        c2w[:3, 1:3] *= -1
        path = folder / (frame["file_path"] + ".png")
        with Image.open(path) as image:
            found.append((path, np.linalg.inv(c2w), contents["camera_angle_x"], image.size))
    return found


@pytest.mark.parametrize("make", [scannet, replica, seven, tum])
@pytest.mark.parametrize("links", ["absolute", "copy", "relative"])
def test_an_rgbd_set_opens_in_nerfstudio_and_in_3dgs(tmp_path, nerfstudio, make, links):
    root = tmp_path / "data" / "room0"
    root.mkdir(parents=True)
    make(root)
    scene = opened(root, holdout="every:4")
    for part in (scene.train.cameras, scene.test.cameras):  # the fixtures' cameras are anything; 3DGS wants them simple
        part.cx[:], part.cy[:], part.fy[:] = part.width / 2, part.height / 2, part.fx
    write_subset(scene, {"indices": [5, 2]}, tmp_path / "out", links=links)
    wanted = [Path(scene.train.names[i]).name for i in (2, 5)]
    assert names_of(nerfstudio, tmp_path / "out", "train") == wanted
    assert len(names_of(nerfstudio, tmp_path / "out", "test")) == len(scene.test)
    train = read_by_3dgs(tmp_path / "out", "transforms_train.json")
    assert [path.resolve().stem.split(".")[0] for path, *_ in train] == [name.split(".")[0] for name in wanted] or (
        links == "copy" and len(train) == 2
    )
    np.testing.assert_allclose(
        [pose for _, pose, *_ in train], scene.train.cameras.world_to_camera()[[2, 5]], atol=1e-9
    )
    width = scene.train.cameras.width[0]
    for _, _, angle, size in train:
        assert size[0] == width
        assert angle == pytest.approx(2 * math.atan(width / (2 * scene.train.cameras.fx[0])))
    assert len(read_by_3dgs(tmp_path / "out", "transforms_test.json")) == len(scene.test)
    again = opened(tmp_path / "out")
    assert (len(again.train), len(again.test)) == (2, len(scene.test))


def test_what_blenders_form_cannot_say_is_not_written_in_it(tmp_path):
    folder = processed(tmp_path / "in", k1=0.1)
    notes = write_scene(opened(folder), np.arange(3), tmp_path / "colmap", "colmap")
    assert notes == []
    notes = write_scene(opened(tmp_path / "colmap"), np.arange(3), tmp_path / "out", "transforms")
    assert "distortion" in notes[0]
    assert not [name for name in files(tmp_path / "out") if "blender" in name or "train" in name]


def test_depths_with_a_gap_are_not_named(tmp_path, nerfstudio):
    scannet(tmp_path / "in")
    scene = opened(tmp_path / "in")
    depths = tuple(picture(tmp_path / "d" / f"{i}.png") or tmp_path / "d" / f"{i}.png" for i in range(len(scene.train)))
    from dataclasses import replace

    whole = replace(scene, train=replace(scene.train, depths=depths), depth_unit=0.001)
    write_subset(whole, {"indices": [1, 3]}, tmp_path / "out")
    found = outputs(nerfstudio, tmp_path / "out", "train")
    assert all(path.is_file() for path in found.metadata["depth_filenames"])
    gap = replace(scene, train=replace(scene.train, depths=(*depths[:3], None, *depths[4:])))
    _, notes = write_subset(gap, {"indices": [1, 3]}, tmp_path / "gap")
    assert any("depth images" in note for note in notes)
    assert outputs(nerfstudio, tmp_path / "gap", "train").metadata["depth_filenames"] is None


OTHERS = {
    "euroc": lambda root: euroc(root),
    "kitti": lambda root: kitti(root),
    "scannetpp": lambda root: dslr(root),
    "trajectory": lambda root: capture(root),
}


@pytest.mark.parametrize("form", OTHERS)
def test_robots_captures_open_in_nerfstudio(tmp_path, nerfstudio, form):
    made = OTHERS[form](tmp_path / "in")
    root = made[0] if form == "kitti" else tmp_path / "in"
    scene = opened(root, **({"intrinsics": "50,51,31.5,23.5"} if form == "trajectory" else {}))
    assert scene.format == form
    write_subset(scene, {"indices": [4, 1, 3]}, tmp_path / "out")
    found = outputs(nerfstudio, tmp_path / "out", "train", orientation_method="none", center_method="none")
    order = np.argsort([str(tmp_path / "out" / "images" / scene.train.names[i]) for i in (1, 3, 4)])
    wanted = scene.train.subset(np.array([1, 3, 4])[order])
    assert all(path.is_file() for path in found.image_filenames)
    np.testing.assert_allclose(found.cameras.fx[:, 0], wanted.cameras.fx, rtol=1e-6)
    poses = np.array(found.cameras.camera_to_worlds) / [1, 1, 1, found.dataparser_scale]
    np.testing.assert_allclose(poses, wanted.cameras.c2w[:, :3], rtol=1e-4, atol=1e-4)


def test_blenders_form_opens_in_nerfstudio_and_3dgs(tmp_path):
    for split, count in (("train", 4), ("test", 2), ("val", 2)):
        listed = frames(*(f"./{split}/r_{number}" for number in range(count)))
        for frame in listed:
            picture(tmp_path / "in" / f"{frame['file_path']}.png")
        table = {"camera_angle_x": 1.0, "frames": listed}
        (tmp_path / "in" / f"transforms_{split}.json").write_text(json.dumps(table))
    write_subset(opened(tmp_path / "in"), {"indices": [3, 1]}, tmp_path / "out")
    assert [path.name for path, *_ in read_by_3dgs(tmp_path / "out", "transforms_train.json")] == ["r_1.png", "r_3.png"]
    with dataparser("blender_dataparser") as module:
        for split, count in (("train", 2), ("val", 2), ("test", 2)):
            parser = module.BlenderDataParserConfig(data=tmp_path / "out").setup()
            names = parser.get_dataparser_outputs(split).image_filenames
            assert len(names) == count
            assert all(path.is_file() for path in names)


@pytest.mark.parametrize(
    ("intrinsics", "words"), [("60,75,31.5,23.5", "focal lengths differ"), ("60,60,34.5,23.5", "not in the middle")]
)
def test_cameras_that_blenders_form_cannot_say_have_no_such_files(tmp_path, intrinsics, words):
    capture(tmp_path / "in")
    scene = opened(tmp_path / "in", intrinsics=intrinsics)
    _, notes = write_subset(scene, {"indices": [0, 1]}, tmp_path / "out")
    assert words in notes[0]
    assert not (tmp_path / "out" / "transforms_train.json").exists()


def test_masks_with_a_gap_are_not_named(tmp_path, nerfstudio):
    """Nerfstudio refuses such a file; of its own a capture keeps the masks, and nerfstudio opens the subset."""
    listed = frames(*NAMES[:4])
    listed[0]["mask_path"] = "masks/a.png"
    picture(tmp_path / "in" / "masks" / "a.png")
    head = {"w": 8, "h": 6, "fl_x": 5.0, "fl_y": 5.0, "cx": 4, "cy": 3}
    scene = opened(write(tmp_path / "in", listed, **head))
    _, notes = write_subset(scene, {"indices": [0, 1]}, tmp_path / "out")
    assert "masks are written and not named" in notes[0]
    assert outputs(nerfstudio, tmp_path / "out", "train").mask_filenames is None
