"""Floor, walls, windows, ceiling and lamps of `open_office`, and the wall between its two spaces."""

import math

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, spine
from ._office_desks import CUP, TONES
from ._office_green import sprig
from ._types import AreaLight

X, Y, Z = 11.0, 5.0, 2.9
WALL = (6.9, 7.05)  # lowest and highest x of the wall between the spaces
OPENING = (1.5, 3.5)  # lowest and highest y of the way through it
SILL, HEAD = 0.85, 2.35  # of the windows
WINDOWS = ((0.5, 1.9), (2.15, 3.55), (3.8, 5.2), (5.45, 6.7), (7.4, 8.9), (9.15, 10.5))  # lowest and highest x
LAMPS = (
    (0.6, 1.4),
    (2.4, 1.4),
    (4.2, 1.4),
    (0.6, 3.8),
    (2.4, 3.8),
    (4.2, 3.8),
    (5.6, 2.6),
    (7.8, 1.4),
    (9.6, 2.0),
    (7.8, 3.8),
)
DAYLIGHT, LAMPLIGHT = 28.0, 14.5  # watts of a window and of a lamp


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it."""
    _walls(room)
    _wall_between(room)
    for k, (x0, x1) in enumerate(WINDOWS):
        _window(room, k, x0, x1, random)
    _overhead(room)


def lights() -> tuple[AreaLight, ...]:
    """Daylight of each window, and below each lamp what it gives."""
    middle = (SILL + HEAD) / 2
    given = []
    for k, (x0, x1) in enumerate(WINDOWS):
        place, size = ((x0 + x1) / 2, Y - 0.015, middle), (x1 - x0, HEAD - SILL)
        given.append(AreaLight(f"window {k}", place, (-math.pi / 2, 0.0, 0.0), size, DAYLIGHT, (0.88, 0.95, 1.0)))
    for k, (x, y) in enumerate(LAMPS):
        place = (x + 0.6, y - 0.3, Z - 0.05)
        given.append(AreaLight(f"lamp {k}", place, (0.0, 0.0, 0.0), (1.14, 0.54), LAMPLIGHT, (1.0, 0.96, 0.9)))
    return tuple(given)


def _walls(room: Builder) -> None:
    """The four walls, floor, ceiling, skirting, and the city outside."""
    low, high = WALL
    room.sheet("carpet", (0, 0, 0), (high, 0, 0), (0, Y, 0), repeat=3.2)
    room.sheet("chevron", (high, 0, 0), (X - high, 0, 0), (0, Y, 0), repeat=1.9)
    room.sheet("mineral", (0, Y, Z), (X, 0, 0), (0, -Y, 0), repeat=2.4)
    room.sheet("concrete", (0, 0, 0), (0, Y, 0), (0, 0, Z), repeat=2.6)
    room.sheet("felt", (low, 0, 0.75), (-low, 0, 0), (0, 0, 1.5), repeat=2.4)
    room.sheet("concrete", (low, 0, 2.25), (-low, 0, 0), (0, 0, Z - 2.25), repeat=2.3)
    room.sheet("whitewash", (low, 0, 0), (-low, 0, 0), (0, 0, 0.75), repeat=1.3)
    room.sheet("whitewash", (X, 0, 0), (high - X, 0, 0), (0, 0, Z), repeat=1.3)
    room.sheet("concrete", (X, Y, 0), (0, -Y, 0), (0, 0, Z), repeat=2.6)
    edges = [0.0, *(x for pair in WINDOWS for x in pair), X]
    for x0, x1 in zip(edges[::2], edges[1::2], strict=True):
        _brick(room, x0, x1, 0, Z)
    for x0, x1 in WINDOWS:
        _brick(room, x0, x1, 0, SILL)
        _brick(room, x0, x1, HEAD, Z)
    room.sheet("city", (-1.5, Y + 0.9, -0.2), (X + 3, 0, 0), (0, 0, 4.4), uv=(0, 1, 1, 0))
    for first, last in (
        ((0, 0, 0), (low, 0.02, 0.09)),
        ((high, 0, 0), (X, 0.02, 0.09)),
        ((0, 0.02, 0), (0.02, Y, 0.09)),
    ):
        room.box("smoked", first, last)


def _brick(room: Builder, x0: float, x1: float, z0: float, z1: float) -> None:
    uv = (x0 / 1.3, z0 / 1.3, x1 / 1.3, z1 / 1.3)
    room.sheet("whitewash", (x0, Y, z0), (x1 - x0, 0, 0), (0, 0, z1 - z0), uv=uv)


def _wall_between(room: Builder) -> None:
    """Two pieces of concrete with a way between, a beam above it, slats on one end."""
    low, high = WALL
    room.box("concrete", (low, 0, 0), (high, OPENING[0], Z), repeat=2.2)
    room.box("concrete", (low, OPENING[1], 0), (high, Y, Z), repeat=2.2)
    room.box("smoked", (low, OPENING[0], 2.4), (high, OPENING[1], Z), repeat=0.9)
    for y in (OPENING[0], OPENING[1] - 0.04):
        room.box("oak", (low - 0.015, y, 0), (high + 0.015, y + 0.04, 2.4), repeat=0.5)


def _window(room: Builder, k: int, x0: float, x1: float, random: np.random.Generator) -> None:
    """Frame, bars, a sill with things on it, a radiator below."""
    for first, last in (
        ((x0 - 0.05, Y - 0.025, SILL - 0.05), (x0, Y + 0.1, HEAD + 0.05)),
        ((x1, Y - 0.025, SILL - 0.05), (x1 + 0.05, Y + 0.1, HEAD + 0.05)),
        ((x0, Y - 0.025, HEAD), (x1, Y + 0.1, HEAD + 0.05)),
        (((x0 + x1) / 2 - 0.02, Y + 0.02, SILL), ((x0 + x1) / 2 + 0.02, Y + 0.07, HEAD)),
        ((x0, Y + 0.02, 1.85), (x1, Y + 0.07, 1.88)),
    ):
        room.box("smoked", first, last, repeat=0.4)
    room.box("oak", (x0, Y - 0.22, SILL - 0.04), (x1, Y + 0.1, SILL), repeat=0.8)
    for n in range(int((x1 - x0 - 0.2) / 0.075)):
        x = x0 + 0.1 + 0.075 * n
        room.box("radiator", (x, Y - 0.12, 0.12), (x + 0.055, Y - 0.03, 0.7), repeat=0.3)
    room.box("radiator", (x0 + 0.1, Y - 0.09, 0.15), (x1 - 0.1, Y, 0.2), repeat=0.3)
    sprig(room, (x0 + 0.25 + 0.1 * (k % 3), Y - 0.11, SILL), 0.065 + 0.01 * (k % 2), 22, random)
    room.lathe("glaze", CUP, (x0 + 0.75, Y - 0.12, SILL), 24, TONES[k % 6])
    for n in range(4 + k % 3):
        x, high = x1 - 0.4 + 0.045 * n, SILL + random.uniform(0.15, 0.27)
        room.box(BOOK, (x, Y - 0.2, SILL), (x + 0.042, Y - 0.04, high), uv=spine(k % 4, (6 * k + 5 * n) % 32))


def _overhead(room: Builder) -> None:
    """Lamps, a duct and a tray for cables."""
    for x, y in LAMPS:
        room.box("steel", (x, y - 0.6, Z - 0.03), (x + 1.2, y, Z), repeat=0.5)
        room.sheet("prism", (x + 0.03, y - 0.03, Z - 0.0345), (1.14, 0, 0), (0, -0.54, 0))
    room.box("zinc", (0, 0.25, 2.45), (WALL[0], 0.6, 2.72), repeat=0.6)
    for k in range(7):
        x = 0.5 + k
        room.box("smoked", (x, 0.23, 2.43), (x + 0.05, 0.62, 2.45), repeat=0.3)
        for y in (0.2, 0.62):
            room.box("smoked", (x, y, 2.43), (x + 0.05, y + 0.02, Z), repeat=0.3)
    room.box("smoked", (0, 2.98, Z - 0.18), (WALL[0], 3.16, Z - 0.15), repeat=0.4)
    for k in range(7):
        room.box("smoked", (0.3 + k, 3.05, Z - 0.15), (0.33 + k, 3.09, Z), repeat=0.3)
    for k, wide in enumerate((0.02, 0.03, 0.015, 0.025)):
        y = 2.99 + 0.042 * k
        room.box("paint", (0, y, Z - 0.15), (WALL[0], y + wide, Z - 0.15 + wide), colour=TONES[(k + 1) % 6])
