"""The work space of `open_office`: desks along a wall and face to face, what stands between, what hangs on walls."""

import numpy as np

from ._builder import Builder
from ._office_desks import TONES, desk
from ._office_green import sprig, tree
from ._office_materials import cell
from ._office_meeting import poster
from ._office_seats import BLACK, pouf, swivel
from ._office_storage import bins, lockers, row, shelves
from ._spot import Spot

DESKS = (  # near left corner, angle, how far the chair is out, how it is turned, its cloth
    (5.5, 0.75, np.pi, 0.26, 0.3, "tweed_grey"),
    (3.9, 0.75, np.pi, 0.22, -0.1, "tweed_blue"),
    (2.3, 0.75, np.pi, 0.3, -0.5, "tweed_gold"),
    (1.7, 2.35, 0.0, 0.24, 0.2, "tweed_blue"),
    (3.2, 2.35, 0.0, 0.2, -0.3, "tweed_grey"),
    (4.6, 3.85, np.pi, 0.22, 0.1, "tweed_gold"),
    (3.1, 3.85, np.pi, 0.24, -0.4, "tweed_grey"),
)
POSTERS = (  # which, place on the wall, angle, height of the lower edge, width
    (0, (0.0, 0.25), np.pi / 2, 1.2, 0.7),
    (1, (0.0, 3.75), np.pi / 2, 1.3, 0.5),
    (4, (0.0, 4.35), np.pi / 2, 1.2, 0.45),
    (6, (0.0, 3.8), np.pi / 2, 0.45, 0.45),
    (2, (6.9, 1.38), -np.pi / 2, 1.0, 0.6),
    (3, (6.9, 0.68), -np.pi / 2, 1.15, 0.5),
    (7, (6.7, 0.0), np.pi, 0.95, 0.42),
    (5, (6.2, 0.0), np.pi, 0.9, 0.45),
    (1, (6.9, 4.55), -np.pi / 2, 1.75, 0.42),
    (7, (6.9, 3.98), -np.pi / 2, 1.72, 0.4),
)


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    for k, (x, y, angle, out, turn, cloth) in enumerate(DESKS):
        desk(room, x, y, angle, k, random)
        seat = Spot(room, x, y, angle).at((0.66, -out, 0))
        swivel(room, seat[0], seat[1], angle + turn, cloth)
    _screens_between(room)
    _above_desks(room, random)
    lockers(room, 0.42, 1.4, np.pi / 2, random)
    shelves(room, 6.55, 4.75, -np.pi / 2, 1.15, 1.65, random)
    bins(room, 6.8, 0.4, np.pi)
    _trolley(room, random)
    tree(room, 5.35, 4.42, 1.9, (4.7, 3.9, 0), (6.1, 4.74, 2.5), random)
    tree(room, 0.42, 4.52, 1.7, (0.03, 4.0, 0), (0.9, 4.74, 2.4), random)
    room.sheet("kelim", (5.1, 1.75, 0.006), (1.5, 0, 0), (0, 1.7, 0), repeat=1.2)
    pouf(room, 6.35, 3.2, "tweed_blue")
    for which, (x, y), angle, z, wide in POSTERS:
        poster(room, which, x, y, angle, z, wide)


def _screens_between(room: Builder) -> None:
    """Felt between those who sit face to face, with papers pinned to it, and at the desks' ends."""
    for x0, x1 in ((1.7, 3.1), (3.2, 4.6)):
        room.box("felt", (x0, 3.085, 0.6), (x1, 3.115, 1.32), repeat=1.1)
        for k in range(3):
            x, z = x0 + 0.12 + 0.45 * k, 1.03 + 0.03 * (k % 2)
            room.sheet("papers", (x, 3.08, z), (0.16, 0, 0.01), (-0.01, 0, 0.21), uv=cell(k + 2, 4, 2))
            room.sheet("papers", (x + 0.3, 3.12, z), (-0.16, 0, 0.01), (0.01, 0, 0.21), uv=cell(k + 5, 4, 2))
    for y in (2.4, 3.17):
        room.box("tweed_grey", (3.135, y, 0.5), (3.165, y + 0.63, 1.12), repeat=0.5)


def _above_desks(room: Builder, random: np.random.Generator) -> None:
    """Boards with binders on the felt wall, and papers pinned below them."""
    for k, x in enumerate((5.45, 3.85, 2.25)):
        at = Spot(room, x, 0.27, np.pi)
        at.box("oak", (0, 0, 1.5), (1.3, 0.27, 1.525), repeat=0.7)
        for a in (0.15, 1.12):
            at.box("black", (a, 0.02, 1.47), (a + 0.03, 0.27, 1.5), colour=BLACK)
        row(at, 0.03, 1.0, 0.01, 1.525, random)
        sprig(room, at.at((1.15, 0.13, 1.525)), 0.06, 20, random)
        for n in range(4):
            a, z = 0.05 + 0.31 * n, 1.2 + 0.04 * ((n + k) % 3)
            at.sheet("papers", (a, 0.265, z), (0.18, 0, 0.01 * (n - 1)), (0, 0, 0.24), uv=cell(n + 3 * k, 4, 2))
    at = Spot(room, 0.82, 0.02, np.pi)
    at.box("smoked", (0, -0.35, 0), (0.75, 0, 0.42), repeat=0.5)
    for n in range(3):
        at.box(
            "papers",
            (0.05 + 0.02 * n, -0.32, 0.42 + 0.09 * n),
            (0.4, -0.05, 0.5 + 0.09 * n),
            0.1 * n,
            uv=cell(n + 1, 4, 2),
        )
    sprig(room, at.at((0.56, -0.17, 0.42)), 0.11, 34, random)


def _trolley(room: Builder, random: np.random.Generator) -> None:
    """A low cupboard at the end of the desks, with a globe, boxes and binders."""
    at = Spot(room, 5.02, 2.5, np.pi / 2)
    at.box("oak", (0, 0, 0.04), (1.2, 0.36, 0.6), repeat=0.7)
    for a in (0.03, 1.13):
        for b in (0.03, 0.29):
            at.box("black", (a, b, 0), (a + 0.04, b + 0.04, 0.04), colour=BLACK)
    for k in range(3):
        at.box(
            ("birch", "tweed_blue", "birch")[k], (0.02 + 0.39 * k, -0.015, 0.08), (0.39 + 0.39 * k, 0, 0.57), repeat=0.4
        )
    row(at, 0.05, 0.6, 0.06, 0.6, random)
    at.cylinder("black", (0.75, 0.18, 0.6), 0.07, 0.03, TONES[0])
    room.sphere("letters", at.at((0.75, 0.18, 0.74)), 0.115)
    for n in range(3):
        at.box(
            "kelim" if n % 2 else "felt",
            (0.92, 0.06, 0.6 + 0.08 * n),
            (1.16 - 0.02 * n, 0.3, 0.68 + 0.08 * n),
            0.1 * n,
            repeat=0.6,
        )
