"""Floor, walls, coffered ceiling and window front of `glass_living`, and the evening outside."""

import numpy as np

from ._builder import Builder
from ._furniture import any_colour
from ._glass_things import UPRIGHT, vase

X, Y, Z = 5.4, 5.2, 2.8
WINDOW = (0.6, 4.6, 0.56, 2.4)  # lowest and highest y, lowest and highest z, in the wall x = X
COFFERS = 4  # each way
OUTSIDE_M = 0.9  # from the window to the picture behind it
RAIL = 0.8  # height of the panelling
PAPER_M = 2.1  # width of the wallpaper's pattern


def add(room: Builder, random: np.random.Generator) -> None:
    """All that bounds the room, the window's sill and curtains among it."""
    _walls(room)
    _panelling(room)
    _ceiling(room)
    _outside(room)
    _window(room)
    _sill(room, random)
    for y0, y1 in ((0.06, 0.74), (4.46, 5.12)):
        _curtain(room, y0, y1)
    _chandelier(room)


def _walls(room: Builder) -> None:
    y0, y1, z0, z1 = WINDOW
    room.sheet("terrazzo", (0, 0, 0), (X, 0, 0), (0, Y, 0), repeat=1.8)
    room.sheet("fans_green", (X, 0, 0), (-X, 0, 0), (0, 0, Z), repeat=PAPER_M)
    room.sheet("fans_green", (0, Y, 0), (X, 0, 0), (0, 0, Z), repeat=PAPER_M)
    room.sheet("fans_cream", (0, 0, 0), (0, Y, 0), (0, 0, Z), repeat=PAPER_M)
    for low_y, high_y, low_z, high_z in ((0, y0, 0, Z), (y1, Y, 0, Z), (y0, y1, 0, z0), (y0, y1, z1, Z)):
        uv = ((Y - high_y) / PAPER_M, low_z / PAPER_M, (Y - low_y) / PAPER_M, high_z / PAPER_M)
        room.sheet("fans_cream", (X, high_y, low_z), (0, low_y - high_y, 0), (0, 0, high_z - low_z), uv=uv)


def _panelling(room: Builder) -> None:
    """Veneer to the height of a table, a golden rail above it; under the window it ends below the sill."""
    for low, high, top in (
        ((0, 0), (X, 0.02), RAIL),
        ((0, Y - 0.02), (X, Y), RAIL),
        ((0, 0), (0.02, Y), RAIL),
        ((X - 0.02, 0), (X, Y), WINDOW[2] - 0.06),
    ):
        room.box("walnut", (*low, 0), (*high, top), repeat=0.9)
    for low, high in (((0, 0), (X, 0.024)), ((0, Y - 0.024), (X, Y)), ((0, 0), (0.024, Y))):
        room.box("gold", (*low, RAIL), (*high, RAIL + 0.025))
        room.box("gold", (*low, 0), (*high, 0.06))


def _ceiling(room: Builder) -> None:
    """Rosettes between beams, a golden fillet under each beam."""
    room.sheet("stucco", (0, Y, Z), (X, 0, 0), (0, -Y, 0), uv=(0, 0, COFFERS, COFFERS))
    for k in range(COFFERS + 1):
        x, y = X * k / COFFERS, Y * k / COFFERS
        left, right = max(x - 0.08, 0), min(x + 0.08, X)
        near, far = max(y - 0.08, 0), min(y + 0.08, Y)
        room.box("stucco_beam", (left, 0, Z - 0.12), (right, Y, Z), repeat=0.6)
        room.box("stucco_beam", (0, near, Z - 0.124), (X, far, Z), repeat=0.6)
        room.box("gold", (max(x - 0.02, 0), 0, Z - 0.13), (min(x + 0.02, X), Y, Z - 0.12))
        room.box("gold", (0, max(y - 0.02, 0), Z - 0.134), (X, min(y + 0.02, Y), Z - 0.124))


def _outside(room: Builder) -> None:
    """The city behind the window, and strips of it on four sides, so that no look from a corner passes it by."""
    y0, y1, z0, z1 = WINDOW[0] - 0.7, WINDOW[1] + 0.7, WINDOW[2] - 0.7, WINDOW[3] + 0.5
    near, far = X + 0.01, X + OUTSIDE_M
    wide, high, deep = y1 - y0, z1 - z0, far - near
    room.sheet("skyline", (far, y1, z0), (0, -wide, 0), (0, 0, high), uv=UPRIGHT)
    room.sheet("skyline", (near, y1, z0), (deep, 0, 0), (0, 0, high), uv=(0.15, 1, 0, 0))
    room.sheet("skyline", (far, y0, z0), (-deep, 0, 0), (0, 0, high), uv=(1, 1, 0.85, 0))
    room.sheet("skyline", (near, y0, z0), (deep, 0, 0), (0, wide, 0), uv=(0.1, 0.9, 0.9, 1))
    room.sheet("skyline", (near, y1, z1), (deep, 0, 0), (0, -wide, 0), uv=(0, 0, 1, 0.12))


def _window(room: Builder) -> None:
    """A frame of rosewood, and bars that make a fan of each upper light."""
    y0, y1, z0, z1 = WINDOW
    for low, high in (
        ((X - 0.03, y0 - 0.06, z0 - 0.06), (X + 0.1, y0, z1 + 0.06)),
        ((X - 0.03, y1, z0 - 0.06), (X + 0.1, y1 + 0.06, z1 + 0.06)),
        ((X - 0.03, y0, z0 - 0.06), (X + 0.1, y1, z0)),
        ((X - 0.03, y0, z1), (X + 0.1, y1, z1 + 0.06)),
        ((X, y0, 1.88), (X + 0.05, y1, 1.93)),
    ):
        room.box("rosewood", low, high)
    quarter = (y1 - y0) / 4
    for k in range(1, 4):
        y = y0 + quarter * k
        room.box("rosewood", (X, y - 0.025, z0), (X + 0.06, y + 0.025, z1))
    for k in range(4):
        for part in (0.25, 0.5, 0.75):
            y = y0 + quarter * (k + part)
            room.box("gold", (X + 0.01, y - 0.008, 1.93), (X + 0.03, y + 0.008, z1))
        room.box("gold", (X + 0.012, y0 + quarter * k + 0.02, 2.15), (X + 0.028, y0 + quarter * (k + 1) - 0.02, 2.166))
    room.box("gold", (X - 0.19, 0.02, 2.5), (X - 0.16, Y - 0.02, 2.53))
    for y in (0.04, Y / 2, Y - 0.04):
        room.box("gold", (X - 0.16, y - 0.012, 2.505), (X, y + 0.012, 2.525))


def _sill(room: Builder, random: np.random.Generator) -> None:
    top = 0.5
    room.box("marble", (X - 0.24, 0.8, top - 0.04), (X, 4.4, top), repeat=0.9)
    for k, y in enumerate(np.linspace(0.95, 4.25, 12)):
        foot = (X - 0.13, float(y), top)
        if k % 4 == 0:
            vase(room, foot, 0.06, 0.24)
        elif k % 4 == 1:
            room.box("sunburst", (X - 0.2, y - 0.07, top), (X - 0.06, y + 0.07, top + 0.14), uv=UPRIGHT, angle=0.2 * k)
        elif k % 4 == 2:
            room.sphere("glass", (X - 0.13, float(y), top + 0.061), 0.06)
        else:
            room.lathe("glaze", [(1e-3, 0), (0.05, 0), (0.08, 0.12), (0.07, 0.13)], foot, 28, any_colour(random))
            _tuft(room, (X - 0.13, float(y), top + 0.11), random)


def _tuft(room: Builder, foot: tuple, random: np.random.Generator) -> None:
    """The leaves of a small plant."""
    start = np.array(foot)
    for k in range(16):
        angle = k * 2.4
        reach = np.array([0.09 * np.cos(angle), 0.09 * np.sin(angle), random.uniform(0.08, 0.22)])
        side = np.array([-np.sin(angle), np.cos(angle), 0]) * 0.022
        outline = [start, start + reach * 0.6 + side, start + reach, start + reach * 0.6 - side]
        room.faces("leaf", outline, [[0, 1, 2], [0, 2, 3]], [[0, 0.5], [0.5, 1], [1, 0.5], [0.5, 0]])


def _curtain(room: Builder, y0: float, y1: float) -> None:
    """Brocade in folds from the rod to the floor."""
    n = 49
    along = np.linspace(0, 1, n)
    x = X - 0.175 + 0.045 * np.sin(along * 7 * 2 * np.pi)
    y = y1 + (y0 - y1) * along
    low, high = (np.stack([x, y, np.full(n, z)], 1) for z in (0.01, 2.515))
    i = np.arange(n - 1)
    halves = [np.stack([i, i + 1, n + i + 1], 1), np.stack([i, n + i + 1, n + i], 1)]
    uv = np.concatenate([np.stack([along * 1.2, np.full(n, v)], 1) for v in (2.8, 0.0)])
    room.faces("brocade", np.concatenate([low, high]), np.concatenate(halves), uv)


def _chandelier(room: Builder) -> None:
    """Three tiers of alabaster on a golden rod in the middle of the ceiling."""
    x, y = X / 2, Y / 2
    room.cylinder("gold", (x, y, 2.3), 0.015, Z - 0.135 - 2.3)
    for k, (r, z) in enumerate(((0.14, 2.2), (0.24, 2.3), (0.34, 2.4))):
        room.lathe("alabaster", [(1e-3, 0), (r * 0.7, 0.0), (r, 0.07)], (x, y, z), 40)
        room.lathe("gold", [(r, 0), (r + 0.012, 0.006), (r + 0.012, 0.022), (r, 0.024)], (x, y, z + 0.07), 40)
        for turn in range(4 * (k > 0)):
            angle = turn * np.pi / 2
            place = (x + 0.5 * r * np.cos(angle), y + 0.5 * r * np.sin(angle), z)
            room.cylinder("gold", place, 0.006, 0.1)
