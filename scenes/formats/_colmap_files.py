"""Walks COLMAP's binary files to see that every count in them fits: pycolmap believes them, and loops for minutes.

The layouts are those of COLMAP's scene/reconstruction_io.cc: little-endian, a uint64 count, then the records.
"""

import struct
from pathlib import Path

from ...common.errors import UserError

PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)  # by camera model, SIMPLE_PINHOLE first
POSE = 7 * 8  # a quaternion and a translation
SENSOR = 8  # its type and number


class _Walker:
    def __init__(self, data: bytes):
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
    walker.skip(16 + 8 * PARAMETERS[model])


def _image(walker: _Walker) -> None:
    walker.skip(4 + POSE + 4)
    end = walker.data.find(b"\0", walker.at)
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


def check(model: Path) -> None:
    """Raises UserError for a binary file of the model whose counts do not add up to its size."""
    for name, record in RECORDS.items():
        path = model / f"{name}.bin"
        if not path.is_file():
            continue
        walker = _Walker(path.read_bytes())
        try:
            for _ in range(walker.take("<Q")):
                record(walker)
            fits = walker.at == len(walker.data)
        except ValueError:
            fits = False
        if not fits:
            raise UserError(f"COLMAP model '{model}' cannot be read: {path.name} is cut short or damaged")


def pinholes(model: Path) -> bool:
    """Whether all cameras of a binary model are PINHOLE or SIMPLE_PINHOLE, the only ones that the 3DGS authors' code
    opens. True where there is no such file."""
    if not (model / "cameras.bin").is_file():
        return True
    walker = _Walker((model / "cameras.bin").read_bytes())
    for _ in range(walker.take("<Q")):
        walker.skip(4)
        kind = walker.take("<i")
        if kind > 1:
            return False
        walker.skip(16 + 8 * PARAMETERS[kind])
    return True
