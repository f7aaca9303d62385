"""What nerfstudio's own reader makes of the scenes that its example in environment.toml gets."""

import dataclasses
import json
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from plyfile import PlyData

from tests.backends.test_command import examples
from tests.nerfstudio_code import dataparser
from viewbench.backends import _subset
from viewbench.common.settings import load as load_settings
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene


@pytest.fixture(scope="module")
def reader():
    with dataparser("nerfstudio_dataparser") as module:
        yield module


def options_of(module, command: list[str]) -> dict:
    """The flags behind `nerfstudio-data` as fields of its configuration."""
    words = command[command.index("nerfstudio-data") + 1 :]
    fields = {item.name: item for item in dataclasses.fields(module.NerfstudioDataParserConfig)}
    found = {}
    for flag, value in zip(words[::2], words[1::2], strict=True):
        name = flag.removeprefix("--").replace("-", "_")
        assert name in fields, f"nerfstudio has no {flag}"
        found[name] = value
        if "bool" in str(fields[name].type):
            found[name] = {"True": True, "False": False}[value]
        elif value.isdigit():
            found[name] = int(value)
    return found


def read(module, folder: Path, split: str):
    command = [part.replace("{scene}", str(folder)) for part in examples()["splatfacto"]["train"]]
    options = options_of(module, command)
    parser = module.NerfstudioDataParserConfig(**{**options, "data": Path(options["data"])}).setup()
    # Open3D reads the points' file for it, and nothing else.
    seen = SimpleNamespace(io=SimpleNamespace(read_point_cloud=cloud))
    with mock.patch.dict(sys.modules, {"open3d": seen}):
        return parser.get_dataparser_outputs(split)


def cloud(path: str) -> SimpleNamespace:
    vertex = PlyData.read(path)["vertex"]
    xyz = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    rgb = np.stack([vertex[name] for name in ("red", "green", "blue")], axis=1)
    return SimpleNamespace(points=xyz.astype(np.float64), colors=rgb / 255)


def test_every_chosen_view_is_trained_on_where_it_is(reader, take_views, tmp_path):
    views = take_views(chosen=tuple(range(0, 400, 20)))
    points = (views.points.xyz, views.points.rgb)
    _subset.write(tmp_path, "transforms", views.cameras, views.images, points)
    for split in ("train", "val", "test"):
        found = read(reader, tmp_path, split)
        assert [Path(name).name for name in found.image_filenames] == [_subset.image_name(i) for i in range(20)]
        assert found.dataparser_scale == 1.0
        assert np.allclose(found.dataparser_transform.numpy(), np.eye(4)[:3])
        cameras = found.cameras
        assert np.allclose(cameras.camera_to_worlds.numpy(), views.cameras.c2w[:, :3], atol=1e-5)
        for theirs, ours in (("fx", "fx"), ("fy", "fy"), ("cx", "cx"), ("cy", "cy"), ("width", "width")):
            assert np.allclose(getattr(cameras, theirs)[:, 0].numpy(), getattr(views.cameras, ours), rtol=1e-6)
        assert not cameras.distortion_params.any()
    assert np.allclose(found.metadata["points3D_xyz"].numpy(), views.points.xyz, atol=1e-5)
    assert np.array_equal(found.metadata["points3D_rgb"].numpy(), views.points.rgb)


def test_cameras_to_render_come_back_in_their_order(reader, small_room, tmp_path):
    scene = open_scene(str(small_room), load_settings())
    _, cameras = load_images(scene.test, np.arange(len(scene.test)), 48)
    _subset.write(tmp_path, "transforms", cameras, None)
    found = read(reader, tmp_path, "test")
    assert np.allclose(found.cameras.camera_to_worlds.numpy(), cameras.c2w[:, :3], atol=1e-5)
    assert json.loads((tmp_path / "transforms.json").read_text())["camera_model"] == "PINHOLE"
