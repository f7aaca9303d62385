"""ScanNet++: the DSLR's pictures with the data set's test views, masks and points, and the iPhone's."""

import json
import shutil

import numpy as np
import pycolmap
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from tests.conftest import known
from tests.nerfstudio_code import dataparser
from tests.scenes.test_rgbd import tum
from tests.scenes.test_transforms import opened
from tests.scenes.walks import matrices, walk
from viewbench.common.errors import UserError
from viewbench.scenes.formats.scannetpp import detect
from viewbench.scenes.images import load_images
from viewbench.scenes.subset import write_subset
from viewbench.scenes.types import OPENCV

SIZE = (96, 64)
TRAIN = [f"DSC{number:05d}.JPG" for number in (3, 20, 100, 99, 7, 8)]  # in no order, as the data set lists them
TEST = [f"DSC{number:05d}.JPG" for number in (500, 501)]
FISHEYE = {"camera_model": "OPENCV_FISHEYE", "k1": 0.05, "k2": -0.01, "k3": 0.002, "k4": -0.001}
HEAD = {"fl_x": 70.0, "fl_y": 71.0, "cx": 48.5, "cy": 31.5, "w": SIZE[0], "h": SIZE[1], "has_mask": True}


def poses():
    """World-to-camera of COLMAP, by name."""
    _, positions, turns = known(walk("made up"))
    made = np.linalg.inv(matrices(3 * positions, turns)[: 20 * (len(TRAIN) + len(TEST)) : 20])
    return dict(zip([*TRAIN, *TEST], made, strict=True))


def nerfstudio(world_to_camera):
    """transform_matrix as nerfstudio's colmap_to_json (process_data/colmap_utils.py) has it: the world is turned."""
    pose = np.linalg.inv(world_to_camera) @ OPENCV
    pose = pose[[0, 2, 1, 3]]
    pose[2] *= -1
    return pose


def picture(path, mode="RGB", size=SIZE, value=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new(mode, size, value).save(path)


def colmap(folder):
    """A model of the fisheye pictures with points that the views of their tracks really see."""
    model = pycolmap.Reconstruction()
    params = [HEAD[key] for key in ("fl_x", "fl_y", "cx", "cy")] + [FISHEYE[f"k{i}"] for i in range(1, 5)]
    camera = pycolmap.Camera(camera_id=1, model="OPENCV_FISHEYE", width=SIZE[0], height=SIZE[1], params=params)
    model.add_camera_with_trivial_rig(camera)
    xyz = np.random.default_rng(0).normal(0, 2, (30, 3))
    for number, (name, pose) in enumerate(poses().items(), start=1):
        rotation = Rotation.from_matrix(pose[:3, :3]).as_quat()
        image = pycolmap.Image(name=name, camera_id=1, image_id=number)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.zeros(2)) for _ in xyz])
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), pose[:3, 3]))
    tracks = []
    for i, place in enumerate(xyz):
        seen = [number for number in range(1, len(poses()) + 1) if (i + number) % 4 == 0]
        track = pycolmap.Track()
        for number in seen:
            track.add_element(number, i)
        model.add_point3D(place, track, np.array([i, 0, 0], np.uint8))
        tracks.append([list(poses())[number - 1] for number in seen])
    folder.mkdir(parents=True)
    model.write_text(folder)
    return xyz, tracks


def dslr(root, undistorted=True):
    """The folders of the data set's release and, with `undistorted`, what the toolkit's dslr/undistort.py adds."""

    def frame(name):
        row = {"file_path": name, "mask_path": name.replace(".JPG", ".png"), "is_bad": name == TRAIN[1]}
        return {**row, "transform_matrix": nerfstudio(poses()[name]).tolist()}

    folder = root / "dslr"
    table = {**HEAD, **FISHEYE, "frames": [*map(frame, TRAIN)], "test_frames": [*map(frame, TEST)]}
    (folder / "nerfstudio").mkdir(parents=True)
    (folder / "nerfstudio" / "transforms.json").write_text(json.dumps(table))
    (folder / "train_test_lists.json").write_text(json.dumps({"train": TRAIN, "test": TEST, "has_masks": True}))
    kinds = ["resized_images"] + ["resized_undistorted_images"] * undistorted
    masks = ["resized_anon_masks"] + ["resized_undistorted_masks"] * undistorted
    for name in (*TRAIN, *TEST):
        for kind in kinds:
            picture(folder / kind / name)
        for kind in masks:
            picture(folder / kind / name.replace(".JPG", ".png"), "L", value=255)
    if undistorted:  # main() extends the training frames by the test frames, in place, and writes them both
        new = {
            **table,
            "fl_x": 50.0,
            "fl_y": 51.0,
            "camera_model": "PINHOLE",
            **dict.fromkeys(("k1", "k2", "k3", "k4"), 0),
        }
        new["frames"] = [*table["frames"], *table["test_frames"]]
        (folder / "nerfstudio" / "transforms_undistorted.json").write_text(json.dumps(new))
    return folder


@pytest.mark.parametrize("part", [True, False])
def test_undistorted_pictures_with_the_data_sets_test_views(tmp_path, part):
    folder = dslr(tmp_path / "355e5e32db")
    scene = opened(folder if part else folder.parent)
    prefix = "" if part else "dslr/"
    assert scene.format == "scannetpp"
    assert scene.train.names == tuple(f"{prefix}resized_undistorted_images/{name}" for name in sorted(TRAIN))
    assert scene.test.names == tuple(f"{prefix}resized_undistorted_images/{name}" for name in TEST)
    wanted = np.stack([nerfstudio(poses()[name]) for name in sorted(TRAIN)])
    np.testing.assert_array_equal(scene.train.cameras.c2w, wanted)
    assert (scene.train.lens, scene.train.cameras.distortion, scene.train.cameras.fx[0]) == ("", None, 50)
    masks = [known(path) for path in (*scene.train.masks, *scene.test.masks)]
    assert [path.parent.name for path in masks] == ["resized_undistorted_masks"] * 8
    assert [path.stem for path in masks] == [path.stem for path in (*scene.train.paths, *scene.test.paths)]
    assert any("1 training views are marked is_bad" in note for note in scene.notes)
    load_images(scene.train, np.arange(2), None)


def test_nerfstudios_own_reader_has_the_same_splits_and_poses(tmp_path):
    """Its ScanNetpp reads transforms.json as the data set has it, before any undistortion."""
    folder = dslr(tmp_path, undistorted=False)
    with dataparser("scannetpp_dataparser") as module:
        config = module.ScanNetppDataParserConfig(
            data=tmp_path, auto_scale_poses=False, center_method="none", orientation_method="none"
        )
        parsed = {split: config.setup().get_dataparser_outputs(split) for split in ("train", "test")}
    scene = opened(folder)
    for name, ours in (("train", scene.train), ("test", scene.test)):
        theirs = parsed[name]
        assert list(ours.paths) == list(theirs.image_filenames)
        np.testing.assert_allclose(theirs.cameras.camera_to_worlds.numpy(), ours.cameras.c2w[:, :3], atol=1e-6)
        np.testing.assert_allclose(theirs.cameras.fx.numpy()[:, 0], ours.cameras.fx)
        assert list(ours.masks) == list(theirs.mask_filenames)


def test_the_fisheye_pictures_can_be_chosen_and_not_trained_on(tmp_path):
    scene = opened(dslr(tmp_path, undistorted=False))
    assert scene.train.lens == "OPENCV_FISHEYE"
    assert known(scene.train.masks[0]).parent.name == "resized_anon_masks"
    assert any("undistort.py" in note for note in scene.notes)
    with pytest.raises(UserError, match="undistort"):
        load_images(scene.train, np.arange(2), None)
    with pytest.raises(UserError, match="undistort"):
        write_subset(scene, {"indices": [0]}, tmp_path / "out")


def test_the_subset_keeps_the_test_views_apart(tmp_path):
    scene = opened(dslr(tmp_path / "in").parent)
    assert write_subset(scene, {"indices": [4, 1]}, tmp_path / "out")[0] == "transforms"
    again = opened(tmp_path / "out")
    np.testing.assert_allclose(again.train.cameras.c2w, scene.train.cameras.c2w[[1, 4]], atol=1e-12)
    np.testing.assert_allclose(again.test.cameras.c2w, scene.test.cameras.c2w, atol=1e-12)


def test_points_are_in_the_world_of_the_poses_and_seen_by_two_training_views(tmp_path):
    folder = dslr(tmp_path)
    xyz, tracks = colmap(folder / "colmap")
    scene = opened(tmp_path)
    points = known(scene.points)
    kept = [i for i, names in enumerate(tracks) if len(set(names) - set(TEST)) >= 2]
    assert sorted(points.rgb[:, 0].tolist()) == kept
    order = {name: i for i, name in enumerate(sorted(TRAIN))}
    for place, colour, seen in zip(points.xyz, points.rgb, known(points.seen_by), strict=True):
        i = colour[0]
        assert seen.tolist() == sorted(order[name] for name in tracks[i] if name in order)
        for name in sorted(TRAIN):  # where COLMAP's camera has it
            ours = scene.train.cameras[order[name]].world_to_camera()[0] @ [*place, 1]
            np.testing.assert_allclose(ours, poses()[name] @ [*xyz[i], 1], atol=1e-6)
    table = json.loads((folder / "nerfstudio" / "transforms_undistorted.json").read_text())
    table["frames"][2]["transform_matrix"][0][3] += 1
    (folder / "nerfstudio" / "transforms_undistorted.json").write_text(json.dumps(table))
    moved = opened(tmp_path)
    assert moved.points is None
    assert any("different poses" in note for note in moved.notes)


def test_hidden_test_views_are_left_out_and_told(tmp_path):
    folder = dslr(tmp_path)
    for name in TEST:
        (folder / "resized_undistorted_images" / name).unlink()
    scene = opened(tmp_path)
    assert (len(scene.train), len(scene.test)) == (len(TRAIN), 0)
    assert any("2 test views" in note for note in scene.notes)


def iphone(root, aligned=True):
    """pose_intrinsic_imu.json as iphone/arkit_pcl.py of the toolkit reads it, and what it extracts."""
    table = {}
    for number, pose in enumerate(poses().values()):
        k = [[70.0 + number, 0, 48], [0, 70.0 + number, 32], [0, 0, 1]]
        name = f"frame_{10 * number:06d}"
        world = np.linalg.inv(pose).tolist()
        table[name] = {"timestamp": 7 + 0.1 * number, "intrinsic": k, "pose": world, "imu": {}}
        table[name] |= {"aligned_pose": world} if aligned else {}
        if number != 2:  # only every tenth frame, and not all of those, are extracted
            picture(root / "iphone" / "rgb" / f"{name}.jpg")
        picture(root / "iphone" / "depth" / f"{name}.png", "I;16", (24, 16))
    picture(root / "iphone" / "rgb_masks" / "frame_000010.png", "L")
    (root / "iphone" / "pose_intrinsic_imu.json").write_text(json.dumps(table))


def test_the_iphones_frames_project_as_its_script_does(tmp_path):
    """arkit_pcl.py: camera-to-world times inv(K) (x, y, 1) depth, so x is right, y down and z forward."""
    iphone(tmp_path)
    scene = opened(tmp_path)
    assert (scene.format, len(scene.train), scene.depth_unit) == ("scannetpp", 7, 0.001)
    left = [number for number in range(8) if number != 2]
    for i, number in enumerate(left):
        camera, pose = scene.train.cameras[i], np.linalg.inv(list(poses().values())[number])
        k = np.array([[70.0 + number, 0, 48], [0, 70.0 + number, 32], [0, 0, 1]])
        world = pose @ np.append(np.linalg.inv(k) @ [20, 50, 1] * 3.0, 1)
        x, y, z, _ = camera.world_to_camera()[0] @ world
        np.testing.assert_allclose([camera.fx[0] * x / z + camera.cx[0], camera.fy[0] * y / z + camera.cy[0]], [20, 50])
    assert [known(path).stem for path in scene.train.depths] == [path.stem for path in scene.train.paths]
    assert [path is not None for path in scene.train.masks] == [False, True] + [False] * 5
    np.testing.assert_allclose(known(scene.train.times), 7 + 0.1 * np.array(left))
    assert any("1 of 8" in note for note in scene.notes)


def test_of_both_the_dslr_comes_first_and_the_other_is_named(tmp_path):
    dslr(tmp_path)
    iphone(tmp_path)
    scene = opened(tmp_path)
    assert "dslr/" in scene.train.names[0]
    note = next(note for note in scene.notes if "iPhone" in note)
    assert str(tmp_path / "iphone") in note
    assert len(opened(tmp_path / "iphone").train) == 7


def test_the_iphones_own_transforms_are_taken_where_they_are(tmp_path):
    iphone(tmp_path)
    rows = [
        {"file_path": f"frame_{10 * i:06d}.jpg", "transform_matrix": nerfstudio(pose).tolist()}
        for i, pose in enumerate(poses().values())
        if i != 2
    ]
    (tmp_path / "iphone" / "nerfstudio").mkdir()
    table = {**HEAD, "camera_model": "OPENCV", "k1": 0.01, "k2": 0.0, "p1": 0.0, "p2": 0.0, "frames": rows}
    (tmp_path / "iphone" / "nerfstudio" / "transforms.json").write_text(json.dumps(table))
    scene = opened(tmp_path)
    np.testing.assert_array_equal(scene.train.cameras.c2w[1], rows[1]["transform_matrix"])
    assert known(scene.train.cameras.distortion)[0, 0] == 0.01
    assert known(scene.train.depths[0]).parent.name == "depth"


def edited(**changes):
    def change(root):
        file = root / "dslr" / "nerfstudio" / "transforms_undistorted.json"
        file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (edited(frames=[]), "no training frame"),
        (edited(frames={}), "no list 'frames'"),
        (edited(frames=[{"file_path": "../../a.jpg"}]), "frame 0 has no file_path"),
        (edited(test_frames=[1]), "has no file_path"),
        (edited(fl_x=None), "lacks fl_x"),
        (edited(w=192, h=128), "192 x 128"),
        (lambda root: (root / "dslr" / "train_test_lists.json").write_text("{}"), "no list 'test'"),
    ],
)
def test_a_broken_file_is_named(tmp_path, change, words):
    dslr(tmp_path)
    change(tmp_path)
    with pytest.raises(UserError, match=words):
        opened(tmp_path)


def test_folders_of_other_formats_are_left_to_them(tmp_path):
    """A sequence of TUM that was converted too has rgb/ and nerfstudio/transforms.json; so has the iPhone's part."""
    (tmp_path / "nerfstudio").mkdir()
    (tmp_path / "nerfstudio" / "transforms.json").write_text("{}")
    tum(tmp_path)
    assert opened(tmp_path).format == "tum-rgbd"
    folder = dslr(tmp_path / "scene")
    folder.rename(tmp_path / "only the pictures")
    assert opened(tmp_path / "only the pictures").format == "scannetpp"


def test_missing_folders_are_named(tmp_path):
    folder = dslr(tmp_path, undistorted=False)
    shutil.rmtree(folder / "resized_images")
    assert detect(tmp_path)
    with pytest.raises(UserError, match="resized_images"):
        opened(tmp_path)
    shutil.rmtree(folder)
    iphone(tmp_path, aligned=False)
    with pytest.raises(UserError, match="aligned_pose"):
        opened(tmp_path)
    shutil.rmtree(tmp_path / "iphone" / "rgb")
    with pytest.raises(UserError, match="prepare_iphone_data"):
        opened(tmp_path)
