"""Whatever a file holds, a reader returns a scene or one sentence."""

import contextlib
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pycolmap
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from tests.conftest import known
from tests.scenes import test_euroc, test_kitti, test_rgbd, test_scannetpp, test_trajectory
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats.images import nominal_cameras
from viewbench.scenes.image_files import check_whole, image_size
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene
from viewbench.scenes.types import Split
from viewbench.scenes.validate import check_present

SETTINGS = settings_file.load()
QUICK = settings(
    derandomize=True,
    max_examples=60,
    deadline=None,
    suppress_health_check=cast(list[HealthCheck], list(HealthCheck)),
    database=None,
)
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers()
    | st.text(max_size=5)
    | st.sampled_from([1e400, 10**400, "\ud800", "a" * 300, "..", "/"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
KINDS = ["png", "jpg", "webp", "tif", "bmp"]
KEYS = [
    "frames",
    "fl_x",
    "w",
    "h",
    "camera_angle_x",
    "cx",
    "k1",
    "ply_file_path",
    "file_path",
    "transform_matrix",
    "time",
    "camera_model",
    "k3",
    "mask_path",
    "train_filenames",
    "val_filenames",
]


def survives(root):
    with contextlib.suppress(UserError):
        open_scene(str(root), SETTINGS)


@pytest.fixture(scope="module")
def room(small_room, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz") / "room"
    shutil.copytree(small_room, folder)
    return folder


@QUICK
@given(key=st.sampled_from(KEYS), value=JSON, deep=st.booleans())
def test_any_value_in_transforms(room, small_room, key, value, deep):
    table = json.loads((small_room / "transforms_train.json").read_text())
    (table["frames"][1] if deep else table)[key] = value
    (room / "transforms_train.json").write_text(json.dumps(table))
    survives(room)
    with contextlib.suppress(UserError):
        scene = open_scene(str(room), SETTINGS)
        check_present(scene)
        scene_sha256(scene)


@QUICK
@given(content=st.binary(max_size=60) | st.text(max_size=60).map(str.encode), name=st.sampled_from(["json", "ply"]))
def test_any_bytes_as_transforms_and_points(room, small_room, content, name):
    for file in ("transforms_train.json", "points3d.ply"):
        shutil.copy(small_room / file, room / file)
    (room / {"json": "transforms_train.json", "ply": "points3d.ply"}[name]).write_bytes(content)
    survives(room)


@QUICK
@given(
    changes=st.lists(st.tuples(st.integers(0, 3000), st.integers(0, 255)), max_size=8), suffix=st.sampled_from(KINDS)
)
def test_damaged_images(tmp_path_factory, changes, suffix):
    path = tmp_path_factory.mktemp("image") / f"a.{suffix}"
    pixels = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(path)
    damaged = bytearray(path.read_bytes())
    for place, value in changes:
        damaged[place % len(damaged)] = value
    path.write_bytes(damaged)
    for reader in (image_size, check_whole, lambda path: load_images(one_view(path), np.array([0]), 16)):
        with contextlib.suppress(UserError):
            reader(path)


def one_view(path):
    return Split((path.name,), (path,), nominal_cameras(np.array([[32, 24]])))


LAYOUTS = {
    **test_rgbd.FORMATS,
    "euroc": lambda root: test_euroc.euroc(root, 1),
    "kitti": test_kitti.kitti,
    "scannetpp": test_scannetpp.dslr,
    "iphone": test_scannetpp.iphone,
    "trajectory": test_trajectory.capture,
}


@pytest.mark.parametrize("form", LAYOUTS)
def test_any_bytes_in_the_files_of_other_formats(form, tmp_path):
    root = tmp_path / "capture"
    root.mkdir()
    LAYOUTS[form](root)
    suffixes = (".txt", ".json", ".csv", ".yaml", ".tum")
    files = sorted(path for path in root.parent.rglob("*") if path.suffix in suffixes)
    root = root / "sequences" / "04" if form == "kitti" else root

    @settings(QUICK, max_examples=40)
    @given(
        file=st.sampled_from(files),
        content=st.binary(max_size=40) | st.text("0123456789 .-enaifx#\n\t", max_size=60).map(str.encode),
        cut=st.floats(0, 1),
        replace=st.booleans(),
    )
    def check(file, content, cut, replace):
        original = file.read_bytes()
        try:
            file.write_bytes(content if replace else original[: int(cut * len(original))] + content)
            survives(root)
        finally:
            file.write_bytes(original)

    cast("Callable[[], None]", check)()


@pytest.mark.parametrize("form", ["bin", "txt"])
def test_damaged_colmap_models(small_room, tmp_path, form):
    """Bytes changed, and files cut, of a model with cameras, images, points, rigs and frames."""
    room = open_scene(str(small_room), SETTINGS)
    points = known(room.points)
    room = replace(room, points=replace(points, xyz=points.xyz[:50], rgb=points.rgb[:50]))
    write_scene(room, np.arange(6), tmp_path / "model", "colmap")
    folder = tmp_path / "model" / "sparse" / "0"
    if form == "txt":
        pycolmap.Reconstruction(folder).write_text(folder)
        for path in folder.glob("*.bin"):
            path.unlink()
    files = sorted(path for path in folder.iterdir() if path.suffix == f".{form}")

    @settings(QUICK, max_examples=100)
    @given(
        file=st.sampled_from(files),
        changes=st.lists(st.tuples(st.integers(0, 500), st.integers(0, 255)), max_size=6),
        cut=st.none() | st.integers(0, 300),
    )
    def check(file, changes, cut):
        original = file.read_bytes()
        damaged = bytearray(original)
        for place, value in changes:
            damaged[place % len(damaged)] = value
        try:
            file.write_bytes(damaged[:cut])
            survives(tmp_path / "model")
        finally:
            file.write_bytes(original)

    cast("Callable[[], None]", check)()
