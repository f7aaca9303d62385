"""ScanNet, Replica, TUM RGB-D and 7-Scenes: one small capture laid out in each of their forms."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from tests.nerfstudio_code import dataparser
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats import _timed
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_subset
from viewbench.scenes.types import OPENCV

SETTINGS = settings_file.load()
N = 12  # more than ten, so that the order of numbers and that of letters differ


def poses(seed=0):
    """(N, 4, 4) camera-to-world with OpenCV axes, as all four formats have them."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(N, 3, 3)))
    q = q * np.sign(np.linalg.det(q))[:, None, None]
    made = np.tile(np.eye(4), (N, 1, 1))
    made[:, :3, :3], made[:, :3, 3] = q, rng.normal(size=(N, 3))
    return made


def image(path, number, size=(64, 48)):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size, (number, 0, 0)).save(path)


def text(path, array):
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, array, fmt="%.12g")


def quaternion(turn):
    """x, y, z, w of a rotation matrix, by its eigenvector of eigenvalue 1 in Bar-Itzhack's matrix."""
    m = turn
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    return np.linalg.eigh(k / 3)[1][:, -1]


def scannet(root):
    for number, pose in enumerate(poses()):
        image(root / "color" / f"{number}.jpg", number)
        text(root / "pose" / f"{number}.txt", pose)
    camera = np.eye(4)
    camera[0, 0], camera[1, 1], camera[0, 2], camera[1, 2] = 50, 51, 32, 24
    text(root / "intrinsic" / "intrinsic_color.txt", camera)


def replica(root):
    for number in range(N):
        image(root / "results" / f"frame{number:06d}.jpg", number)
        image(root / "results" / f"depth{number:06d}.png", number)
    text(root / "traj.txt", poses().reshape(N, 16))
    camera = {"camera": {"w": 64, "h": 48, "fx": 50, "fy": 51, "cx": 31.5, "cy": 23.5, "scale": 6553.5}}
    (root.parent / "cam_params.json").write_text(json.dumps(camera))


def tum(root, size=(64, 48)):
    lines, rows = ["# color images", "# timestamp filename"], []
    for number, pose in enumerate(poses()):
        image(root / "rgb" / f"{number}.png", number, size)
        lines.append(f"{100 + 0.1 * number:.4f} rgb/{number}.png")
        rows.append([100.005 + 0.1 * number, *pose[:3, 3], *quaternion(pose[:3, :3])])
        rows.append([100.04 + 0.1 * number, 9, 9, 9, 0, 0, 0, 1])  # a pose that belongs to no frame
    (root / "rgb.txt").write_text("\n".join(lines))
    text(root / "groundtruth.txt", rows)
    text(root / "camera.txt", [[50, 51, 31.5, 23.5]])


def seven(root):
    for number, pose in enumerate(poses()):
        folder = root / f"seq-{1 + number // 6:02d}"
        image(folder / f"frame-{number:06d}.color.png", number)
        text(folder / f"frame-{number:06d}.pose.txt", pose)
    text(root / "camera.txt", [[50, 51, 31.5, 23.5]])
    text(root / "depth_to_color.txt", np.eye(4))


FORMATS = {"scannet": scannet, "replica": replica, "tum-rgbd": tum, "seven-scenes": seven}


@pytest.fixture(params=FORMATS, ids=str)
def capture(request, tmp_path):
    root = tmp_path / "data" / "room0"
    root.mkdir(parents=True)
    FORMATS[request.param](root)
    return request.param, root


def opened(root):
    return open_scene(str(root), SETTINGS)


def test_poses_and_intrinsics_are_those_that_were_written(capture):
    name, root = capture
    scene = opened(root)
    assert scene.format == name
    np.testing.assert_allclose(scene.train.cameras.c2w, poses() @ OPENCV, atol=1e-6)
    assert (scene.train.cameras.fx[0], scene.train.cameras.fy[0]) == (50, 51)
    assert (scene.train.cameras.cx[0], scene.train.cameras.cy[0]) == (32, 24)
    colours = [np.asarray(Image.open(path).convert("RGB"))[0, 0, 0] for path in scene.train.paths]
    assert np.abs(np.array(colours, int) - np.arange(N)).max() <= 3  # jpg
    assert (scene.train.cameras.width[0], scene.train.cameras.height[0]) == (64, 48)


def test_the_subset_is_written_as_transforms(capture, tmp_path):
    _, root = capture
    scene = opened(root)
    assert write_subset(scene, {"indices": [7, 3]}, tmp_path / "out")[0] == "transforms"
    again = opened(tmp_path / "out")
    assert again.format == "transforms"
    np.testing.assert_allclose(again.train.cameras.c2w, scene.train.cameras.c2w[[3, 7]], atol=1e-12)
    np.testing.assert_allclose(again.train.cameras.fx, scene.train.cameras.fx[:2])
    assert all(path.is_file() for path in again.train.paths)


def test_lost_tracking_is_dropped_and_counted(tmp_path):
    scannet(tmp_path)
    for number in (3, 5):
        text(tmp_path / "pose" / f"{number}.txt", np.full((4, 4), -np.inf))
    scene = opened(tmp_path)
    assert len(scene.train) == N - 2
    assert "color/3.jpg" not in scene.train.names
    assert "2 of 12" in scene.notes[0]


def test_frames_far_from_any_pose_are_dropped(tmp_path):
    tum(tmp_path)
    file = tmp_path / "rgb.txt"
    file.write_text(file.read_text() + "\n200.0 rgb/0.png\n")
    scene = opened(tmp_path)
    assert len(scene.train) == N
    assert "1 of 13" in scene.notes[0]


def test_an_unknown_camera_says_what_to_write(tmp_path):
    tum(tmp_path)
    (tmp_path / "camera.txt").unlink()
    with pytest.raises(UserError, match=r"camera\.txt"):
        opened(tmp_path)


def test_split_files_make_the_test_split(tmp_path):
    seven(tmp_path)
    (tmp_path / "TrainSplit.txt").write_text("sequence1\n")
    (tmp_path / "TestSplit.txt").write_text("sequence2\n")
    scene = opened(tmp_path)
    assert (len(scene.train), len(scene.test), scene.holdout) == (6, 6, "given")
    (tmp_path / "TestSplit.txt").write_text("sequence3\n")
    with pytest.raises(UserError, match="seq-03"):
        opened(tmp_path)


def test_a_cut_image_is_not_written(tmp_path):
    scannet(tmp_path / "in")
    scene = opened(tmp_path / "in")
    path = scene.train.paths[2]
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(UserError, match=r"2\.jpg"):
        write_subset(scene, {"indices": [1, 2]}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def depth(path, number=0, size=(64, 48)):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("I;16", size, 1000 + number).save(path)


def values(paths):
    """What stands in each depth image."""
    return [None if path is None else int(np.asarray(Image.open(path))[0, 0]) for path in paths]


def test_scannets_depth_comes_along_in_another_size(tmp_path):
    """The exporter's depth is 640 x 480 beside pictures of 1296 x 968, with intrinsics of its own."""
    scannet(tmp_path)
    for number in range(N):
        depth(tmp_path / "depth" / f"{number}.png", number, (32, 24))
    half = np.diag([25, 25.5, 1, 1.0])
    half[:2, 2] = 16, 12
    text(tmp_path / "intrinsic" / "intrinsic_depth.txt", half)
    for name in ("color", "depth"):
        text(tmp_path / "intrinsic" / f"extrinsic_{name}.txt", np.eye(4))
    (tmp_path / "depth" / "5.png").unlink()
    text(tmp_path / "pose" / "3.txt", np.full((4, 4), -np.inf))
    scene = opened(tmp_path)
    assert scene.depth_unit == 0.001
    assert values(scene.train.depths) == [None if i == 5 else 1000 + i for i in range(N) if i != 3]
    assert any("1 of 11 frames have no depth image" in note for note in scene.notes)
    assert scene.train.subset([0, 4]).depths == (scene.train.depths[0], None)


# Of scene0000_00 and of a scan by another tablet: fx, fy, cx, cy of the colour and of the depth camera.
SCANS = [
    ((1169.621094, 1167.105103, 646.295044, 489.927032), (577.590698, 578.729797, 318.905426, 242.683609)),
    ((1170.187988, 1170.187988, 647.75, 483.75), (571.623718, 571.623718, 319.5, 239.5)),
]


@pytest.mark.parametrize(("colour", "of_depth"), SCANS)
def test_depth_of_real_scans_is_registered(tmp_path, colour, of_depth):
    scannet(tmp_path)
    for path in (tmp_path / "color").iterdir():
        image(path, 0, (1296, 968))
    depth(tmp_path / "depth" / "0.png", size=(640, 480))
    for name, (fx, fy, cx, cy) in (("color", colour), ("depth", of_depth)):
        text(
            tmp_path / "intrinsic" / f"intrinsic_{name}.txt",
            [[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        )
    assert values(opened(tmp_path).train.depths) == [1000] + [None] * (N - 1)


def test_nerfstudios_own_reader_of_scannet_has_the_same_frames(tmp_path, monkeypatch):
    scannet(tmp_path)
    for number in range(N):
        depth(tmp_path / "depth" / f"{number}.png", number)
    text(tmp_path / "pose" / "3.txt", np.full((4, 4), -np.inf))
    scene = opened(tmp_path)
    with dataparser("scannet_dataparser") as module:
        monkeypatch.setattr(module, "cv2", SimpleNamespace(imread=lambda path: np.asarray(Image.open(path))))
        config = module.ScanNetDataParserConfig(
            data=tmp_path, auto_scale_poses=False, center_method="none", load_3D_points=False, train_split_fraction=1.0
        )
        theirs = config.setup().get_dataparser_outputs("train")
    assert list(scene.train.paths) == theirs.image_filenames
    assert list(scene.train.depths) == theirs.metadata["depth_filenames"]
    assert scene.depth_unit == theirs.metadata["depth_unit_scale_factor"]
    np.testing.assert_allclose(theirs.cameras.camera_to_worlds.numpy(), scene.train.cameras.c2w[:, :3], atol=1e-6)


@pytest.mark.parametrize("wrong", ["view", "place", "shape"])
def test_depth_of_another_camera_is_left_out_with_a_note(tmp_path, wrong):
    scannet(tmp_path)
    depth(tmp_path / "depth" / "0.png", size=(32, 18) if wrong == "shape" else (32, 24))
    other = np.diag([20 if wrong == "view" else 25, 25.5, 1, 1.0])
    other[:2, 2] = 16, 12
    moved = np.eye(4)
    moved[0, 3] = 0.03 if wrong == "place" else 0
    if wrong != "shape":
        text(tmp_path / "intrinsic" / "intrinsic_depth.txt", other)
    text(tmp_path / "intrinsic" / "extrinsic_color.txt", np.eye(4))
    text(tmp_path / "intrinsic" / "extrinsic_depth.txt", moved)
    scene = opened(tmp_path)
    assert (scene.train.depths, scene.depth_unit) == ((), 0)
    assert any(note.startswith("depth images are left out") for note in scene.notes)


def test_replicas_depth_has_the_frames_numbers_and_the_camera_files_scale(tmp_path):
    root = tmp_path / "room0"
    root.mkdir()
    replica(root)
    for number in range(N):
        depth(root / "results" / f"depth{number:06d}.png", number)
    scene = opened(root)
    assert scene.depth_unit == 1 / 6553.5
    assert values(scene.train.depths) == [1000 + i for i in range(N)]
    file = tmp_path / "cam_params.json"
    table = json.loads(file.read_text())
    del table["camera"]["scale"]
    file.write_text(json.dumps(table))
    assert (opened(root).train.depths, opened(root).depth_unit) == ((), 0)
    assert any("'scale'" in note for note in opened(root).notes)


def test_a_part_of_replicas_frames_has_the_poses_of_their_numbers(tmp_path):
    root = tmp_path / "room0"
    root.mkdir()
    replica(root)
    for number in set(range(N)) - {1, 5, 10}:
        (root / "results" / f"frame{number:06d}.jpg").unlink()
    (root / "results" / "frame000001.jpg").rename(root / "results" / "frame000001.JPG")
    scene = opened(root)
    np.testing.assert_allclose(scene.train.cameras.c2w, poses()[[1, 5, 10]] @ OPENCV, atol=1e-6)
    (root / "results" / "frame000010.jpg").rename(root / "results" / "frame000099.jpg")
    with pytest.raises(UserError, match="3 frames and 12 poses"):
        opened(root)


def test_tums_depth_is_that_of_the_nearest_time(tmp_path):
    tum(tmp_path)
    lines = ["# depth maps"]
    for number in range(N):
        if number != 4:
            depth(tmp_path / "depth" / f"{number}.png", number)
            lines.append(f"{100.01 + 0.1 * number + 0.02 * (number == 7):.4f} depth/{number}.png")
    (tmp_path / "depth.txt").write_text("\r\n".join(lines), newline="")
    scene = opened(tmp_path)
    assert scene.depth_unit == 1 / 5000
    assert values(scene.train.depths) == [None if i in (4, 7) else 1000 + i for i in range(N)]
    assert any("2 of 12 frames have no depth image within" in note for note in scene.notes)
    assert not any("distorted" in note for note in scene.notes)
    text(tmp_path / "camera.txt", [[50, 51, 31.5, 23.5, 0.1, 0, 0, 0]])
    assert any("depth images are distorted" in note for note in opened(tmp_path).notes)


def test_times_in_nanoseconds_are_as_good(tmp_path):
    tum(tmp_path)
    before = opened(tmp_path).train
    for name in ("rgb.txt", "groundtruth.txt"):
        rows = [line.split(" ", 1) for line in (tmp_path / name).read_text().splitlines() if not line.startswith("#")]
        (tmp_path / name).write_text("".join(f"{round((float(t) + 1.3e9) * 1e9)} {rest}\n" for t, rest in rows))
    after = opened(tmp_path).train
    np.testing.assert_array_equal(after.cameras.c2w, before.cameras.c2w)
    np.testing.assert_allclose(known(after.times) - known(before.times), 1.3e9, rtol=1e-12)


def test_a_depth_image_belongs_to_one_frame():
    """Frames at 30 Hz and depth at 15: a script that took the nearest for each would use every image twice."""
    found = _timed.associate(np.array([0.0, 0.01, 0.05]), np.array([0.002, 0.07]))
    assert found == [0, None, None]  # 0.07 is 0.02 away, and no nearer


def test_seven_scenes_depth_falls_on_its_place_in_the_colour_picture(tmp_path):
    """setup_7scenes.py of ACE (github.com/nianticlabs/ace, datasets/): a depth pixel, 585 and the middle of the
    picture give a point of the depth camera, the calibration moves it to the colour camera, and 525 projects it. Its
    pose file, of the depth camera, gives the same point in the world, which our colour camera must see there."""
    calibration = np.array(
        [
            [9.9996518012567637e-01, 2.6765126468950343e-03, -7.9041012313000904e-03, -2.5558943178152542e-02],
            [-2.7409311281316700e-03, 9.9996302803027592e-01, -8.1504520778013286e-03, 1.0109636268061706e-04],
            [7.8819942130445332e-03, 8.1718328771890631e-03, 9.9993554558014031e-01, 2.0318321729487039e-03],
            [0, 0, 0, 1],
        ]
    )
    seven(tmp_path)
    for name in ("camera.txt", "depth_to_color.txt"):
        (tmp_path / name).unlink()
    for path in tmp_path.rglob("*.color.png"):
        image(path, 0, (640, 480))
        depth(path.with_name(path.name.replace("color", "depth")), size=(640, 480))
    scene = opened(tmp_path)
    u, v, metres = np.random.default_rng(0).uniform([0, 0, 0.5], [640, 480, 5], (50, 3)).T
    of_depth = np.stack([(u - 320) / 585 * metres, (v - 240) / 585 * metres, metres, np.ones(50)])
    x, y, z, _ = calibration @ of_depth
    wanted = np.stack([525 * x / z + 320, 525 * y / z + 240])
    assert np.abs(wanted - [u, v]).max() > 20  # the two cameras do not see the same
    for camera, pose in zip(scene.train.cameras, poses(), strict=True):
        x, y, z, _ = camera.world_to_camera()[0] @ pose @ of_depth
        np.testing.assert_allclose([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], wanted, atol=1e-4)
    assert scene.train.depths == ()
    assert [
        word for word in ("525", "another Kinect", "not registered") if not any(word in n for n in scene.notes)
    ] == []
    assert opened(tmp_path / "seq-01").train.cameras.fx[0] == 525


def test_ones_own_calibration_of_seven_scenes_is_another_capture(tmp_path):
    seven(tmp_path)
    hashes = {scene_sha256(opened(tmp_path))}
    assert opened(tmp_path).notes == ()
    text(tmp_path / "camera.txt", [[60, 61, 31.5, 23.5]])
    hashes.add(scene_sha256(opened(tmp_path)))
    moved = np.eye(4)
    moved[0, 3] = -0.025
    text(tmp_path / "depth_to_color.txt", moved)
    scene = opened(tmp_path / "seq-01")  # they are looked for above a sequence too
    np.testing.assert_allclose(scene.train.cameras.c2w, poses()[:6] @ np.linalg.inv(moved) @ OPENCV, atol=1e-6)
    assert len({*hashes, scene_sha256(opened(tmp_path))}) == 3
    text(tmp_path / "depth_to_color.txt", 2 * np.eye(4))
    with pytest.raises(UserError, match="no rigid motion"):
        opened(tmp_path)


RESIZED = {
    "scannet": ("intrinsic_color.txt", {}),
    "tum-rgbd": ("camera.txt", {}),
    "seven-scenes": ("camera.txt", {}),
    "replica": ("cam_params.json", {}),
}


@pytest.mark.parametrize("factor", [0.5, 2])
@pytest.mark.parametrize("form", RESIZED)
def test_intrinsics_of_pictures_of_another_size_are_named(tmp_path, form, factor):
    root = tmp_path / "data" / "room0"
    root.mkdir(parents=True)
    FORMATS[form](root)
    for path in root.rglob("*"):
        if path.suffix in (".jpg", ".png"):
            with Image.open(path) as picture:
                picture.resize((int(64 * factor), int(48 * factor))).save(path)
    with pytest.raises(UserError, match=f"64 x 48.* is {int(64 * factor)} x {int(48 * factor)}") as error:
        opened(root)
    assert RESIZED[form][0] in str(error.value)


def test_a_crop_is_no_resized_picture(tmp_path):
    """The middle of a picture that was cut on one side lies off the centre on one axis."""
    scannet(tmp_path)
    for path in (tmp_path / "color").iterdir():
        image(path, 0, (64, 30))
    assert opened(tmp_path).train.cameras.height[0] == 30


def test_frames_without_a_pose_file_are_dropped_and_counted(tmp_path):
    for form in ("scannet", "seven-scenes"):
        root = tmp_path / form
        root.mkdir()
        FORMATS[form](root)
        files = sorted(root.glob("pose/*.txt")) or sorted(root.glob("seq-*/*.pose.txt"))
        files[0].unlink()
        files[1].write_text("-1.#IND " * 16)  # how Windows wrote what is no number
        scene = opened(root)
        assert len(scene.train) == N - 2
        assert [note for note in scene.notes if "1 of 12 frames dropped" in note] == list(scene.notes)
        for file in files[1:]:
            file.unlink()
        with pytest.raises(UserError, match="has a pose file"):
            open_scene(str(root), SETTINGS, format=form)


@pytest.mark.parametrize("form", FORMATS)
def test_files_as_windows_writes_them_below_a_linked_folder(tmp_path, form):
    """A byte order mark, carriage returns, upper-case suffixes, what macOS leaves on other disks, and a link."""
    root = tmp_path / "data" / "room0"
    root.mkdir(parents=True)
    FORMATS[form](root)
    before = opened(root).train
    for path in sorted(root.parent.rglob("*")):
        if path.suffix == ".txt":
            path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
        elif path.suffix in (".png", ".jpg") and form != "tum-rgbd":
            path.rename(path.with_suffix(path.suffix.upper()))
            path.with_name(f"._{path.name}").write_bytes(b"\0\5\x16\7")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "linked").symlink_to(root)
    after = opened(tmp_path / "elsewhere" / "linked").train
    np.testing.assert_array_equal(after.cameras.c2w, before.cameras.c2w)
    assert [name.lower() for name in after.names] == list(before.names)


def test_a_heading_without_its_comment_sign(tmp_path):
    """As in the ground truth of freiburg1_xyz."""
    tum(tmp_path)
    file = tmp_path / "groundtruth.txt"
    before = opened(tmp_path).train.cameras.c2w
    file.write_text("# ground truth trajectory\ntimestamp tx ty tz qx qy qz qw\n" + file.read_text())
    np.testing.assert_array_equal(opened(tmp_path).train.cameras.c2w, before)


def test_the_camera_of_a_linked_sequence_is_known_by_either_name(tmp_path):
    for real, link in (("rgbd_dataset_freiburg3_office", "desk"), ("data", "freiburg3")):
        root = tmp_path / real
        root.mkdir()
        tum(root, (640, 480))
        (root / "camera.txt").unlink()
        (tmp_path / link).symlink_to(root)
        assert opened(tmp_path / link).train.cameras.fx[0] == 535.4


def test_a_bad_line_is_named(tmp_path):
    tum(tmp_path)
    file = tmp_path / "rgb.txt"
    text_before = file.read_text()
    for line in ("x y.png", "101.0", "nan rgb/0.png", "101.0 ../rgb/0.png"):
        file.write_text(f"{text_before}\n{line}\n")
        with pytest.raises(UserError, match=f"line {N + 3}"):
            opened(tmp_path)
