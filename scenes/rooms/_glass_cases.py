"""What stands and hangs along the walls of `glass_living`: mirrors, wardrobe, cabinet, door, posters."""

import numpy as np

from . import _glass_music
from ._builder import Builder
from ._furniture import any_colour, bowl
from ._glass_shell import Y
from ._glass_things import books, bottles, framed, poster, sconce

MIRROR = (1.4, 3.6, 1.08, 2.2)  # on the wall y = 0: x from and to, z from and to
CABINET = (2.8, 4.2, 4.76, 5.17)  # x from and to, y from and to
BAYS = (0.55, 1.03, 1.5, 1.96)  # heights of the cabinet's shelves, its top the last
POSTERS = (  # which, lower left corner, along, width, height
    (0, (0.001, 3.3, 1.5), (0, 1, 0), 0.42, 0.56),
    (1, (0.001, 3.85, 1.4), (0, 1, 0), 0.5, 0.8),
    (6, (0.001, 4.5, 1.5), (0, 1, 0), 0.45, 0.6),
    (4, (0.9, Y - 0.001, 1.5), (1, 0, 0), 0.42, 0.56),
    (2, (1.42, Y - 0.001, 1.62), (1, 0, 0), 0.62, 0.55),
    (7, (2.14, Y - 0.001, 1.5), (1, 0, 0), 0.42, 0.56),
    (3, (4.95, 0.001, 1.15), (-1, 0, 0), 0.62, 0.85),
    (5, (1.02, 0.001, 1.4), (-1, 0, 0), 0.3, 0.4),
    (6, (0.62, 0.001, 1.75), (-1, 0, 0), 0.4, 0.5),
)


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    _mirror(room)
    _wardrobe(room, random)
    _glass_music.records(room, random)
    _glass_music.piano(room, random)
    _cabinet(room, random)
    _door(room)
    for which, corner, along, wide, high in POSTERS:
        framed(room, which, corner, along, wide, high)
    for x in (1.12, 3.95):
        sconce(room, x, 1.75 if x > 2 else 1.98)


def _mirror(room: Builder) -> None:
    x0, x1, z0, z1 = MIRROR
    room.sheet("mirror", (x1, 0.02, z0), (x0 - x1, 0, 0), (0, 0, z1 - z0))
    for k, material in enumerate(("gold", "rosewood", "gold")):
        inner, outer, deep = 0.028 * k, 0.028 * (k + 1), 0.05 - 0.012 * k
        for low, high in (
            ((x0 - outer, 0, z0 - outer), (x1 + outer, deep, z0 - inner)),
            ((x0 - outer, 0, z1 + inner), (x1 + outer, deep, z1 + outer)),
            ((x0 - outer, 0, z0 - inner), (x0 - inner, deep, z1 + inner)),
            ((x1 + inner, 0, z0 - inner), (x1 + outer, deep, z1 + inner)),
        ):
            room.box(material, low, high, repeat=0.4)


def _wardrobe(room: Builder, random: np.random.Generator) -> None:
    """Three doors of mirror, and boxes on top."""
    y0, y1, deep, high = 1.0, 3.04, 0.5, 2.15
    room.box("walnut", (0.0, y0, 0), (deep, y1, high), repeat=0.8)
    room.box("gold", (0.0, y0 - 0.02, high), (deep + 0.03, y1 + 0.02, high + 0.03))
    for k in range(3):
        left = y0 + 0.05 + 0.66 * k
        room.sheet("mirror", (deep + 0.008, left, 0.16), (0, 0.6, 0), (0, 0, 1.9))
        for low, top in ((left - 0.02, left), (left + 0.6, left + 0.62)):
            room.box("gold", (deep, low, 0.14), (deep + 0.016, top, 2.08))
        for low, top in ((0.14, 0.16), (2.06, 2.08)):
            room.box("gold", (deep, left, low), (deep + 0.016, left + 0.6, top))
        room.sphere("gold", (deep + 0.03, left + 0.08 + 0.44 * (k == 0), 1.05), 0.02, segments=10)
    for k in range(4):
        low, wide = y0 + 0.08 + 0.5 * k, random.uniform(0.34, 0.44)
        top = high + 0.03 + random.uniform(0.16, 0.3)
        material = ("chevrons", "brocade", "sunburst", "walnut")[k]
        room.box(material, (0.08, low, high + 0.03), (0.44, low + wide, top), repeat=0.5)


def _cabinet(room: Builder, random: np.random.Generator) -> None:
    """Shelves of walnut behind glass at the front and the sides, on a base with doors."""
    x0, x1, y0, y1 = CABINET
    room.box("walnut", (x0, y0, 0.06), (x1, y1, BAYS[0]), repeat=0.7)
    room.box("gold", (x0 + 0.02, y0 + 0.02, 0), (x1 - 0.02, y1, 0.06))
    for k in range(3):
        left = x0 + 0.04 + 0.45 * k
        room.box("rosewood", (left, y0 - 0.015, 0.12), (left + 0.42, y0, 0.5), repeat=0.4)
        room.sphere("gold", (left + 0.37, y0 - 0.03, 0.32), 0.018, segments=10)
    room.box("fans_green", (x0, y1 - 0.02, BAYS[0]), (x1, y1, BAYS[-1]), repeat=1.4)
    for x in (x0, x1 - 0.03):
        room.box("gold", (x, y0, BAYS[0]), (x + 0.03, y0 + 0.03, BAYS[-1]))
    room.box("walnut", (x0 - 0.02, y0 - 0.02, BAYS[-1]), (x1 + 0.02, y1, BAYS[-1] + 0.09), repeat=0.6)
    for z in BAYS[1:-1]:
        room.box("walnut", (x0 + 0.015, y0 + 0.035, z - 0.02), (x1 - 0.015, y1 - 0.021, z), repeat=0.6)
    z0, z1 = BAYS[0] + 0.001, BAYS[-1] - 0.001
    room.box("glass", (x0 + 0.031, y0 + 0.01, z0), (x1 - 0.031, y0 + 0.016, z1))
    for x in (x0 + 0.004, x1 - 0.01):
        room.box("glass", (x, y0 + 0.031, z0), (x + 0.006, y1 - 0.021, z1))
    for bay, z in enumerate(BAYS[:-1]):
        for k in range(11):
            _treasure(room, k + 2 * bay, (x0 + 0.11 + 0.118 * k, 4.96 + 0.05 * (k % 2), z), random)
    books(room, (3.1, 4.95, BAYS[-1] + 0.09), 4, random)
    bottles(room, [(3.4 + 0.12 * k, 4.98, BAYS[-1] + 0.09) for k in range(4)], random)


def _treasure(room: Builder, k: int, foot: tuple, random: np.random.Generator) -> None:
    r, high = random.uniform(0.042, 0.055), random.uniform(0.16, 0.28)
    x, y, z = foot
    kind = k % 6
    if kind == 0:
        room.lathe(
            "glaze",
            [(1e-3, 0), (r * 0.6, 0), (r, high * 0.5), (r * 0.3, high), (r * 0.5, high * 1.2)],
            foot,
            28,
            any_colour(random),
        )
    elif kind == 1:
        room.lathe(
            "gold",
            [(1e-3, 0), (r, 0), (r * 0.3, 0.03), (r * 0.5, high * 0.6), (r * 0.2, high), (1e-3, high * 1.1)],
            foot,
            24,
        )
    elif kind == 2:
        room.sphere("glaze", (x, y, z + r), r, any_colour(random), 14)
    elif kind == 3:
        room.box(
            "posters", (x - r, y, z), (x + r, y + 0.02, z + 3 * r), uv=poster(int(random.integers(0, 8))), angle=0.2
        )
    elif kind == 4:
        room.lathe("glaze", bowl(1.2 * r, 3 * r), foot, 28, any_colour(random))
    else:
        room.lathe("glass", [(1e-3, 0), (r, 0), (r * 0.4, high * 0.5), (r, high), (1e-3, high)], (x, y, z + 0.0005), 28)


def _door(room: Builder) -> None:
    x0, x1 = 4.34, 5.14
    room.box("rosewood", (x0, Y - 0.045, 0), (x1, Y, 2.1), repeat=0.8)
    for k in range(5):
        low = 0.12 + 0.39 * k
        inset = 0.06 + 0.04 * abs(k - 2)
        room.box("gold", (x0 + inset, Y - 0.052, low), (x1 - inset, Y - 0.045, low + 0.34))
        room.box("walnut", (x0 + inset + 0.02, Y - 0.06, low + 0.02), (x1 - inset - 0.02, Y - 0.052, low + 0.32))
    room.sphere("gold", (x0 + 0.04, Y - 0.075, 1.02), 0.03, segments=12)
