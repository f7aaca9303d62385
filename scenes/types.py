"""Posed images: the types that every reader returns and everything else takes.

Conventions: poses are camera-to-world, 4 x 4, float64, OpenGL axes (x right, y up, z back). Pixel centres are at
half-integers: the image spans [0, width] x [0, height] and its first pixel's centre is (0.5, 0.5).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

# OpenGL camera axes (x right, y up, z back) to OpenCV's (x right, y down, z forward); its own inverse.
OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
UNCALIBRATED = "uncalibrated"  # a `Split.lens`: poses are known, intrinsics are not


@dataclass(frozen=True)
class Cameras:
    """N pinhole cameras; indexable by integer, slice, mask or index array, always giving Cameras."""

    c2w: np.ndarray  # (N, 4, 4) float64, camera-to-world, OpenGL axes
    fx: np.ndarray  # (N,) float64, pixels
    fy: np.ndarray  # (N,) float64, pixels
    cx: np.ndarray  # (N,) float64, pixels
    cy: np.ndarray  # (N,) float64, pixels
    width: np.ndarray  # (N,) int64, pixels
    height: np.ndarray  # (N,) int64, pixels
    distortion: np.ndarray | None = None  # (N, 5) float64, OpenCV's k1, k2, p1, p2, k3; None where all are zero

    def __len__(self) -> int:
        return len(self.c2w)

    def __getitem__(self, index: Any) -> "Cameras":
        if isinstance(index, (int, np.integer)):
            index = [index]
        arrays: dict[str, Any] = {name: None if value is None else value[index] for name, value in vars(self).items()}
        return Cameras(**arrays)

    def __iter__(self) -> Iterator["Cameras"]:
        return (self[i] for i in range(len(self)))

    @property
    def positions(self) -> np.ndarray:
        """(N, 3) camera centres in scene units."""
        return self.c2w[:, :3, 3]

    @property
    def rotations(self) -> np.ndarray:
        """(N, 3, 3) camera-to-world rotations, OpenGL axes."""
        return self.c2w[:, :3, :3]

    @property
    def forward(self) -> np.ndarray:
        """(N, 3) unit viewing directions in the world."""
        return -self.c2w[:, :3, 2]

    def world_to_camera(self) -> np.ndarray:
        """(N, 4, 4) world-to-camera matrices with OpenCV axes (x right, y down, z forward)."""
        return np.linalg.inv(self.c2w @ OPENCV)

    def scaled(self, width: int) -> "Cameras":
        """The same cameras for images resized to `width` pixels, heights rounded to keep the aspect."""
        height = np.maximum(1, np.round(self.height * (width / self.width))).astype(np.int64)
        return self.resized(np.full_like(self.width, width), height)

    def resized(self, width: np.ndarray, height: np.ndarray) -> "Cameras":
        """The same cameras for images resized to (N,) `width` x `height` pixels."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=self.cx * sx,
            cy=self.cy * sy,
            width=width,
            height=height,
        )


@dataclass(frozen=True)
class Split:
    """Frames in capture order."""

    names: tuple[str, ...]  # unique in the scene, as the format writes them
    paths: tuple[Path, ...]  # image files
    cameras: Cameras
    times: np.ndarray | None = None  # (N,) float64 seconds, where the format has them
    lens: str = ""  # camera model that is neither a pinhole nor OpenCV's: fit for selection, not for training
    depths: tuple[Path | None, ...] = ()  # depth images, one a frame (None where it has none); empty where none has
    masks: tuple[Path | None, ...] = ()  # masks, black where a pixel is not to be used; likewise

    def __len__(self) -> int:
        return len(self.names)

    def subset(self, indices: Sequence[int] | np.ndarray) -> "Split":
        """The frames at `indices`, in that order."""
        chosen = np.asarray(indices, dtype=np.int64)
        return Split(
            tuple(self.names[i] for i in chosen),
            tuple(self.paths[i] for i in chosen),
            self.cameras[chosen],
            None if self.times is None else self.times[chosen],
            self.lens,
            tuple(self.depths[i] for i in chosen) if self.depths else (),
            tuple(self.masks[i] for i in chosen) if self.masks else (),
        )


@dataclass(frozen=True)
class Points:
    """The scene's 3D points, where its format carries them."""

    xyz: np.ndarray  # (P, 3) float64, scene units
    rgb: np.ndarray  # (P, 3) uint8
    seen_by: tuple[np.ndarray, ...] | None = None  # per point, indices of the training views whose track it is in

    def __len__(self) -> int:
        return len(self.xyz)


@dataclass(frozen=True)
class Scene:
    """One capture, read. `details` is the reader's own, for the writer of the same format."""

    name: str
    root: Path
    format: str
    train: Split
    test: Split
    points: Points | None = None
    holdout: str = "given"  # where the test split came from: "given" by the format, or the rule that made it
    files: tuple[Path, ...] = ()  # what was read besides the images
    notes: tuple[str, ...] = ()  # what the reader dropped or assumed, for people
    posed: bool = True  # False for a folder of images or a video: poses are then the identity and mean nothing
    depth_unit: float = 0.0  # scene units that 1 in a depth image stands for; 0 where there are none or it is not known
    details: dict[str, Any] = field(default_factory=dict)
