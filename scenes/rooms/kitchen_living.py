"""A kitchen and living room, 6 x 4 x 2.6 m, with a window: the room that ships as room_human and room_smooth."""

import math

import numpy as np

from . import _kitchen, _living
from ._builder import Builder
from ._furnished import furnished
from ._furniture import any_colour
from ._materials import MATERIALS
from ._paths import Go, Stay, steered
from ._types import AreaLight, Room

X, Y, Z = 6.0, 4.0, 2.6
WINDOW = (1.0, 3.0, 0.9, 2.2)  # lowest and highest y, lowest and highest z, in the wall x = X

HUMAN_START = (2.6, 1.5, 1.5)
HUMAN = (
    Stay(1.5, ((4.3, 2, 0.9),)),
    Go((2.9, 2.7, 1.5), 0.6, (2.4, 3.9, 1.1)),
    Stay(5.0, ((2.6, 3.9, 1.2), (2.6, 3.9, 1.2), (2.7, 3.7, 0.9), (3.8, 3.6, 1.1))),
    Go((1.2, 2.85, 1.5), 0.5, (1.2, 3.9, 1.1)),
    Stay(3.5, ((0.6, 3.8, 1.1), (1.5, 3.9, 1.2))),
    Go((1.3, 2.1, 1.4), 0.35, (0.0, 2.0, 1.1)),
    Stay(4.0, ((0, 2.4, 1.3), (0, 1.4, 0.8), (0, 1.4, 0.8))),
    Go((2.7, 1.6, 1.45), 1.5),
    Stay(1.0, ((4.3, 1.9, 0.8), (1.4, 0.2, 0.8))),
    Go((1.9, 1.5, 1.25), 0.4, (1.3, 0.1, 0.9)),
    Stay(3.0, ((1.4, 0.1, 0.9), (2.3, 0.1, 1.4), (1.4, 1.6, 0.4))),
    Go((2.9, 1.3, 1.5), 0.9, (4.0, 0.1, 1.3)),
    Stay(3.5, ((4.0, 0.1, 1.3), (4.0, 0.1, 1.3), (4.6, 0.2, 0.8))),
    Go((3.0, 2.8, 1.55), 1.6),
    Go((5.2, 2.85, 1.5), 0.8, (5.0, 2.0, 1.0)),
    Stay(1.5, ((6, 2, 1.4), (4.2, 1.9, 0.8))),
    Stay(1.5, ((3, 3.9, 1.2), (0, 3, 1.2), (0, 1, 1.2))),
    Go((5.45, 1.6, 1.5), 0.6, (4.2, 1.9, 0.8)),
    Stay(2.5, ((4.2, 1.9, 0.8), (4.2, 1.9, 0.8), (4.0, 0.1, 1.2))),
    Go((5.2, 1.0, 1.4), 0.5, (3.6, 0.2, 1.0)),
    Stay(2.0, ((2, 0.1, 1.2), (1, 2, 1), (2, 3.9, 1.1))),
    Go((5.3, 2.8, 1.5), 1.8),
    Go((3.2, 2.9, 1.5), 0.7, (3.0, 3.9, 1.1)),
)
TEST_START = (2.2, 2.2, 1.4)
TEST = (
    Stay(1.0, ((1.5, 0.2, 0.9),)),
    Go((3.3, 2.9, 1.3), 0.22, (5.6, 1, 1.0)),
    Go((5.4, 2.3, 1.35), 0.22, (3.4, 2.3, 0.8)),
    Go((5.3, 1.25, 1.65), 0.2, (2.4, 0.3, 1.1)),
    Go((3.1, 1.1, 1.3), 0.24, (4.6, 0.1, 1.1)),
    Go((2.5, 1.9, 1.6), 0.2, (0, 1.7, 1.2)),
    Go((1.7, 2.75, 1.35), 0.2, (1.8, 3.9, 1.1)),
    Go((0.8, 1.2, 1.55), 0.25, (1.8, 0.1, 0.8)),
    Go((2.6, 2.6, 1.6), 0.4, (4.2, 3.9, 1.1)),
    Go((3.2, 2.2, 1.3), 0.3, (4.3, 1.95, 0.85)),
)
SMOOTH = (  # places and what is looked at from them, a closed round
    ((2.6, 1.5, 1.5), (4.3, 2.0, 0.9)),
    ((2.9, 2.7, 1.5), (2.4, 3.9, 1.1)),
    ((1.9, 2.8, 1.5), (1.6, 3.9, 1.2)),
    ((1.2, 2.6, 1.45), (0, 2.6, 1.3)),
    ((1.3, 2.0, 1.4), (0, 1.6, 1.0)),
    ((1.7, 1.5, 1.4), (1.0, 0.1, 1.0)),
    ((2.4, 1.4, 1.4), (2.2, 0.1, 1.2)),
    ((3.1, 1.25, 1.5), (4.2, 0.1, 1.2)),
    ((4.2, 1.1, 1.5), (5.6, 0.6, 1.0)),
    ((5.3, 1.2, 1.5), (4.2, 1.9, 0.8)),
    ((5.45, 2.0, 1.5), (3.8, 2.0, 1.0)),
    ((5.2, 2.8, 1.5), (3.0, 3.9, 1.2)),
    ((4.2, 2.95, 1.5), (4.2, 1.9, 0.8)),
    ((3.2, 2.4, 1.5), (6.0, 2.0, 1.4)),
)


def build() -> Room:
    """The room, the same at every call."""
    room, random = Builder(), np.random.default_rng(100)
    _shell(room)
    _window(room, random)
    _timber(room)
    _lamps(room)
    _kitchen.add(room, random)
    _living.add(room, random)
    wide, high = WINDOW[1] - WINDOW[0], WINDOW[3] - WINDOW[2]
    middle = (X - 0.015, (WINDOW[0] + WINDOW[1]) / 2, (WINDOW[2] + WINDOW[3]) / 2)
    turned = (math.pi / 2, 0.0, math.pi / 2)
    daylight = AreaLight("window", middle, turned, (wide, high), 8.0 * 2.6 * math.pi, (0.86, 0.94, 1.0))
    human = steered(HUMAN, HUMAN_START, seed=1)
    test = steered(TEST, TEST_START, seed=2, jitter=0.8)
    return furnished(room, MATERIALS, {}, (daylight,), (X, Y, Z), human, SMOOTH, test)


def _shell(room: Builder) -> None:
    """Floor, ceiling and walls, and what is outside the window."""
    y0, y1, z0, z1 = WINDOW
    room.sheet("floor", (0, 0, 0), (X, 0, 0), (0, Y, 0), repeat=2.0)
    room.sheet("ceiling", (0, Y, Z), (X, 0, 0), (0, -Y, 0), repeat=1.6)
    room.sheet("wallpaper", (X, 0, 0), (-X, 0, 0), (0, 0, Z), repeat=1.6)
    room.sheet("plaster", (0, 0, 0), (0, Y, 0), (0, 0, Z), repeat=2.0)
    room.sheet("tiles", (0, Y, 0.9), (X, 0, 0), (0, 0, 0.6), repeat=0.8)
    room.sheet("plaster", (0, Y, 1.5), (X, 0, 0), (0, 0, 1.1), repeat=1.7)
    room.sheet("plaster", (0, Y, 0), (X, 0, 0), (0, 0, 0.9), repeat=1.3)
    for low_y, high_y, low_z, high_z in ((0, y0, 0, Z), (y1, Y, 0, Z), (y0, y1, 0, z0), (y0, y1, z1, Z)):
        uv = ((4 - high_y) / 1.3, low_z / 1.3, (4 - low_y) / 1.3, high_z / 1.3)
        room.sheet("brick", (X, high_y, low_z), (0, low_y - high_y, 0), (0, 0, high_z - low_z), uv=uv)
    corner = (X + 0.25, y1 + 0.3, z0 - 0.2)
    room.sheet("outside", corner, (0, y0 - y1 - 0.6, 0), (0, 0, z1 - z0 + 0.4), uv=(0, 1, 1, 0))


def _window(room: Builder, random: np.random.Generator) -> None:
    """Frame, bars and the pots on the sill."""
    y0, y1, z0, z1 = WINDOW
    for low, high in (
        ((X - 0.03, y0 - 0.06, z0 - 0.06), (X + 0.12, y0, z1 + 0.06)),
        ((X - 0.03, y1, z0 - 0.06), (X + 0.12, y1 + 0.06, z1 + 0.06)),
        ((X - 0.12, y0 - 0.06, z0 - 0.06), (X + 0.12, y1 + 0.06, z0)),
        ((X - 0.03, y0, z1), (X + 0.12, y1, z1 + 0.06)),
        ((X, 1.98, z0), (X + 0.06, 2.02, z1)),
        ((X, y0, 1.6), (X + 0.06, y1, 1.63)),
    ):
        room.box("wood_light", low, high)
    for k in range(5):
        y, top = 1.15 + 0.4 * k, 0.9 + 0.08 + 0.04 * (k % 3)
        room.box("glaze", (5.9, y - 0.05, 0.9), (6.0, y + 0.05, top), colour=any_colour(random))


def _timber(room: Builder) -> None:
    """Beams and skirting."""
    for x in (1.5, 3.0, 4.5):
        room.box("wood_dark", (x - 0.07, 0, Z - 0.14), (x + 0.07, Y, Z), repeat=0.6)
    for low, high in (
        ((0, 0, 0), (X, 0.02, 0.09)),
        ((0, Y - 0.02, 0), (X, Y, 0.09)),
        ((0, 0, 0), (0.02, Y, 0.09)),
        ((X - 0.02, 0, 0), (X, Y, 0.09)),
    ):
        room.box("wood_dark", low, high)


def _lamps(room: Builder) -> None:
    """Panels below the cupboards and on the ceiling."""
    room.sheet("panel", (0.2, 3.72, 1.545), (1.7, 0, 0), (0, -0.04, 0))
    room.sheet("panel", (2.25, 3.8, 1.495), (1.15, 0, 0), (0, -0.03, 0))
    for x, y in ((0.8, 1.6), (2.25, 2.7), (3.75, 1.3), (5.2, 2.7)):
        room.box("paint", (x - 0.27, y - 0.27, Z - 0.05), (x + 0.27, y + 0.27, Z - 0.012), colour=(0.7, 0.7, 0.7))
        room.sheet("panel", (x - 0.25, y + 0.25, Z - 0.052), (0.5, 0, 0), (0, -0.5, 0))
