"""What readers of numbered RGB-D exports share: matrices in text files, and frames that have one pinhole camera."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..image_files import image_size
from ..types import OPENCV, Cameras, Split


def numbers(path: Path, what: str) -> np.ndarray:
    """(rows, columns) float64 of a text file of numbers; `#` starts a comment.

    Raises UserError, which names the file, when it is missing, empty or has something else in it.
    """
    rows = []
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{what} '{path}' cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UserError(f"{what} '{path}' is no text file of numbers") from None
    try:
        rows = [[float(word) for word in line.split("#")[0].replace(",", " ").split()] for line in text.splitlines()]
    except ValueError as error:
        raise UserError(f"{what} '{path}' is no text file of numbers: {error}") from None
    rows = [row for row in rows if row]
    if not rows or len({len(row) for row in rows}) != 1:
        raise UserError(f"{what} '{path}' should have rows of equally many numbers")
    return np.array(rows)


def matrix(path: Path, what: str) -> np.ndarray:
    """(4, 4) matrix in a text file. Raises UserError for another shape."""
    values = numbers(path, what)
    if values.size != 16:
        raise UserError(f"{what} '{path}' has {values.size} numbers, expected the 16 of a 4 x 4 matrix")
    return values.reshape(4, 4)


def natural(name: str) -> list[tuple[int, int, str]]:
    """Sorting key that puts frame2 before frame10."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name)]


def by_number(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    """Files of the folder with one of the suffixes, in the order of the number in their names."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.is_file()]
    return sorted(found, key=lambda path: ([int(part) for part in re.findall(r"\d+", path.name)], path.name))


def split(
    root: Path,
    paths: Sequence[Path],
    poses: np.ndarray,
    focal: tuple[float, float],
    centre: tuple[float, float],
    times: np.ndarray | None = None,
    distortion: Sequence[float] | None = None,
) -> Split:
    """Frames of one camera; `poses` (N, 4, 4) are camera-to-world with OpenCV axes, sizes those of the first image."""
    width, height = image_size(paths[0])
    one = np.ones(len(paths))
    lens = None if distortion is None or not any(distortion) else np.tile(np.array(distortion), (len(paths), 1))
    cameras = Cameras(
        c2w=np.asarray(poses, dtype=np.float64) @ OPENCV,
        fx=focal[0] * one,
        fy=focal[1] * one,
        cx=centre[0] * one,
        cy=centre[1] * one,
        width=np.full(len(paths), width, np.int64),
        height=np.full(len(paths), height, np.int64),
        distortion=lens,
    )
    return Split(tuple(path.relative_to(root).as_posix() for path in paths), tuple(paths), cameras, times)
