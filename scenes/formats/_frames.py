"""What readers of numbered exports share: files in the order of their numbers, poses, frames of one camera."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...common import limits
from ...common.errors import UserError
from ..image_files import image_size
from ..types import OPENCV, Cameras, Split
from ._intrinsics import Intrinsics, check_fit
from ._text import matrix


def posed(images: Sequence[Path], files: Sequence[Path], root: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Which images have a pose in their file (N booleans), the (K, 4, 4) matrices of those, and notes on the others.

    Tracking that was lost is written as infinity or NaN, or has no file. Raises UserError when no image has a pose,
    and for a file that holds something else than a 4 x 4 matrix.
    """
    here = np.array([file.is_file() for file in files])
    poses = np.tile(np.full((4, 4), np.nan), (len(images), 1, 1))
    for i, file in enumerate(files):
        if here[i]:
            poses[i] = matrix(file, "pose")
    finite = np.all(np.isfinite(poses), axis=(1, 2))
    if not here.any():
        raise UserError(f"'{root}': none of the {len(images)} images has a pose file ('{files[0]}' is missing)")
    if not finite.any():
        raise UserError(f"'{root}': none of the {len(images)} frames has a finite pose")
    notes = []
    if not here.all():
        notes.append(f"{int((~here).sum())} of {len(images)} frames dropped: they have no pose file")
    if (here & ~finite).any():
        lost = int((here & ~finite).sum())
        notes.append(f"{lost} of {len(images)} frames dropped: their pose is infinite or NaN (tracking was lost)")
    return finite, poses[finite], notes


def natural(name: str) -> list[tuple[int, int, str]]:
    """Sorting key that puts frame2 before frame10. Raises UserError for a name longer than any file system takes."""
    if len(name) > limits.NAME_LETTERS:
        raise UserError(
            f"frame '{name[:40]}…' has a name of {len(name):,} letters, at most {limits.NAME_LETTERS:,} are read"
        )
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name)]


def times_of(values: Sequence[Any]) -> np.ndarray | None:
    """(N,) seconds, or None unless every frame has a finite one."""
    if not values or not all(isinstance(value, (int, float)) for value in values):
        return None
    try:
        times = np.array(values, dtype=np.float64)
    except OverflowError:
        return None
    return times if np.isfinite(times).all() else None


def by_number(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    """Files of the folder with one of the suffixes, in the order of the number in their names; none that are hidden."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if path.name.lower().endswith(tuple(suffixes)) and path.is_file()]
    found = [path for path in found if not path.name.startswith(".")]  # macOS leaves ._0.jpg on other disks
    return sorted(found, key=lambda path: ([int(part) for part in re.findall(r"\d+", path.name)], path.name))


def split(
    root: Path,
    paths: Sequence[Path],
    poses: np.ndarray,
    camera: Intrinsics,
    times: np.ndarray | None = None,
    depths: Sequence[Path | None] = (),
) -> Split:
    """Frames of one camera; `poses` (N, 4, 4) are camera-to-world with OpenCV axes, sizes those of the first image.

    `depths` may be all None, and then counts as none. Raises UserError for intrinsics that are of another size.
    """
    size = image_size(paths[0])
    check_fit(camera, paths[0], size)
    one = np.ones(len(paths))
    cameras = Cameras(
        c2w=np.asarray(poses, dtype=np.float64) @ OPENCV,
        fx=camera.fx * one,
        fy=camera.fy * one,
        cx=camera.cx * one,
        cy=camera.cy * one,
        width=np.full(len(paths), size[0], np.int64),
        height=np.full(len(paths), size[1], np.int64),
        distortion=np.tile(np.array(camera.lens), (len(paths), 1)) if any(camera.lens) else None,
    )
    names = tuple(path.relative_to(root).as_posix() for path in paths)
    return Split(names, tuple(paths), cameras, times, camera.model, tuple(depths) if any(depths) else ())
