"""The meeting and lounge space of `open_office`, and what hangs on its walls."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, spine
from ._office_desks import CUP, TONES
from ._office_green import sprig, tree
from ._office_materials import cell
from ._office_seats import BLACK, pouf, shell_chair, sofa
from ._office_storage import printer, shelves
from ._spot import Spot

CLOTHS = ("tweed_gold", "tweed_grey", "tweed_blue", "tweed_grey", "tweed_gold", "tweed_blue")


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    _table(room, random)
    _whiteboard(room)
    shelves(room, 10.65, 3.0, -np.pi / 2, 2.7, 2.3, random)
    printer(room, 7.58, 3.66, np.pi / 2)
    _lounge(room, random)
    tree(room, 10.62, 4.62, 2.1, (9.7, 3.9, 0), (10.9, 4.93, 2.6), random)
    for k, (y, z, wide) in enumerate(((0.1, 1.25, 0.55), (0.72, 1.35, 0.5), (0.2, 0.45, 0.45), (0.78, 0.5, 0.5))):
        poster(room, k + 4, 7.05, y, np.pi / 2, z, wide)
    for k, (x, z) in enumerate(((10.75, 1.2), (7.6, 0.95), (7.6, 1.6))):
        poster(room, k, x, 0.0, np.pi, z, 0.42)


def poster(room: Builder, which: int, x: float, y: float, angle: float, z: float, wide: float) -> None:
    """One of the eight posters in a frame on a wall that is ahead; (x, y) is on the wall, at the poster's left."""
    at = Spot(room, x, y, angle, z)
    high = wide * 1.375
    at.box("smoked", (-0.02, -0.02, -0.02), (wide + 0.02, 0, high + 0.02), repeat=0.3)
    at.sheet("posters", (0, -0.024, 0), (wide, 0, 0), (0, 0, high), uv=cell(which, 4, 2))


def _table(room: Builder, random: np.random.Generator) -> None:
    """A table for six with papers, laptops, mugs and a plant."""
    at = Spot(room, 8.0, 1.35)
    at.box("oak", (0, 0, 0.71), (1.9, 0.9, 0.745), repeat=0.9)
    for a in (0.62, 1.22):
        for b in (0.1, 0.74):
            at.box("black", (a, b, 0), (a + 0.06, b + 0.06, 0.71), colour=BLACK)
    for k, a in enumerate((0.35, 0.95, 1.55)):
        shell_chair(room, 8.0 + a, 1.27, 0.1 * (k - 1), CLOTHS[k])
        shell_chair(room, 8.0 + a, 2.36, np.pi + 0.12 * (1 - k), CLOTHS[k + 3])
    for k, (a, b, turn) in enumerate(((0.2, 0.08, 0.0), (1.5, 0.84, np.pi), (0.85, 0.1, 0.1))):
        place = at.at((a, b, 0.745))
        if k < 2:
            _laptop(Spot(room, place[0], place[1], turn, 0.745), 3 * k)
        else:
            for n in range(4):
                at.box(
                    "papers",
                    (a, b, 0.745 + 0.008 * n),
                    (a + 0.21, b + 0.28, 0.752 + 0.008 * n),
                    0.2 * n,
                    uv=cell(n + 3, 4, 2),
                )
    for k, (a, b) in enumerate(((0.62, 0.14), (1.25, 0.2), (0.6, 0.75), (1.72, 0.62), (1.2, 0.7))):
        at.lathe("glaze", CUP, (a, b, 0.745), TONES[k])
        uv = cell(k, 4, 2)
        at.sheet(
            "papers",
            (a - 0.3, b - 0.03 + 0.03 * (k % 2), 0.75 + 0.004 * k),
            (0.2, 0.03 * k, 0),
            (-0.04 * k, 0.2, 0),
            uv=uv,
        )
    for n in range(3):
        at.box(BOOK, (0.2, 0.5, 0.745 + 0.035 * n), (0.42, 0.68, 0.779 + 0.035 * n), 0.3 * n, uv=spine(n, 7 * n + 2))
    sprig(room, at.at((0.95, 0.5, 0.745)), 0.075, 30, random)


def _laptop(at: Spot, picture: int) -> None:
    at.box("steel", (0, 0, 0), (0.32, 0.22, 0.014), repeat=0.3)
    at.sheet("keys", (0.02, 0.07, 0.0175), (0.28, 0, 0), (0, 0.13, 0), uv=(0, 1, 1, 0))
    at.box("steel", (0, 0.222, 0.005), (0.32, 0.23, 0.22), repeat=0.3)
    at.sheet("screens", (0.01, 0.2185, 0.02), (0.3, 0, 0), (0, 0, 0.19), uv=cell(picture, 4, 2))


def _whiteboard(room: Builder) -> None:
    """A whiteboard full of drawings on the wall y = 0, with a tray of pens."""
    at = Spot(room, 10.0, 0.0, np.pi)
    at.box("steel", (-0.03, -0.02, 0.87), (2.03, 0, 1.98), repeat=0.4)
    at.sheet("whiteboard", (0, -0.024, 0.9), (2.0, 0, 0), (0, 0, 1.05), uv=(0, 1, 1, 0))
    at.box("steel", (0.3, -0.09, 0.85), (1.7, -0.0, 0.868), repeat=0.4)
    for k in range(7):
        a = 0.4 + 0.16 * k
        at.box("paint", (a, -0.07, 0.868), (a + 0.12, -0.052, 0.886), 0.1 * (k % 3), colour=TONES[(k * 2 + 1) % 6])


def _lounge(room: Builder, random: np.random.Generator) -> None:
    """A sofa below the windows, a rug, a low table, stools; slats on the wall x = 11."""
    room.sheet("kelim", (7.95, 2.95, 0.006), (2.3, 0, 0), (0, 1.2, 0), repeat=1.2)
    sofa(room, 9.15, 4.7, np.pi)
    at = Spot(room, 8.7, 3.1)
    at.box("birch", (0, 0, 0.36), (0.9, 0.5, 0.39), repeat=0.7)
    for a in (0.05, 0.8):
        for b in (0.05, 0.4):
            at.box("black", (a, b, 0), (a + 0.05, b + 0.05, 0.36), colour=BLACK)
    at.box("oak", (0.085, 0.085, 0.14), (0.815, 0.415, 0.16), repeat=0.7)
    for n in range(4):
        at.box(
            BOOK,
            (0.1, 0.12, 0.39 + 0.03 * n),
            (0.36, 0.32, 0.419 + 0.03 * n),
            0.25 * n - 0.3,
            uv=spine(3 - n, 9 * n + 1),
        )
        at.box("papers", (0.2, 0.1, 0.16 + 0.02 * n), (0.5, 0.4, 0.179 + 0.02 * n), 0.1 * n, uv=cell(n, 4, 2))
    at.lathe("glaze", CUP, (0.5, 0.3, 0.39), TONES[1])
    at.lathe("glaze", CUP, (0.75, 0.15, 0.39), TONES[4])
    at.box("posters", (0.52, 0.06, 0.39), (0.68, 0.2, 0.4), 0.5, uv=cell(6, 4, 2))
    pouf(room, 10.1, 3.35, "tweed_gold")
    pouf(room, 8.2, 3.55, "kelim")
    room.sheet("felt", (10.99, 5.0, 0.1), (0, -1.9, 0), (0, 0, 2.5), repeat=1.6)
    for k in range(19):
        room.box("oak", (10.955, 3.12 + 0.1 * k, 0.1), (10.995, 3.165 + 0.1 * k, 2.6), repeat=0.6)
