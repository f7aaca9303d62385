"""Writes a rendered path as a capture in Blender's form, frame by frame, so that a run that was stopped goes on."""

import hashlib
import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from PIL import Image

from ...common.errors import UserError
from ...common.files import read_json, whole, write_json
from ..seen import FILE
from . import _points, _visibility
from ._rendering import FIELD_OF_VIEW
from ._types import Room

QUALITY = 95  # of JPEG, unless another is asked for; its colours are not subsampled
TEST_SAMPLES = 4  # times as many samples in test frames, which are written as PNG
TEST_SEED = 100_000  # above the seeds of training frames
POINTS = "points3d.ply"


class Renderer(Protocol):
    """What renders: `_rendering.Renderer`, or what stands in for it in tests."""

    def render(self, c2w: np.ndarray, samples: int, seed: int) -> np.ndarray: ...


@dataclass(frozen=True)
class Job:
    """N frames of one path through one room."""

    room: str  # its name
    path: str  # the path's name, or the trajectory's file
    times: np.ndarray  # (N,) seconds
    c2w: np.ndarray  # (N, 4, 4) OpenGL axes
    size: int  # pixels, both ways
    samples: int  # a pixel
    split: str = "train"  # which frames of the capture these are, "train" or "test"
    quality: int = QUALITY  # of the training frames' JPEG

    def name(self, i: int) -> str:
        """Path of a frame's image from the capture's folder."""
        return f"{self.split}/{i:04d}.{'png' if self.split == 'test' else 'jpg'}"

    def transforms(self) -> dict[str, Any]:
        """The content of transforms_train.json or transforms_test.json."""
        focal, middle = self.size / 2 / np.tan(FIELD_OF_VIEW / 2), self.size / 2
        frames = [
            {"file_path": self.name(i), "transform_matrix": self.c2w[i].tolist(), "time": float(self.times[i])}
            for i in range(len(self.times))
        ]
        head = {"camera_angle_x": FIELD_OF_VIEW, "fl_x": focal, "fl_y": focal, "cx": middle, "cy": middle}
        return {**head, "w": self.size, "h": self.size, "frames": frames}

    def record(self, room: Room) -> dict[str, Any]:
        """What a folder's frames depend on, by which a later run knows them for its own."""
        return {
            "room": self.room,
            "path": self.path,
            "frames": len(self.times),
            "size": self.size,
            "samples": self.samples,
            "quality": self.quality,
            "room_sha256": digest(room),
            "poses_sha256": _sha256(self.c2w),
        }


def _sha256(values: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def digest(room: Room) -> str:
    """Hex SHA-256 of all that is rendered of a room."""
    found = hashlib.sha256()
    for name, mesh in room.meshes.items():
        found.update(repr((name, room.materials[name])).encode())
        for values in vars(mesh).values():
            found.update(np.ascontiguousarray(values).tobytes())
    for name, pixels in sorted(room.textures.items()):
        found.update(name.encode() + np.ascontiguousarray(pixels).tobytes())
    found.update(repr([asdict(light) for light in room.lights]).encode())
    return found.hexdigest()


def check_folder(out: Path, job: Job, room: Room) -> None:
    """Raises UserError where the folder has anything else than frames of this job, or of the other split's."""
    if os.path.lexists(out) and not out.is_dir():
        raise UserError(f"--out '{out}' is a file; name a folder")
    # Another shard may just have begun: what it has before its record starts with a point.
    if not out.is_dir() or all(file.name.startswith(".") for file in out.iterdir()):
        return
    files = {split: out / f"render_{split}.json" for split in ("train", "test")}
    if not any(file.is_file() for file in files.values()):
        raise UserError(f"--out '{out}' has files that are no render of a room; name another folder")
    for split, file in files.items():
        if not file.is_file():
            continue
        was, now = read_json(file, "record"), job.record(room)
        if isinstance(was, dict):
            was = {"quality": QUALITY, **was}  # of a render begun when there was no other
        same = now.keys() if split == job.split else ("room", "size", "room_sha256")
        same = [key for key in same if not (key == "quality" and split == "test")]  # PNG has none
        other = next((key for key in same if not isinstance(was, dict) or was.get(key) != now[key]), None)
        if other:
            got, asked = (was.get(other) if isinstance(was, dict) else None), now[other]
            what = "another state of the room or path" if other.endswith("sha256") else f"{other} {got}, not {asked}"
            raise UserError(f"--out '{out}' has a render with {what}; name another folder, or delete that one")


def write(
    out: Path,
    job: Job,
    room: Room,
    renderer: Callable[[], AbstractContextManager[Renderer]],
    points: Callable[[Room], tuple[np.ndarray, np.ndarray]],
    shares: Callable[[Room, np.ndarray, np.ndarray], np.ndarray],
    shard: tuple[int, int],
    progress: Callable[[int, int | None, str], None],
) -> int:
    """Renders this shard's frames that are not there yet, and returns how many of all frames are still missing.

    `shard` (i, n) is every n-th frame from the i-th, counted from 1. When none is missing the transforms are written,
    so a folder with them is complete; when both splits are, what `shares` finds of the test views goes beside them.
    Raises UserError as `check_folder` does.
    """
    check_folder(out, job, room)
    folder = out / job.split
    write_json(out / f"render_{job.split}.json", job.record(room))
    folder.mkdir(exist_ok=True)
    if not (out / POINTS).is_file():
        _points.write(out / POINTS, *points(room))
    frames = range(shard[0] - 1, len(job.times), shard[1])
    todo = [i for i in frames if not _whole(out / job.name(i), job.size)]
    done = len(frames) - len(todo)
    if todo:
        with renderer() as made:
            for i in todo:
                progress(done, len(frames), job.name(i))
                _render(made, job, i, out / job.name(i))
                done += 1
    progress(done, len(frames), "")
    missing = sum(not _whole(out / job.name(i), job.size) for i in range(len(job.times)))
    if not missing:
        for left in folder.glob(".part-*"):  # by runs that were killed
            left.unlink(missing_ok=True)
        write_json(out / f"transforms_{job.split}.json", job.transforms())
        _write_seen(out, room, shares)
    return missing


def _write_seen(out: Path, room: Room, shares: Callable[[Room, np.ndarray, np.ndarray], np.ndarray]) -> None:
    """Of each test view the share of its pixels that some training view sees, once both are there."""
    files = [out / f"transforms_{split}.json" for split in ("test", "train")]
    if not all(file.is_file() for file in files):
        return
    seen, test, train = out / FILE, *(_frames(file) for file in files)
    poses = [np.array([frame["transform_matrix"] for frame in frames]) for frames in (test, train)]
    of = {"room_sha256": digest(room), "poses_sha256": [_sha256(part) for part in poses]}
    if seen.is_file() and _visibility.is_of(read_json(seen, "shares"), of):
        return
    names = [frame["file_path"] for frame in test]
    write_json(seen, {**_visibility.record(names, shares(room, *poses)), **of})


def _frames(file: Path) -> list[dict[str, Any]]:
    record = read_json(file, "transforms")
    assert isinstance(record, dict)
    return record["frames"]


def _render(renderer: Renderer, job: Job, i: int, file: Path) -> None:
    test = job.split == "test"
    samples, seed = (TEST_SAMPLES * job.samples, TEST_SEED + i) if test else (job.samples, i)
    image = Image.fromarray(renderer.render(job.c2w[i], samples, seed))
    with whole(file) as temporary:
        if test:
            image.save(temporary, optimize=True)
        else:
            image.save(temporary, quality=job.quality, subsampling=0, optimize=True)  # the same pixels in 3 % less


def _whole(file: Path, size: int) -> bool:
    """Whether the frame is there, can be decoded, and has the size."""
    try:
        with Image.open(file) as image:
            image.load()
            return image.size == (size, size)
    except (OSError, SyntaxError):
        return False
