"""Lens distortion: OpenCV's five parameters are read, taken out and written; other lenses are told, never ignored."""

from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from tests.conftest import known
from tests.scenes.test_rgbd import tum
from tests.scenes.test_transforms import frames, opened, write
from tests.scenes.test_written import colmap
from viewbench.common.errors import UserError
from viewbench.scenes.formats.tum_rgbd import CAMERAS
from viewbench.scenes.images import load_images
from viewbench.scenes.lenses import pinholes, undistorting, where, zoom
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.scenes.types import Cameras

K = [0.26, -0.95, -0.005, 0.003, 1.16]  # k1, k2, p1, p2, k3, about those of TUM's first camera


def test_every_coefficient_is_taken_out(tmp_path):
    """A smooth picture of the directions, drawn through OpenCV's formula, looks as a pinhole sees it."""
    width, height, focal = 160, 120, 130.0

    def picture(x, y):
        return 0.5 + 0.2 * np.sin(6 * x + 1) + 0.2 * np.cos(5 * y)

    grid = np.linspace(-0.75, 0.75, 401)
    x, y = np.meshgrid(grid, grid)
    k1, k2, p1, p2, k3 = K
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = focal * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + width / 2
    v = focal * (y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y) + height / 2
    from scipy.interpolate import LinearNDInterpolator

    rows, columns = np.mgrid[:height, :width] + 0.5
    seen = LinearNDInterpolator(np.stack([u.ravel(), v.ravel()], 1), picture(x, y).ravel())(columns, rows)
    head = dict(zip(("k1", "k2", "p1", "p2", "k3"), K, strict=True))
    folder = write(tmp_path, frames("a.png"), size=(width, height), fl_x=focal, **head)
    Image.fromarray(np.round(255 * np.nan_to_num(seen)).astype(np.uint8)).save(folder / "a.png")
    images, cameras = load_images(opened(folder).train, np.array([0]), None)
    assert cameras.distortion is None
    assert cameras.fx[0] == cameras.fy[0] > focal, "at the pincushion's own a border is unseen"
    wanted = picture((columns - width / 2) / cameras.fx[0], (rows - height / 2) / cameras.fy[0])
    assert np.abs(images[0, ..., 0] - wanted).max() < 0.02, "up to the last pixel of the border"


LENS = st.tuples(
    st.floats(-0.15, 0.3), st.floats(-0.2, 0.2), st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.floats(-0.1, 0.1)
)


def camera(lens, focal=1.0, centre=(0.5, 0.5), size=(64, 48)):
    """A camera with this lens; the focal length in widths, the centre in shares of the picture."""
    width, height = size
    return Cameras(
        c2w=np.eye(4)[None],
        fx=np.array([focal * width]),
        fy=np.array([focal * width]),
        cx=np.array([centre[0] * width]),
        cy=np.array([centre[1] * height]),
        width=np.array([width]),
        height=np.array([height]),
        distortion=np.array([lens]),
    )


@settings(deadline=None, max_examples=60)
@given(lens=LENS, focal=st.floats(0.8, 2.0), across=st.floats(0.4, 0.6), down=st.floats(0.4, 0.6))
def test_nothing_is_seen_past_the_border_and_no_more_is_lost_than_must_be(lens, focal, across, down):
    seen = camera(lens, focal, (across, down))
    factor = zoom(seen)
    row, column = undistorting(seen)
    assert row.min() >= 0
    assert row.max() <= 47
    assert column.min() >= 0
    assert column.max() <= 63
    if factor > 1:
        v, u = np.mgrid[:48, :64] + 0.5
        row, column = where(seen, factor - 2 / 1024, u, v)
        assert min(row.min(), column.min(), 47 - row.max(), 63 - column.max()) < 1e-9, "a smaller one sees past it"


@settings(deadline=None, max_examples=20)
@given(lens=LENS)
def test_pixels_are_looked_up_where_opencv_looks(lens):
    """cv2.initUndistortRectifyMap counts from the centre of the first pixel."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
    seen = camera(lens)
    made = pinholes(seen)

    def matrix(c):
        return np.array([[c.fx[0], 0, c.cx[0] - 0.5], [0, c.fy[0], c.cy[0] - 0.5], [0, 0, 1.0]])

    x, y = cv2.initUndistortRectifyMap(matrix(seen), np.array(lens), None, matrix(made), (64, 48), cv2.CV_32FC1)
    np.testing.assert_allclose(undistorting(seen), np.stack([y, x]), atol=1e-3)


def test_the_border_of_tum_is_not_smeared():
    """At the focal length of the data set's first camera 6 % of the pixels would be past its border."""
    fx, fy, cx, cy, *lens = CAMERAS["freiburg1"]
    seen = replace(camera(lens, fx / 640, ((cx + 0.5) / 640, (cy + 0.5) / 480), (640, 480)), fy=np.array([fy]))
    v, u = np.mgrid[:480, :640] + 0.5
    for at, share in ((where(seen, 1.0, u, v), 0.0596), (undistorting(seen), 0.0)):
        past = (at[0] < 0) | (at[0] > 479) | (at[1] < 0) | (at[1] > 639)
        assert past.mean() == pytest.approx(share, abs=1e-3)
    assert zoom(seen) < 1.07


def test_a_lens_that_folds_is_refused():
    with pytest.raises(UserError, match="cannot be taken out"):
        zoom(camera([-30.0, 0, 0, 0, 0]))


def test_cameras_of_several_lenses_have_each_its_own_pinhole():
    both = [camera([0.2, 0, 0, 0, 0]), camera([0.0, 0, 0, 0, 0]), camera([0.2, 0, 0, 0, 0])]
    joined = Cameras(*(np.concatenate([vars(one)[name] for one in both]) for name in vars(both[0])))
    made = pinholes(joined)
    assert made.distortion is None
    assert made.fx[0] == made.fx[2] == joined.fx[0] * zoom(both[0])
    assert made.fx[1] == joined.fx[1]


def test_the_data_sets_own_cameras_have_all_their_coefficients(tmp_path):
    root = tmp_path / "rgbd_dataset_freiburg1_room"
    root.mkdir()
    tum(root, (640, 480))
    (root / "camera.txt").unlink()
    distortion = known(opened(root).train.cameras.distortion)
    np.testing.assert_allclose(distortion[0], [0.262383, -0.953104, -0.005358, 0.002628, 1.163314])


@pytest.mark.parametrize("count", [4, 5])
def test_coefficients_survive_both_formats(tmp_path, count):
    lens = [*K[:count], *[0.0] * (5 - count)]
    head = dict(zip(("k1", "k2", "p1", "p2", "k3"), lens, strict=True))
    scene = opened(write(tmp_path / "in", frames("a.png", "b.png"), fl_x=5, **head))
    write_scene(scene, np.arange(2), tmp_path / "colmap", "colmap")
    write_scene(opened(tmp_path / "colmap"), np.arange(2), tmp_path / "back", "transforms")
    for folder in ("colmap", "back"):
        np.testing.assert_allclose(known(opened(tmp_path / folder).train.cameras.distortion), [lens] * 2)


@pytest.mark.parametrize(
    ("model", "params"),
    [
        ("OPENCV_FISHEYE", [10, 11, 6, 4, 0.1, 0, 0, 0]),
        ("SIMPLE_RADIAL_FISHEYE", [10, 6, 4, 0.1]),
        ("FULL_OPENCV", [10, 11, 6, 4, 0, 0, 0, 0, 0, 0.2, 0, 0]),
    ],
)
def test_a_capture_of_another_lens_is_thinned_and_not_trained_on(tmp_path, model, params):
    folder = colmap(tmp_path / "in", ["a.png", "b.png", "c.png", "d.png"], model=model, params=params)
    scene = opened(folder, holdout="every:2")
    assert (scene.train.lens, scene.test.lens) == (model, model)
    write_subset(opened(folder), {"indices": [2, 0]}, tmp_path / "out")
    assert opened(tmp_path / "out").train.lens == model
    with pytest.raises(UserError, match="undistort"):
        load_images(scene.train, np.array([0]), None)
    with pytest.raises(UserError, match=model):
        write_scene(scene, np.arange(1), tmp_path / "other", "transforms")


@pytest.mark.skipif(not hasattr(pycolmap.CameraModelId, "EQUIRECTANGULAR"), reason="pycolmap knows no panoramas yet")
def test_a_panorama_is_refused(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png"], model="EQUIRECTANGULAR", params=[12, 8])
    with pytest.raises(UserError, match=r"EQUIRECTANGULAR.*no focal length"):
        opened(folder)


@pytest.mark.parametrize("head", [{"camera_model": "OPENCV_FISHEYE", "k1": 0.1}, {"is_fisheye": True}, {"k4": 0.1}])
def test_so_is_one_in_transforms(tmp_path, head):
    scene = opened(write(tmp_path / "in", frames("a.png", "b.png"), fl_x=5, **head))
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    assert opened(tmp_path / "out").train.lens
    with pytest.raises(UserError, match="undistort"):
        load_images(scene.train, np.array([0]), None)


def test_two_lenses_in_turn_are_each_taken_out_by_their_own(tmp_path):
    listed = frames("a.png", "b.png", "c.png")
    for frame, k1 in zip(listed, (0.2, -0.1, 0.2), strict=True):
        frame["k1"] = k1
    folder = write(tmp_path, listed, size=(64, 48), fl_x=60.0)
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    for name in ("a.png", "b.png", "c.png"):
        Image.fromarray(noise).save(folder / name)
    split = opened(folder).train
    together, _ = load_images(split, np.arange(3), None)
    for i in range(3):
        alone, _ = load_images(split, np.array([i]), None)
        np.testing.assert_array_equal(together[i], alone[0])
    assert np.abs(together[0] - together[1]).max() > 0.01
