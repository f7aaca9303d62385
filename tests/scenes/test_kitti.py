"""KITTI odometry: rows of poses.txt, projection matrices of calib.txt, and the camera beside the first."""

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from tests.scenes.test_transforms import opened
from tests.scenes.walks import matrices, walk
from viewbench.common.errors import UserError
from viewbench.scenes.subset import write_subset

N = 12
P0 = np.array([[707.0912, 0, 601.8873, 0], [0, 707.0912, 183.1104, 0], [0, 0, 1, 0]])
P2 = np.array([[707.0912, 0, 601.8873, 46.88783], [0, 707.0912, 183.1104, 0.1178601], [0, 0, 1, 0.006203223]])


def kitti(root, number="04", camera=2, numbers=range(N)):
    """A sequence in the folders of the data set; returns its own folder and the poses of camera 0."""
    _, positions, turns = known(walk("made up"))
    poses = matrices(positions, turns)[:N]
    folder = root / "sequences" / number
    (folder / f"image_{camera}").mkdir(parents=True)
    for i in numbers:
        Image.new("RGB", (1226, 370), (i, 0, 0)).save(folder / f"image_{camera}" / f"{i:06d}.png")
    (root / "poses").mkdir()
    np.savetxt(root / "poses" / f"{number}.txt", poses[:, :3].reshape(N, 12), fmt="%.6e")
    np.savetxt(folder / "times.txt", 0.1 * np.arange(N), fmt="%.6e")
    rows = (f"P{i}: " + " ".join(f"{value:.12e}" for value in (P0, P0, P2, P2)[i].ravel()) for i in range(4))
    (folder / "calib.txt").write_text("\n".join(rows))
    return folder, poses


@pytest.mark.parametrize("camera", [0, 2])
def test_a_point_falls_where_the_projection_matrix_says(tmp_path, camera):
    """The devkit's readme: x = P_i X for a point X in the coordinates of camera 0."""
    folder, poses = kitti(tmp_path, camera=camera)
    scene = opened(folder)
    assert (scene.format, len(scene.train)) == ("kitti", N)
    ahead = np.array([1.5, -0.4, 9.0, 1.0])
    u, v, w = (P2 if camera == 2 else P0) @ ahead
    for i, view in enumerate(scene.train.cameras):
        x, y, z, _ = view.world_to_camera()[0] @ poses[i] @ ahead
        # Its pixels are counted from the centre of the first one, ours from its corner.
        np.testing.assert_allclose(view.fx[0] * x / z + view.cx[0] - 0.5, u / w, atol=2e-3)  # six digits
        np.testing.assert_allclose(view.fy[0] * y / z + view.cy[0] - 0.5, v / w, atol=2e-3)
    np.testing.assert_allclose(known(scene.train.times), 0.1 * np.arange(N))


def test_a_part_of_the_images_has_the_poses_of_their_numbers(tmp_path):
    whole, _ = kitti(tmp_path / "whole")
    part, _ = kitti(tmp_path / "part", numbers=range(1, N, 3))
    np.testing.assert_array_equal(opened(part).train.cameras.c2w, opened(whole).train.cameras.c2w[1::3])
    np.testing.assert_array_equal(known(opened(part).train.times), known(opened(whole).train.times)[1::3])


def test_a_linked_sequence_has_its_poses(tmp_path):
    folder, _ = kitti(tmp_path / "kitti")
    (tmp_path / "office").symlink_to(folder)
    (tmp_path / "other" / "sequences").mkdir(parents=True)
    (tmp_path / "other" / "sequences" / "04").symlink_to(folder)
    np.savetxt(tmp_path / "kitti" / "poses" / "05.txt", np.tile(np.eye(4)[:3].reshape(1, 12), (N, 1)))
    (tmp_path / "kitti" / "sequences" / "05").symlink_to(folder)  # the name in use comes first
    for linked in ("office", "other/sequences/04"):
        np.testing.assert_array_equal(opened(tmp_path / linked).train.cameras.c2w, opened(folder).train.cameras.c2w)
    assert np.ptp(opened(tmp_path / "kitti" / "sequences" / "05").train.cameras.positions, axis=0).max() == 0


def test_the_subset_is_written_as_transforms(tmp_path):
    folder, _ = kitti(tmp_path / "in")
    scene = opened(folder)
    assert write_subset(scene, {"indices": [7, 3]}, tmp_path / "out")[0] == "transforms"
    np.testing.assert_allclose(opened(tmp_path / "out").train.cameras.c2w, scene.train.cameras.c2w[[3, 7]], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: (folder / "calib.txt").write_text("P0: 1 2 3"), "no line P2"),
        (lambda folder: (folder / "calib.txt").write_text("P2: 1 2 3"), "line 1"),
        (lambda folder: (folder / "times.txt").write_text("0\n1\n"), "2 times for 12"),
        (lambda folder: (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n"), "has no pose"),
        (lambda folder: (folder / "poses.txt").write_text("1 0 0\n"), "expected the 12"),
        (lambda folder: (folder / "image_2" / "a.png").write_bytes(b""), "named by its number"),
    ],
)
def test_a_broken_file_is_named(tmp_path, change, words):
    folder, _ = kitti(tmp_path)
    change(folder)
    with pytest.raises(UserError, match=words):
        opened(folder)
