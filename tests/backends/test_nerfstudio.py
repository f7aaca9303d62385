"""What nerfstudio's own reader and configurations make of its examples in environment.toml.

`make external` has its command line read them, and trains with the one that needs no GPU.
"""

import copy
import dataclasses
import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from plyfile import PlyData

from tests.backends.test_command import examples
from tests.nerfstudio_code import dataparser, methods
from viewbench.backends import _subset
from viewbench.common.settings import load as load_settings
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene


@pytest.fixture(scope="module")
def reader():
    with dataparser("nerfstudio_dataparser") as module:
        yield module


@pytest.fixture(scope="module")
def known():
    with methods() as configurations:
        yield configurations


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


@pytest.mark.parametrize("name", ["splatfacto", "nerfacto"])
def test_flags_of_the_examples_are_fields_of_the_method(known, name):
    """Each names a field that is there and gives it a value of its kind; the other fields are the method's own."""
    command = examples()[name]["train"]
    before, config = known[command[1]], copy.deepcopy(known[command[1]])
    for flag, values in flags_of(command[2 : command.index("nerfstudio-data")]):
        owner, field = field_of(config, flag)
        setattr(owner, field, like(getattr(owner, field), values))
    assert config.get_base_dir() == Path("cell", name, "run")
    assert config.pipeline.model.camera_optimizer.mode == "off"
    assert (config.machine.seed, config.max_num_iterations) == ("{seed}", "{iterations}")
    assert config.is_tensorboard_enabled(), "another would open a viewer, and wait in it"
    assert not config.steps_per_eval_batch + config.steps_per_eval_image + config.steps_per_eval_all_images
    if name == "splatfacto":
        assert config.pipeline.datamanager.train_cameras_sampling_seed == "{seed}"
        assert (config.pipeline.model.background_color, config.pipeline.model.num_downscales) == ("black", 0)
    else:
        assert (config.pipeline.model.implementation, config.machine.device_type) == ("torch", "cpu")
        assert not config.pipeline.model.use_appearance_embedding
        assert before.pipeline.model.use_appearance_embedding


def flags_of(words: list[str]) -> list[tuple[str, list[str]]]:
    """Flags and the values behind each."""
    found: list[tuple[str, list[str]]] = []
    for word in words:
        if word.startswith("--"):
            found.append((word, []))
        else:
            found[-1][1].append(word)
    return found


def field_of(config: Any, flag: str) -> tuple[Any, str]:
    """The object and the name of its field that a flag sets."""
    *path, field = flag.removeprefix("--").replace("-", "_").split(".")
    for part in path:
        config = getattr(config, part)
    assert field in {item.name for item in dataclasses.fields(config)}, f"nerfstudio has no {flag}"
    return config, field


def like(default: Any, values: list[str]) -> Any:
    """Words as a value of the same kind as the one that they replace; placeholders stay."""
    if values[0].startswith("{"):
        return values[0]
    if isinstance(default, bool):
        return {"True": True, "False": False}[values[0]]
    if isinstance(default, tuple):
        return tuple(int(value) for value in values)
    return int(values[0]) if isinstance(default, int) else values[0]
