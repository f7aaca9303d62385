"""One camera's intrinsics: from a file camera.txt or a line of numbers, and whether they fit the images."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...common.errors import UserError
from ._text import numbers

CAMERA = "camera.txt"
FORM = "fx fy cx cy [k1 k2 p1 p2 [k3]]"
OFF_CENTRE = 0.15  # of the image: a principal point farther from the middle, on both axes, is of another size
SAME_SHAPE = 1.15  # and then by about one factor


@dataclass(frozen=True)
class Intrinsics:
    """Pixels; the first one's centre is (0.5, 0.5). `source` is what an error calls them."""

    fx: float
    fy: float
    cx: float
    cy: float
    source: str
    lens: tuple[float, ...] = (0.0,) * 5  # OpenCV's k1, k2, p1, p2, k3
    model: str = ""  # as `Split.lens`


def opencv(values: Sequence[float], source: str) -> Intrinsics:
    """Intrinsics of 4, 8 or 9 numbers as OpenCV has them, whose first pixel's centre is (0, 0).

    Raises UserError for another count, and focal lengths that are not positive.
    """
    if len(values) not in (4, 8, 9):
        raise UserError(f"intrinsics {source} have {len(values)} numbers, expected 4, 8 or 9: {FORM}")
    fx, fy, cx, cy = values[:4]
    if not (fx > 0 and fy > 0):
        raise UserError(f"intrinsics {source} have focal lengths {fx:g} and {fy:g}, expected pixels: {FORM}")
    return Intrinsics(fx, fy, cx + 0.5, cy + 0.5, source, (*values[4:], *[0.0] * (9 - len(values))))


def read_camera(path: Path) -> Intrinsics:
    """Intrinsics in a text file of 4, 8 or 9 numbers or a 3 x 3 matrix. Raises UserError for anything else."""
    values = numbers(path, "intrinsics")
    if values.shape == (3, 3) and values[2].tolist() == [0, 0, 1]:
        return opencv(values[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), f"'{path}'")
    return opencv(values.ravel().tolist(), f"'{path}'")


def camera_file(*folders: Path) -> Path | None:
    """camera.txt in the first of the folders that has one."""
    return next((folder / CAMERA for folder in folders if (folder / CAMERA).is_file()), None)


def given(text: str) -> Intrinsics:
    """Intrinsics as they are given on the command line, fx,fy,cx,cy[,…]. Raises UserError for anything else."""
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        raise UserError(f"--intrinsics '{text}' should be numbers: {FORM.replace(' ', ',')}") from None
    return opencv(values, f"'{text}'")


def check_fit(camera: Intrinsics, image: Path, size: tuple[int, int]) -> None:
    """Raises UserError where the principal point is that of a picture of another size than `size` (width, height).

    It is then off the middle on both axes by about the same factor: a resized export keeps the shape.
    """
    x, y = camera.cx / size[0], camera.cy / size[1]
    off = min(abs(x - 0.5), abs(y - 0.5)) > OFF_CENTRE
    if off and min(x, y) > 0 and max(x / y, y / x) < SAME_SHAPE:
        factor = 1 / (x + y)
        raise UserError(
            f"intrinsics {camera.source} are of a picture of about {2 * camera.cx:.0f} x {2 * camera.cy:.0f}, but "
            f"'{image}' is {size[0]} x {size[1]}; scale fx, fy, cx and cy by about {factor:.3g}, or take the images "
            "in the size that they were made for"
        )
