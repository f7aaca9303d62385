"""ScanNet, Replica, TUM RGB-D and 7-Scenes: one small capture laid out in each of their forms."""

import json

import numpy as np
import pytest
from PIL import Image

from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
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


def tum(root):
    lines, rows = ["# color images", "# timestamp filename"], []
    for number, pose in enumerate(poses()):
        image(root / "rgb" / f"{number}.png", number)
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
    assert write_subset(scene, {"indices": [7, 3]}, tmp_path / "out") == "transforms"
    again = opened(tmp_path / "out")
    assert again.format == "transforms"
    np.testing.assert_allclose(again.train.cameras.c2w, scene.train.cameras.c2w[[7, 3]], atol=1e-12)
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
