"""Stands in for instant-ngp's module pyngp: its names, its loader's conventions, and the nearest view as a render.

From instant-ngp's sources (src/nerf_loader.cu, nerf_loader.h, testbed.cu, python_api.cu at commit abe236e):
frames are sorted by file_path; focal lengths are pixels of the image as it is on disk; a frame's cx is divided by the
same object's w; positions become 0.33 p + 0.5, the axes x, y, z become y, z, x, and the camera's y and z turn round;
aabb_scale is a power of two up to 128; screen_center is 1 - principal point, as shares of the size; focal lengths of
a render are shares of the resolution along fov_axis.
"""

import json
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


class _Training:
    __slots__ = ("near_distance",)


class _Nerf:
    __slots__ = ("render_min_transmittance", "training")

    def __init__(self):
        self.training = _Training()


class Testbed:
    """Only what the real class has; a wrong name is an AttributeError."""

    __slots__ = (
        "_camera",
        "_dataset",
        "background_color",
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
            pixels = np.asarray(Image.open(image)).tolist()
            entry = {"matrix": matrix.tolist(), "focal": focal, "principal": principal}
            frames.append({**entry, "size": [width, height], "pixels": pixels})
        self._dataset = {"aabb_scale": side, "frames": frames}

    def frame(self):
        if self.shall_train:
            time.sleep(0.001)
            self.training_step += 1
            self.loss = 1 / self.training_step
        return True

    def save_snapshot(self, path, include_optimizer_state=False, compress=True):
        Path(path).write_text(json.dumps(self._dataset), encoding="utf-8")

    def load_snapshot(self, path):
        self._dataset = json.loads(Path(path).read_text(encoding="utf-8"))

    def set_nerf_camera_matrix(self, matrix):
        assert np.shape(matrix) == (3, 4)
        self._camera = nerf_matrix_to_ngp(matrix)

    def render(self, width=1920, height=1080, spp=1, linear=True):
        """The view of the nearest training camera; its intrinsics have to be those that were set, as shares."""
        assert not linear
        assert self.fov_axis == 0
        frames = self._dataset["frames"]
        nearest = min(frames, key=lambda frame: np.abs(np.array(frame["matrix"]) - self._camera).sum())
        assert np.allclose(np.array(nearest["focal"]) / nearest["size"][0], self.relative_focal_length)
        assert np.allclose(1 - np.array(nearest["principal"]), self.screen_center)
        picture = Image.fromarray(np.array(nearest["pixels"], dtype=np.uint8)).resize((width, height))
        colours = np.asarray(picture, dtype=np.float32) / 255
        return np.concatenate([colours, np.ones((height, width, 1), dtype=np.float32)], axis=-1)
