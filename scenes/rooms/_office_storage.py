"""What keeps things in `open_office`: lockers with a pegboard, shelves of binders, a printer on its cupboard, bins."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, LETTER_BLOCK, spine
from ._office_desks import CUP, TONES
from ._office_green import sprig
from ._office_materials import cell
from ._office_seats import BLACK
from ._spot import Spot

DOORS = ("oak", "tweed_blue", "birch", "oak", "tweed_gold", "birch", "tweed_grey", "oak")


def lockers(room: Builder, x: float, y: float, angle: float, random: np.random.Generator) -> None:
    """Eight lockers in two rows, things on top of them, and a pegboard on the wall above."""
    at = Spot(room, x, y, angle)
    at.box("smoked", (0, 0.02, 0), (2.2, 0.42, 1.02), repeat=0.7)
    for k in range(8):
        a, z = 0.02 + 0.545 * (k % 4), 0.06 + 0.48 * (k // 4)
        at.box(DOORS[(k * 3) % 8], (a, 0, z), (a + 0.525, 0.02, z + 0.46), repeat=0.5)
        at.box("chrome", (a + 0.46, -0.012, z + 0.2), (a + 0.475, 0, z + 0.32))
        at.sheet("papers", (a + 0.05, -0.004, z + 0.33), (0.09, 0, 0), (0, 0, 0.08), uv=cell(k, 4, 2))
    at.box("pegs", (0.1, 0.4, 1.3), (2.1, 0.42, 2.25), repeat=0.7)
    for k in range(5):
        at.box(
            "steel",
            (0.2 + 0.38 * k, 0.28, 1.45 + 0.35 * (k % 2)),
            (0.48 + 0.38 * k, 0.4, 1.465 + 0.35 * (k % 2)),
            repeat=0.3,
        )
        z = 1.465 + 0.35 * (k % 2)
        if k % 2:
            sprig(room, at.at((0.34 + 0.38 * k, 0.34, z)), 0.05, 16, random)
        else:
            for n in range(2):
                at.lathe("glaze", CUP, (0.27 + 0.38 * k + 0.12 * n, 0.34, z), TONES[(k + n) % 6])
    for k, a in enumerate((0.35, 1.15, 1.85)):
        at.sheet("papers", (a, 0.394, 1.9 - 0.35 * (k % 2)), (0.21, 0, 0), (0.01, 0, 0.28), uv=cell(k + 3, 4, 2))
    _machine(at, 0.35)
    row(at, 0.75, 1.35, 0.1, 1.02, random)
    sprig(room, at.at((1.55, 0.24, 1.02)), 0.08, 26, random)
    for n in range(3):
        at.box(
            "felt",
            (1.75 + 0.02 * n, 0.1, 1.02 + 0.09 * n),
            (2.1 - 0.03 * n, 0.34, 1.11 + 0.09 * n),
            0.08 * n,
            repeat=0.8,
        )


def _machine(at: Spot, a: float) -> None:
    """A coffee machine."""
    at.box("steel", (a - 0.15, 0.1, 1.02), (a + 0.15, 0.38, 1.06), repeat=0.3)
    at.box("steel", (a - 0.15, 0.24, 1.06), (a + 0.15, 0.38, 1.4), repeat=0.3)
    at.box("glaze", (a - 0.15, 0.1, 1.29), (a + 0.15, 0.24, 1.4), colour=(0.04, 0.2, 0.22))
    at.cylinder("chrome", (a, 0.17, 1.24), 0.03, 0.05)
    at.lathe("glaze", CUP, (a, 0.17, 1.06), TONES[2])


def row(at: Spot, start: float, end: float, b: float, z: float, random: np.random.Generator) -> None:
    """Binders and books side by side between two places, with gaps and a trinket now and then."""
    a = start
    while a < end - 0.09:
        kind = random.random()
        if kind < 0.4:
            at.box("binders", (a, b, z), (a + 0.072, b + 0.25, z + 0.3), uv=cell(int(random.integers(0, 16)), 16, 1))
            a += 0.074
        elif kind < 0.86:
            wide, high = random.uniform(0.02, 0.05), random.uniform(0.18, 0.29)
            uv = spine(int(random.integers(0, 4)), int(random.integers(0, 32)))
            at.box(BOOK, (a, b + 0.02, z), (a + wide, b + 0.2, z + high), uv=uv)
            a += wide + 0.002
        elif kind < 0.93:
            k = int(random.integers(0, 4))
            at.box(
                LETTER_BLOCK, (a + 0.01, b + 0.05, z), (a + 0.08, b + 0.12, z + 0.07), uv=(k / 4, 0.5, k / 4 + 0.25, 0)
            )
            a += 0.1
        else:
            at.lathe("glaze", CUP, (a + 0.05, b + 0.1, z), TONES[random.integers(0, 6)])
            a += 0.11


def shelves(
    room: Builder, x: float, y: float, angle: float, wide: float, high: float, random: np.random.Generator
) -> None:
    """A rack of steel posts and boards of oak, filled."""
    at = Spot(room, x, y, angle)
    parts = max(1, round(wide / 0.9))
    for n in range(parts + 1):
        a = (wide - 0.024) * n / parts
        for b in (0.0, 0.326):
            at.box("black", (a, b, 0), (a + 0.024, b + 0.024, high), colour=BLACK)
    levels = np.linspace(0.08, high - 0.03, round(high / 0.4) + 1)
    for k, z in enumerate(levels):
        at.box("oak", (0.004, 0.004, z), (wide - 0.004, 0.346, z + 0.022), repeat=0.8)
        if k == len(levels) - 1:
            sprig(room, at.at((wide * 0.3, 0.18, z + 0.022)), 0.07, 24, random)
            continue
        for n in range(parts):
            start = (wide - 0.03) * n / parts + 0.035
            end = (wide - 0.03) * (n + 1) / parts
            if (k + 2 * n) % 5 == 3:
                for m in range(2):
                    low = (start + 0.05 + 0.3 * m, 0.04, z + 0.022)
                    at.box(("tweed_grey", "kelim")[m], low, (low[0] + 0.26, 0.32, low[2] + 0.22), repeat=0.4)
            else:
                row(at, start, end, 0.04, z + 0.022, random)


def printer(room: Builder, x: float, y: float, angle: float) -> None:
    """A printer with paper in its trays, on a cupboard."""
    at = Spot(room, x, y, angle)
    at.box("birch", (0, 0.02, 0), (1.0, 0.5, 0.68), repeat=0.6)
    for a in (0.02, 0.51):
        at.box("oak", (a, 0, 0.05), (a + 0.47, 0.02, 0.64), repeat=0.5)
        at.box("chrome", (a + 0.2, -0.012, 0.56), (a + 0.3, 0, 0.575))
    at.box("tweed_grey", (0.2, 0.06, 0.68), (0.8, 0.48, 0.9), repeat=0.9)
    at.box("black", (0.2, 0.06, 0.9), (0.8, 0.48, 0.94), colour=(0.5, 0.5, 0.48))
    at.box("black", (0.24, 0.12, 0.94), (0.76, 0.48, 1.06), colour=(0.09, 0.1, 0.11))
    at.sheet("papers", (0.3, 0.04, 0.945), (0.3, 0, 0), (0, 0.07, 0.004), uv=cell(0, 4, 2))
    at.sheet("screens", (0.6, 0.116, 0.96), (0.13, 0, 0), (0, 0, 0.08), uv=cell(1, 4, 2))
    for n in range(5):
        at.box("papers", (0.28, 0.14, 1.06 + 0.012 * n), (0.6, 0.44, 1.07 + 0.012 * n), 0.09 * n, uv=cell(n, 4, 2))
    for n in range(3):
        at.box("binders", (0.03 + 0.055 * n, 0.1, 0.68), (0.083 + 0.055 * n, 0.38, 0.98), uv=cell(3 + n, 16, 1))
    for n in range(4):
        at.box("papers", (0.82, 0.1, 0.68 + 0.05 * n), (0.98, 0.4, 0.725 + 0.05 * n), 0.05 * n, uv=cell(n + 2, 4, 2))


def bins(room: Builder, x: float, y: float, angle: float) -> None:
    """Three bins for what is thrown away, each with a sign."""
    at = Spot(room, x, y, angle)
    for k, cloth in enumerate(("zinc", "tweed_gold", "tweed_blue")):
        at.box(cloth, (0.34 * k, 0, 0), (0.34 * k + 0.31, 0.34, 0.62), repeat=0.4)
        at.box("black", (0.34 * k, 0, 0.62), (0.34 * k + 0.31, 0.34, 0.65), colour=BLACK)
        at.sheet("posters", (0.34 * k + 0.06, -0.004, 0.3), (0.19, 0, 0), (0, 0, 0.26), uv=cell(k + 2, 4, 2))
