"""The scene folders that external trainers get: what they hold, read by other people's readers or by hand."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from plyfile import PlyData
from scipy.spatial.transform import Rotation

from tests.conftest import known
from viewbench.backends import _subset
from viewbench.common.errors import UserError
from viewbench.common.settings import Settings
from viewbench.scenes.load import open_scene


@pytest.fixture
def views(take_views):
    return take_views()


def test_every_layout_holds_the_chosen_images_in_order_and_no_other(views, tmp_path):
    for layout in _subset.LAYOUTS:
        _subset.write(tmp_path / layout, layout, views.cameras, views.images)
        files = sorted((tmp_path / layout / "images").iterdir())
        assert [file.name for file in files] == ["00000.png", "00001.png", "00002.png"]
        for file, image in zip(files, views.images, strict=True):
            assert np.abs(np.asarray(Image.open(file)) / 255.0 - image).max() <= 0.5 / 255 + 1e-6


def test_transforms_gives_poses_as_they_are_and_the_sizes_beside_the_principal_points(views, tmp_path):
    _subset.write(tmp_path, "transforms", views.cameras, views.images, extra={"aabb_scale": 4})
    written = json.loads((tmp_path / "transforms.json").read_text())
    assert written["aabb_scale"] == 4
    for frame, camera in zip(written["frames"], views.cameras, strict=True):
        assert np.array_equal(frame["transform_matrix"], camera.c2w[0])
        assert (frame["fl_x"], frame["cx"], frame["w"]) == (camera.fx[0], camera.cx[0], camera.width[0])
        assert (tmp_path / frame["file_path"]).is_file()


def test_colmap_model_is_read_by_colmap(views, tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    points = (views.points.xyz, views.points.rgb)
    _subset.write(tmp_path, "colmap", views.cameras, views.images, points)
    model = pycolmap.Reconstruction(str(tmp_path / "sparse" / "0"))
    assert (model.num_images(), model.num_points3D()) == (3, len(views.points))
    for index, expected in enumerate(views.cameras.world_to_camera()):
        image = next(image for image in model.images.values() if image.name == _subset.image_name(index))
        assert np.allclose(image.cam_from_world().matrix(), expected[:3], atol=1e-9)
        assert np.allclose(image.camera.params[:4], [getattr(views.cameras, k)[0] for k in ("fx", "fy", "cx", "cy")])


def test_points_are_a_cloud_with_normals_as_3dgs_readers_ask(views, tmp_path):
    _subset.write(tmp_path, "transforms", views.cameras, views.images, (views.points.xyz, views.points.rgb))
    file = json.loads((tmp_path / "transforms.json").read_text())["ply_file_path"]
    vertices = PlyData.read(str(tmp_path / file))["vertex"]
    assert np.allclose(np.stack([vertices[axis] for axis in "xyz"], axis=1), views.points.xyz, atol=1e-6)
    assert np.array_equal(np.stack([vertices[c] for c in ("red", "green", "blue")], axis=1), views.points.rgb)
    assert not any(vertices[normal].any() for normal in ("nx", "ny", "nz"))


@pytest.mark.parametrize("layout", _subset.LAYOUTS)
def test_our_own_readers_see_the_same_cameras(views, tmp_path, layout):
    _subset.write(tmp_path, layout, views.cameras, views.images, (views.points.xyz, views.points.rgb))
    scene = open_scene(str(tmp_path), Settings(source=tmp_path))
    assert scene.format == layout
    for field, array in vars(views.cameras).items():
        if array is not None:
            assert np.allclose(getattr(scene.train.cameras, field), array, atol=1e-9), field
    read, written = (xyz[np.lexsort(xyz.T)] for xyz in (known(scene.points).xyz, views.points.xyz))
    assert np.allclose(read, written, atol=1e-6)


def test_cameras_without_images_come_with_black_ones_of_their_size(views, tmp_path):
    _subset.write(tmp_path, "colmap", views.cameras.scaled(30), None)
    pixels = np.asarray(Image.open(tmp_path / "images" / "00002.png"))
    assert pixels.shape == (30, 30, 3)
    assert not pixels.any()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-4, 4), min_size=3, max_size=3))
def test_quaternion_is_that_of_scipy_up_to_sign(vector):
    rotation = Rotation.from_rotvec(vector)
    expected = np.roll(rotation.as_quat(), 1)  # the scalar first, which SciPy before 1.14 cannot be told
    got = _subset.quaternion(rotation.as_matrix())
    assert np.allclose(abs(got @ expected), 1, atol=1e-9)
    assert got[0] >= 0


def test_renders_that_are_missing_or_of_another_size_are_named(views, tmp_path):
    files = [tmp_path / _subset.image_name(index) for index in range(3)]
    for file in files[:2]:
        Image.new("RGB", (48, 48)).save(file)
    with pytest.raises(UserError, match=r"2 of 3 renders, '00002\.png'"):
        list(_subset.read_images(files, views.cameras, "tool"))
    Image.new("RGB", (48, 40)).save(files[2])
    with pytest.raises(UserError, match=r"'00002\.png' is 48 × 40 pixels, expected 48 × 48"):
        list(_subset.read_images(files, views.cameras, "tool"))
    files[2].write_text("no picture")
    with pytest.raises(UserError, match="cannot be read"):
        list(_subset.read_images(files, views.cameras, "tool"))
