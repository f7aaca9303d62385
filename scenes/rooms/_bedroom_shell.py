"""The bedroom's shell: parquet, walls, the slope of the roof, beams, window, door and the carpet."""

import numpy as np

from ._bedroom_shapes import curtain, garment, pillow, poster, upright
from ._builder import Builder
from ._furniture import cell

X, Y, Z = 3.4, 4.2, 2.45
KNEE, RIDGE = 1.5, 1.0  # height of the low wall x = 0, and where the slope above it meets the ceiling
BOARDS = 9  # of the slope
RAIL = 0.88  # height of the panelling and of the window's sill
WINDOW = (1.42, 2.38, RAIL, 2.0)  # lowest and highest x, lowest and highest z, in the wall y = Y


def add(room: Builder) -> None:
    """All of it."""
    _floor_and_ceiling(room)
    _slope(room)
    _walls(room)
    _timber(room)
    _window(room)
    _door(room)


def on_slope(y: float, up: float, off: float = 0.0) -> np.ndarray:
    """(3,) the place at `y`, at a share of the slope from the low wall to the ceiling, so many metres off it."""
    way = np.array([RIDGE, 0, Z - KNEE])
    outward = np.array([Z - KNEE, 0, -RIDGE]) / np.hypot(Z - KNEE, RIDGE)
    return np.array([0, y, KNEE]) + way * up + outward * off


def _floor_and_ceiling(room: Builder) -> None:
    room.sheet("herringbone", (0, 0, 0), (X, 0, 0), (0, Y, 0), repeat=1.5)
    room.sheet("whitewash", (RIDGE, Y, Z), (X - RIDGE, 0, 0), (0, -Y, 0), repeat=1.3)
    room.sheet("kilim", (1.2, 1.0, 0.006), (1.35, 0, 0), (0, 1.9, 0))
    room.sheet("knit_grey", (1.12, 2.95, 0.008), (0.5, 0.1, 0), (-0.12, 0.6, 0), (0, 0, 1.2, 1.2))


def _slope(room: Builder) -> None:
    """Each board is a part of its own, so that a camera may come near it."""
    for k in range(BOARDS):
        low, high = on_slope(0, k / BOARDS), on_slope(0, (k + 1) / BOARDS)
        start, row = 0.37 * k, (5 * k) % 8
        uv = (start, (row + 1) / 8, start + Y / 1.2, row / 8)
        room.sheet("pine", low, (0, Y, 0), high - low, uv)
    cards = ((2.3, 0.14), (2.62, 0.3), (2.95, 0.12), (3.3, 0.26), (3.62, 0.1), (0.5, 0.42))
    more = ((0.85, 0.14), (1.2, 0.32), (1.5, 0.16), (1.75, 0.44), (0.2, 0.2), (2.2, 0.55))
    for k, (y, up) in enumerate(cards + more):
        way = on_slope(0, 1) - on_slope(0, 0)
        turn = 0.03 * np.sin(9 * k)
        u = np.array([0, 0.2, 0]) + turn * way / np.linalg.norm(way)
        room.sheet(
            "notes",
            on_slope(y, up, 0.008),
            u,
            0.2 * way / np.linalg.norm(way),
            cell((2 * k + 1 + 2 * (k // 8)) % 16, 4, 4),
        )


def _walls(room: Builder) -> None:
    x0, x1, z0, z1 = WINDOW
    room.sheet("whitewash", (0, Y, 0), (0, 0, KNEE), (0, -Y, 0), (0, 0, KNEE / 1.1, Y / 1.1))
    room.sheet("logs", (X, 0, 0), (-X, 0, 0), (0, 0, Z), repeat=1.25)
    room.sheet("sage", (X, 0, 0), (0, 0, RAIL), (0, Y, 0), repeat=1.0)
    room.sheet("sage", (X, Y, 0), (0, 0, RAIL), (-X, 0, 0), (0.3, 0, 0.3 + RAIL, X))
    upright(room, "blossom", (X, Y, RAIL), (0, -Y, 0), (0, 0, Z - RAIL), 1.15)
    for left, right, low, high in ((0, x0, RAIL, Z), (x1, X, RAIL, Z), (x0, x1, z1, Z)):
        uv = (left / 1.15, (Z - low) / 1.15, right / 1.15, (Z - high) / 1.15)
        room.sheet("blossom", (left, Y, low), (right - left, 0, 0), (0, 0, high - low), uv)
    corner = (x0 - 0.35, Y + 0.3, z0 - 0.25)
    room.sheet("fells", corner, (x1 - x0 + 0.7, 0, 0), (0, 0, z1 - z0 + 0.5), (0, 1, 1, 0))


def _timber(room: Builder) -> None:
    for y in (0.7, 2.1, 3.5):
        room.box("walnut", (RIDGE, y - 0.06, Z - 0.12), (X, y + 0.06, Z), repeat=0.6)
    room.box("walnut", (RIDGE - 0.06, 0, Z - 0.06), (RIDGE + 0.02, Y, Z), repeat=0.5)
    room.box("walnut", (0, 0, KNEE - 0.03), (0.025, Y, KNEE + 0.02), repeat=0.5)
    room.box("walnut", (X - 0.025, 0.62, RAIL - 0.02), (X, Y, RAIL + 0.03), repeat=0.5)
    for left, right in ((0, WINDOW[0] - 0.06), (WINDOW[1] + 0.06, X)):
        room.box("walnut", (left, Y - 0.025, RAIL - 0.02), (right, Y, RAIL + 0.03), repeat=0.5)
    for low, high in (
        ((0, 0, 0), (X, 0.02, 0.1)),
        ((0, Y - 0.02, 0), (X, Y, 0.1)),
        ((0, 0, 0), (0.02, Y, 0.1)),
        ((X - 0.02, 0, 0), (X, Y, 0.1)),
    ):
        room.box("walnut", low, high, repeat=0.5)


def _window(room: Builder) -> None:
    """Frame, bars, sill, radiator, rod and curtains."""
    x0, x1, z0, z1 = WINDOW
    middle = (x0 + x1) / 2
    for low, high in (
        ((x0 - 0.06, Y - 0.03, z0), (x0, Y + 0.1, z1 + 0.06)),
        ((x1, Y - 0.03, z0), (x1 + 0.06, Y + 0.1, z1 + 0.06)),
        ((x0, Y - 0.03, z1), (x1, Y + 0.1, z1 + 0.06)),
        ((x0 - 0.06, Y - 0.16, z0 - 0.04), (x1 + 0.06, Y + 0.1, z0)),
        ((middle - 0.02, Y, z0), (middle + 0.02, Y + 0.05, z1)),
        ((x0, Y, 1.58), (x1, Y + 0.05, 1.61)),
    ):
        room.box("birch", low, high)
    for k in range(12):
        x = x0 + 0.08 * k
        room.box("whitewash", (x, Y - 0.11, 0.12), (x + 0.06, Y - 0.02, 0.66), repeat=0.5)
    room.box("walnut", (x0, Y - 0.1, 0.66), (x1 - 0.02, Y - 0.03, 0.68))
    room.box("walnut", (1.06, Y - 0.1, 2.13), (2.76, Y - 0.07, 2.16))
    for x in (1.08, 2.72):
        room.box("walnut", (x, Y - 0.07, 2.13), (x + 0.03, Y, 2.16))
    curtain(room, "tartan", (1.1, Y - 0.085, 0.72), (1, 0, 0), 0.36, 1.41, 0.6)
    curtain(room, "tartan", (2.34, Y - 0.085, 0.92), (1, 0, 0), 0.36, 1.21, 0.6)
    for k, x in enumerate((1.56, 1.72, 2.1, 2.26)):
        pot = [(1e-3, 0), (0.04, 0), (0.055, 0.09), (0.045, 0.09), (0.045, 0.07), (1e-3, 0.07)]
        room.lathe("glaze", pot, (x, Y - 0.08, z0), 24, ((0.5, 0.14, 0.06), (0.75, 0.55, 0.25))[k % 2])
        for step in range(6):
            turn = step * 1.05 + k
            way = 0.035 * np.array([np.cos(turn), np.sin(turn), 0])
            high = np.array([0, 0, 0.1 + 0.02 * (step % 3)])
            centre = np.array([x, Y - 0.085, z0 + 0.07]) + high / 2 + way * 0.6
            pillow(room, "leaf", centre, 0.35 * np.cross(high, way / 0.035), high / 1.6 + way, way * 0.3, 1)


def _door(room: Builder) -> None:
    """A door in the wall y = 0, with four panels."""
    for low, high in (
        ((1.14, 0, 0), (1.22, 0.035, 2.08)),
        ((2.0, 0, 0), (2.08, 0.035, 2.08)),
        ((1.22, 0, 2.0), (2.0, 0.035, 2.08)),
    ):
        room.box("walnut", low, high, repeat=0.4)
    room.sheet("pine", (1.22, 0.024, 0), (0, 0, 2.0), (0.78, 0, 0), (0, 0.3, 2.0, 1.08))
    for x in (1.3, 1.65):
        for low, high in ((0.18, 0.9), (1.05, 1.85)):
            room.sheet("sage", (x, 0.029, low), (0, 0, high - low), (0.27, 0, 0), (0, x, (high - low) * 0.9, x + 0.3))
    poster(room, 3, (1.85, 0.026, 1.12), (-1, 0, 0), 0.66)
    garment(room, "ticking", (1.3, 0.03, 1.86), (-1, 0, 0), 0.26, 0.8, 0.09, 0.45)
    room.box("steel", (1.29, 0.024, 1.84), (1.31, 0.07, 1.86))
    room.box("steel", (1.27, 0.024, 0.94), (1.3, 0.05, 1.1))
    room.box("steel", (1.27, 0.05, 1.0), (1.4, 0.07, 1.02))
