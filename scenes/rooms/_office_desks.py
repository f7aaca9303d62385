"""Desks of `open_office` and what lies and stands on them."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, LETTER_BLOCK, spine
from ._office_green import sprig
from ._office_materials import cell
from ._office_seats import BLACK
from ._spot import Spot

WIDE, DEEP, TOP = 1.4, 0.7, 0.74  # of a desk
CUP = [(1e-3, 0), (0.036, 0), (0.042, 0.095), (0.038, 0.095), (0.032, 0.01), (1e-3, 0.01)]
POT = [(1e-3, 0), (0.035, 0), (0.04, 0.1), (0.036, 0.1), (0.033, 0.02), (1e-3, 0.02)]
TONES = (
    (0.75, 0.74, 0.7),
    (0.06, 0.16, 0.28),
    (0.72, 0.42, 0.07),
    (0.04, 0.25, 0.25),
    (0.4, 0.08, 0.05),
    (0.2, 0.22, 0.25),
)


def desk(room: Builder, x: float, y: float, angle: float, k: int, random: np.random.Generator) -> None:
    """The k-th desk; (x, y) is the corner of its top that is near and left of who sits there."""
    at = Spot(room, x, y, angle)
    _table(at, k)
    screens = ((0.7, 0.0),) if k % 3 == 1 else ((0.4, 0.16), (0.97, -0.16))
    for n, (a, turn) in enumerate(screens):
        place = at.at((a, 0.53, TOP))
        _monitor(
            Spot(room, place[0], place[1], angle + turn, TOP), 0.31 if len(screens) == 1 else 0.27, 2 * k + n + k // 4
        )
    _typing(at, k, random)
    _clutter(at, k, random)


def _table(at: Spot, k: int) -> None:
    """Top, frame, drawers, a tray for cables and what stands below."""
    at.box("birch", (0, 0, TOP - 0.025), (WIDE, DEEP, TOP), repeat=0.9)
    for a in (0.05, WIDE - 0.1):
        at.box("black", (a, 0.04, 0), (a + 0.05, 0.66, 0.025), colour=BLACK)
        at.box("black", (a, 0.32, 0.025), (a + 0.05, 0.38, TOP - 0.025), colour=BLACK)
    at.box("zinc", (0.2, 0.5, 0.6), (0.9, 0.62, 0.68), repeat=0.3)
    for n, a in enumerate((0.3, 0.36, 0.75)):
        at.box("black", (a, 0.55, 0), (a + 0.012, 0.562, 0.6), colour=TONES[(n + k) % 3])
    at.box("smoked", (0.96, 0.12, 0.02), (1.28, 0.66, 0.6), repeat=0.5)
    for n in range(3):
        at.box("oak", (0.97, 0.1, 0.04 + 0.186 * n), (1.27, 0.12, 0.21 + 0.186 * n), repeat=0.4)
        at.box("chrome", (1.07, 0.088, 0.15 + 0.186 * n), (1.17, 0.1, 0.16 + 0.186 * n))
    if k % 2:
        at.box("felt", (0.14, 0.15, 0), (0.3, 0.48, 0.36), 0.15, repeat=0.7)
    else:
        at.box("steel", (0.13, 0.14, 0), (0.29, 0.48, 0.4), repeat=0.3)


def _monitor(at: Spot, half: float, picture: int) -> None:
    """A monitor above its foot."""
    high = half * 1.2
    at.box("black", (-0.11, -0.05, 0), (0.11, 0.09, 0.012), colour=(0.12, 0.12, 0.13))
    at.box("black", (-0.025, 0.035, 0.012), (0.025, 0.055, 0.3), colour=(0.12, 0.12, 0.13))
    at.box("black", (-half, 0, 0.13), (half, 0.035, 0.15 + high), colour=BLACK)
    at.sheet(
        "screens", (0.012 - half, -0.004, 0.145), (2 * half - 0.024, 0, 0), (0, 0, high - 0.008), uv=cell(picture, 4, 2)
    )
    notes = cell(2, 4, 2)
    at.sheet("papers", (half - 0.06, -0.007, 0.1), (0.065, 0, 0), (0.004, -0.001, 0.065), uv=notes)


def _typing(at: Spot, k: int, random: np.random.Generator) -> None:
    """A mat with a keyboard and a mouse."""
    a = 0.4 + random.uniform(-0.05, 0.05)
    cloth = ("tweed_grey", "felt", "tweed_blue")[k % 3]
    at.sheet(cloth, (a - 0.12, 0.04, TOP + 0.004), (0.86, 0, 0), (0, 0.34, 0), repeat=0.5)
    at.box("black", (a, 0.12, TOP + 0.004), (a + 0.44, 0.27, TOP + 0.018), colour=(0.1, 0.11, 0.12))
    at.sheet("keys", (a, 0.12, TOP + 0.0215), (0.44, 0, 0), (0, 0.15, 0), uv=(0, 1, 1, 0))
    mouse = [(1e-3, 0), (0.03, 0), (0.032, 0.012), (0.024, 0.026), (1e-3, 0.032)]
    at.lathe("black", mouse, (a + 0.55, 0.18, TOP + 0.004), (0.2, 0.21, 0.22))


def _clutter(at: Spot, k: int, random: np.random.Generator) -> None:
    """Papers, a mug, pens, books, and by turns a plant, a lamp, a picture, letters."""
    for n, (a, b) in enumerate(((0.03, 0.1), (1.16, 0.05), (1.14, 0.09))):
        turn = random.uniform(-0.25, 0.25)
        u, v = 0.2 * np.array([np.cos(turn), np.sin(turn), 0]), 0.27 * np.array([-np.sin(turn), np.cos(turn), 0])
        column, row = (k + 3 * n) % 4, (k // 2 + n) % 2
        uv = (column / 4 + 0.002, row / 2 + 0.498, column / 4 + 0.248, row / 2 + 0.002)
        at.sheet("papers", (a + 0.01, b, TOP + 0.008 + 0.004 * n), u, v, uv=uv)
    at.lathe("glaze", CUP, (0.14 + random.uniform(0, 0.05), 0.44, TOP), TONES[k % 6])
    at.lathe("glaze", POT, (0.09, 0.6, TOP), TONES[(k + 2) % 6])
    for n in range(4):
        at.box(
            "paint",
            (0.072 + 0.01 * n, 0.59 + 0.008 * (n % 2), TOP + 0.02),
            (0.079 + 0.01 * n, 0.597 + 0.008 * (n % 2), TOP + 0.15 + 0.01 * n),
            colour=TONES[(n + k) % 6],
        )
    for n in range(2 + k % 3):
        low = (1.19 + 0.008 * n, 0.44, TOP + 0.032 * n)
        book = spine((k + n) % 4, (5 * k + 11 * n) % 32)
        at.box(BOOK, low, (low[0] + 0.16, 0.66, low[2] + 0.031), 0.12 * n - 0.1, uv=book)
    if k % 4 == 0:
        sprig(at.room, at.at((0.26, 0.63, TOP)), 0.055, 18, random)
    elif k % 4 == 1:
        _lamp(at, TONES[(k + 1) % 6])
    elif k % 4 == 2:
        at.box("posters", (0.62, 0.62, TOP), (0.76, 0.635, TOP + 0.19), 0.2, uv=cell(k, 4, 2))
    for n in range(2):
        uv = (((k + n) % 4) / 4, 0.5, ((k + n) % 4) / 4 + 0.25, 0)
        if k % 4 != 1:
            at.box(LETTER_BLOCK, (0.32 + 0.07 * n, 0.44, TOP), (0.375 + 0.07 * n, 0.495, TOP + 0.055), 0.4 * n, uv=uv)


def _lamp(at: Spot, colour: tuple) -> None:
    at.cylinder("glaze", (0.28, 0.6, TOP), 0.07, 0.015, colour)
    at.cylinder("chrome", (0.28, 0.6, TOP + 0.015), 0.008, 0.4)
    at.box("glaze", (0.1, 0.585, TOP + 0.415), (0.3, 0.615, TOP + 0.435), colour=colour)
    shade = [(0.07, 0), (0.05, 0.07), (0.02, 0.09), (1e-3, 0.09)]
    at.lathe("glaze", shade, (0.12, 0.6, TOP + 0.33), colour)
