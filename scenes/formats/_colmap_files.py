"""Walks COLMAP's binary files to see that every count in them fits: pycolmap believes them, and loops for minutes.

The layouts are those of COLMAP's scene/reconstruction_io.cc: little-endian, a uint64 count, then the records.
"""

import contextlib
import mmap
import struct
from collections.abc import Iterator
from pathlib import Path

from ...common import bounded, limits
from ...common.errors import UserError

PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)  # by camera model, SIMPLE_PINHOLE first
POSE = 7 * 8  # a quaternion and a translation
SENSOR = 8  # its type and number


class _Walker:
    def __init__(self, data: mmap.mmap | bytes):
        self.data, self.at = data, 0

    def take(self, layout: str) -> int:
        """The next number. Raises ValueError at the end of the file."""
        size = struct.calcsize(layout)
        if self.at + size > len(self.data):
            raise ValueError
        (value,) = struct.unpack_from(layout, self.data, self.at)
        self.at += size
        return value

    def skip(self, size: int) -> None:
        self.at += size
        if self.at > len(self.data):
            raise ValueError


def _camera(walker: _Walker) -> None:
    walker.skip(4)
    model = walker.take("<i")
    if not 0 <= model < len(PARAMETERS):
        raise ValueError
    if max(walker.take("<Q"), walker.take("<Q")) > limits.SIDE:
        raise ValueError
    walker.skip(8 * PARAMETERS[model])


def _image(walker: _Walker) -> None:
    walker.skip(4 + POSE + 4)
    end = walker.data.find(b"\0", walker.at, walker.at + limits.NAME_LETTERS + 1)
    if end < 0:
        raise ValueError
    walker.at = end + 1
    walker.skip(24 * walker.take("<Q"))


def _point(walker: _Walker) -> None:
    walker.skip(8 + 24 + 3 + 8)
    walker.skip(8 * walker.take("<Q"))


def _rig(walker: _Walker) -> None:
    walker.skip(4)
    sensors = walker.take("<I")
    if sensors:
        walker.skip(SENSOR)
    for _ in range(sensors - 1):
        walker.skip(SENSOR)
        if walker.take("<B"):
            walker.skip(POSE)


def _frame(walker: _Walker) -> None:
    walker.skip(8 + POSE)
    walker.skip((SENSOR + 8) * walker.take("<I"))


RECORDS = {"cameras": _camera, "images": _image, "points3D": _point, "rigs": _rig, "frames": _frame}


@contextlib.contextmanager
def _walking(path: Path) -> Iterator[_Walker]:
    """A walker over the file, which is not read into memory."""
    with open(path, "rb") as file:
        if not bounded.checked(path):  # what has no bytes cannot be mapped
            yield _Walker(b"")
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            yield _Walker(data)


def check(model: Path) -> None:
    """Raises UserError for a binary file of the model whose counts do not add up to its size, for pipes and devices
    by the names of its files, which pycolmap would open, and for a model that is too large."""
    total = 0
    for path in (model / f"{name}.{suffix}" for name in RECORDS for suffix in ("bin", "txt")):
        if not path.exists():
            continue
        try:
            total += bounded.checked(path, limits.COLMAP_BYTES)
        except OSError as error:
            raise UserError(f"COLMAP model '{model}' cannot be read: {path.name}: {error.strerror}") from None
    if total > limits.COLMAP_BYTES:
        raise UserError(f"COLMAP model '{model}' has {bounded.in_words(total)}; it is too large to be read")
    for name, record in RECORDS.items():
        path = model / f"{name}.bin"
        if not path.is_file():
            _check_text(model / f"{name}.txt", model)
            continue
        with _walking(path) as walker:
            try:
                count = walker.take("<Q")
                if name == "points3D":
                    _check_points(count, model)
                for _ in range(count):
                    record(walker)
                fits = walker.at == len(walker.data)
            except ValueError:
                fits = False
        if not fits:
            raise UserError(f"COLMAP model '{model}' cannot be read: {path.name} is cut short or damaged")


def _check_points(count: int, model: Path) -> None:
    if count > limits.COLMAP_POINTS:
        raise UserError(
            f"COLMAP model '{model}' has {count:,} points, at most {limits.COLMAP_POINTS:,} are read; filter it "
            "(colmap point_filtering)"
        )


def _check_text(path: Path, model: Path) -> None:
    """Raises UserError for a text file of too many or too long lines: pycolmap takes a line whole."""
    if not path.is_file():
        return
    size, lines, begin, at = path.stat().st_size, 0, 0, 0
    with open(path, "rb") as file:
        while piece := file.read(1 << 20):
            lines += piece.count(b"\n")
            last = piece.rfind(b"\n")
            at += len(piece)
            begin = at - len(piece) + last + 1 if last >= 0 else begin
            if size > limits.COLMAP_TEXT_BYTES or at - begin > limits.COLMAP_LINE_BYTES:
                raise UserError(f"COLMAP model '{model}' cannot be read: {path.name} is too large, or no text")
    if path.stem == "points3D":
        _check_points(lines, model)


def pinholes(model: Path) -> bool:
    """Whether all cameras of a binary model are PINHOLE or SIMPLE_PINHOLE, the only ones that the 3DGS authors' code
    opens. True where there is no such file."""
    if not (model / "cameras.bin").is_file():
        return True
    with _walking(model / "cameras.bin") as walker:
        for _ in range(walker.take("<Q")):
            walker.skip(4)
            kind = walker.take("<i")
            if kind > 1:
                return False
            walker.skip(16 + 8 * PARAMETERS[kind])
    return True
