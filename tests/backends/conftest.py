"""Views of the generated room as backends get them, and a configured external program."""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from viewbench.backends._types import TrainingSet
from viewbench.common.settings import PACKAGE, Command, Settings
from viewbench.scenes.ply import read_points
from viewbench.scenes.types import Cameras, Points

ROOM = PACKAGE / "scenes" / "generated_room" / "human"
NEAREST = Path(__file__).with_name("nearest_view.py")
PYNGP = Path(__file__).with_name("pyngp_standin.py")


def nearest_command(**changes: object) -> Command:
    """The nearest-view program as a section of environment.toml."""
    values: dict = {
        "train": [
            *(sys.executable, str(NEAREST), "train", "--scene", "{scene}", "--out", "{out}"),
            *("--seed", "{seed}", "--iterations", "{iterations}"),
        ],
        "render": [
            *(sys.executable, str(NEAREST), "render", "--model", "{out}"),
            *("--cameras", "{cameras}", "--images", "{renders}"),
        ],
    }
    return Command(**{**values, **changes})


def settings_with(**commands: Command) -> Settings:
    """Settings in which these programs are configured."""
    return Settings(source=Path("environment.toml"), command=commands)


def make_checkout(folder: Path) -> Path:
    """A folder like a checkout of instant-ngp that has been built, with the stand-in for its module."""
    (folder / "build" / "CMakeFiles" / "pyngp.dir").mkdir(parents=True)  # what CMake makes before the module
    shutil.copy(PYNGP, folder / "build" / "pyngp.py")
    (folder / "configs" / "nerf").mkdir(parents=True)
    for name in ("base", "big"):
        (folder / "configs" / "nerf" / f"{name}.json").write_text(json.dumps({"encoding": name}), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def take_views() -> Callable[..., TrainingSet]:
    """Makes a TrainingSet of some frames of the generated room at a small size, with 200 points; tracks made up."""
    transforms = json.loads((ROOM / "transforms_train.json").read_text(encoding="utf-8"))
    rng = np.random.default_rng(7)
    cloud = read_points(ROOM / "points3d.ply")

    def take(chosen: tuple[int, ...] = (0, 130, 260), width: int = 48, seen_by: bool = False) -> TrainingSet:
        from PIL import Image

        frames = [transforms["frames"][index] for index in chosen]
        height = round(width * transforms["h"] / transforms["w"])
        images = []
        for frame in frames:
            with Image.open(ROOM / frame["file_path"]) as picture:
                small = picture.convert("RGB").resize((width, height), Image.Resampling.BOX)
                images.append(np.asarray(small, dtype=np.float32) / 255)
        cameras = cameras_of(np.array([frame["transform_matrix"] for frame in frames]), width, height)
        some = slice(None, None, len(cloud) // 200)
        xyz, rgb = cloud.xyz[some][:200], cloud.rgb[some][:200]
        tracks = tuple(rng.choice(400, 5, replace=False) for _ in xyz) if seen_by else None
        points = Points(xyz, rgb, tracks)
        names = tuple(frame["file_path"] for frame in frames)
        everyone = cameras_of(np.array([frame["transform_matrix"] for frame in transforms["frames"]]), width, height)
        chosen_array = np.array(chosen, dtype=np.int64)
        return TrainingSet("room", names, cameras, np.stack(images), points, chosen_array, everyone)

    def cameras_of(c2w: np.ndarray, width: int, height: int) -> Cameras:
        focal = width / (2 * np.tan(transforms["camera_angle_x"] / 2))
        same = np.ones(len(c2w))
        size = {"width": np.full(len(c2w), width), "height": np.full(len(c2w), height)}
        return Cameras(c2w, focal * same, focal * same, width / 2 * same, height / 2 * same, **size)

    return take
