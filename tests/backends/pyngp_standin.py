"""Stands in for instant-ngp's module pyngp: its names, its loader's conventions, and the nearest view as a render.

From instant-ngp's sources (src/nerf_loader.cu, nerf_loader.h, testbed.cu, testbed_nerf.cu, python_api.cu at commit
abe236e): frames are sorted by file_path; focal lengths are pixels of the image as it is on disk; a frame's cx is
divided by the same object's w; positions become 0.33 p + 0.5, the axes x, y, z become y, z, x, and the camera's y and
z turn round; aabb_scale is a power of two up to 128; screen_center is 1 - principal point, as shares of the size;
focal lengths of a render are shares of the resolution along fov_axis. A network's configuration is a file, or lies in
configs/nerf below the root directory, which without being told is found where ., .. or Python's folder has "scripts";
without a network no step can be made. Nothing is trained before there are pictures; a snapshot is loaded from a file
called .ingp or .msgpack, and has no pictures; a render is linear unless told otherwise, and over the background,
which is what a model shows where it has nothing (here: in the last row).
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

SCALE, OFFSET = 0.33, 0.5


def nerf_matrix_to_ngp(matrix):
    """(3, 4) from OpenGL axes in scene units to instant-ngp's."""
    result = np.array(matrix, dtype=np.float64)
    result[:, 1:3] *= -1
    result[:, 3] = result[:, 3] * SCALE + OFFSET
    return result[[1, 2, 0]]


class TrainMode:
    Nerf, Rfl, RflRelax = "Nerf", "Rfl", "RflRelax"


class _Training:
    __slots__ = ("near_distance", "train_mode")

    def __init__(self):
        self.train_mode = TrainMode.RflRelax


class _Nerf:
    __slots__ = ("render_min_transmittance", "training")

    def __init__(self):
        self.training = _Training()


def discover_root_dir():
    python = Path(sys.executable).parent
    for candidate in (Path(), Path(".."), python, python / ".."):
        if (candidate / "scripts").exists():
            return candidate
    return Path()


def to_linear(srgb):
    """The sRGB transfer function undone."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


class Testbed:
    """Only what the real class has; a wrong name is an AttributeError."""

    __slots__ = (
        "_camera",
        "_dataset",
        "_network",
        "_network_path",
        "_root_dir",
        "background_color",
        "exposure",
        "fov_axis",
        "loss",
        "nerf",
        "relative_focal_length",
        "render_near_distance",
        "screen_center",
        "shall_train",
        "snap_to_pixel_centers",
        "training_step",
    )

    def __init__(self):
        self.nerf = _Nerf()
        self.training_step, self.loss, self.shall_train, self.fov_axis = 0, 1.0, False, 1
        self.background_color, self.exposure = [0.0, 0.0, 0.0, 1.0], 0.0
        self._root_dir = self._network = None
        self._dataset = {}
        self._network_path = "base.json"

    @property
    def root_dir(self):
        if self._root_dir is None:
            self._root_dir = discover_root_dir()
        return str(self._root_dir)

    @root_dir.setter
    def root_dir(self, value):
        assert isinstance(value, str)  # the binding takes nothing else
        self._root_dir = Path(value)

    def _find_network(self, path):
        path = Path(path)
        inside = Path(self.root_dir) / "configs" / "nerf" / path
        return inside if not path.exists() and not path.is_absolute() and inside.exists() else path

    def reload_network_from_file(self, path=""):
        assert isinstance(path, str)
        if path and (self._find_network(path).exists() or not Path(self._network_path).exists()):
            self._network_path = path
        if not self._dataset:
            return  # no mode yet
        found = self._find_network(self._network_path)
        if found.exists():
            self._network = json.loads(found.read_text(encoding="utf-8"))
        # else a warning: "Network config path … does not exist."

    def load_training_data(self, path):
        file = Path(path)
        table = json.loads(file.read_text(encoding="utf-8"))
        side = table.get("aabb_scale", 1)
        if side & (side - 1) or not 0 < side <= 128:
            raise RuntimeError("NeRF dataset's `aabb_scale` must be a power of two")
        frames = []
        for frame in sorted(table["frames"], key=lambda frame: frame["file_path"]):
            image = file.parent / frame["file_path"]
            if not image.exists():
                raise RuntimeError(f"Could not find image file '{image}'.")
            width, height = Image.open(image).size
            focal = [frame["fl_x"], frame["fl_y"]]
            principal = [frame["cx"] / frame["w"], frame["cy"] / frame["h"]]
            matrix = nerf_matrix_to_ngp(np.array(frame["transform_matrix"])[:3])
            low, high = 0.5 - side / 2, 0.5 + side / 2
            if not np.all((matrix[:, 3] >= low) & (matrix[:, 3] <= high)):
                raise RuntimeError("camera outside of the box")
            assert np.asarray(Image.open(image)).dtype == np.uint8
            pixels = np.asarray(Image.open(image)).tolist()
            entry = {"matrix": matrix.tolist(), "focal": focal, "principal": principal}
            frames.append({**entry, "size": [width, height], "pixels": pixels})
        self._dataset = {"aabb_scale": side, "frames": frames}

    def frame(self):
        if self.shall_train and not self._dataset:
            self.shall_train = False
        if self.shall_train:
            if self._network is None:
                self.reload_network_from_file()
            if self._network is None:
                raise RuntimeError("Unable to create a neural network trainer.")
            assert self.nerf.training.train_mode == TrainMode.Nerf  # else run.py's schedule is needed
            if not self._dataset["frames"]:
                self.shall_train = False  # "generated 0 samples. Aborting training."
                return True
            time.sleep(0.001)
            self.training_step += 1
            self.loss = 1 / self.training_step
        return True

    def save_snapshot(self, path, include_optimizer_state=False, compress=True):
        # The pictures are what this model has learnt.
        snapshot = {**self._dataset, "network": self._network, "training_step": self.training_step}
        Path(path).write_text(json.dumps(snapshot), encoding="utf-8")

    def load_snapshot(self, path):
        assert Path(path).suffix in (".ingp", ".msgpack")
        # Comes with all that it was saved with, and a fresh `nerf`.
        self.nerf, self.fov_axis, self.exposure, self.background_color = _Nerf(), 1, 0.0, [1.0, 1.0, 1.0, 1.0]
        for name in ("relative_focal_length", "screen_center", "_camera"):
            setattr(self, name, None)
        self._dataset = json.loads(Path(path).read_text(encoding="utf-8"))

    def set_nerf_camera_matrix(self, matrix):
        assert np.shape(matrix) == (3, 4)
        self._camera = nerf_matrix_to_ngp(matrix)

    def render(self, width=1920, height=1080, spp=1, linear=True):
        """The view of the nearest training camera; its intrinsics have to be those that were set, as shares."""
        assert self.fov_axis == 0
        frames = self._dataset["frames"]
        nearest = min(frames, key=lambda frame: np.abs(np.array(frame["matrix"]) - self._camera).sum())
        assert np.allclose(np.array(nearest["focal"]) / nearest["size"][0], self.relative_focal_length)
        assert np.allclose(1 - np.array(nearest["principal"]), self.screen_center)
        picture = Image.fromarray(np.array(nearest["pixels"], dtype=np.uint8)).resize((width, height))
        colours = np.asarray(picture, dtype=np.float32) / 255
        colours = (to_linear(colours) if linear else colours) * 2**self.exposure
        colours[-1] = np.array(self.background_color[:3]) * self.background_color[3]
        return np.concatenate([colours, np.ones((height, width, 1))], axis=-1).astype(np.float32)
