"""The living room of `kitchen_living`: sofa, tables with what stands on them, sideboard, mirror, pictures, a plant."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, FRUIT, LETTER_BLOCK, any_colour, bookcase, chair, flowers, leaves, legs, picture

PICTURES = (  # which, lower left corner, along, width, height
    (0, (1.5, 0.001, 1.25), (-1, 0, 0), 0.7, 0.7),
    (1, (2.45, 0.001, 1.3), (-1, 0, 0), 0.6, 0.6),
    (4, (3.2, 0.001, 1.35), (-1, 0, 0), 0.5, 0.5),
    (5, (5.45, 0.001, 1.2), (-1, 0, 0), 0.6, 0.6),
    (2, (0.001, 0.12, 1.3), (0, 1, 0), 0.65, 0.65),
    (3, (0.001, 3.0, 1.0), (0, 1, 0), 0.35, 0.4),
    (6, (5.999, 3.75, 1.5), (0, -1, 0), 0.5, 0.5),
    (7, (5.999, 0.75, 1.2), (0, -1, 0), 0.55, 0.7),
    (5, (4.22, 3.999, 1.95), (1, 0, 0), 0.25, 0.35),
)


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    bookcase(room, 0.95, 2.95, random)
    _sofa(room)
    _low_table(room)
    _dining(room, random)
    _sideboard(room, random)
    for which, corner, along, wide, high in PICTURES:
        picture(room, which, corner, along, wide, high)
    _plant_and_lamp(room, random)
    _toys(room, random)


def _sofa(room: Builder) -> None:
    for low, high in (
        ((0.5, 0.05, 0.1), (2.4, 0.85, 0.42)),
        ((0.5, 0.03, 0.42), (2.4, 0.25, 0.85)),
        ((0.4, 0.05, 0.1), (0.58, 0.88, 0.6)),
        ((2.32, 0.05, 0.1), (2.5, 0.88, 0.6)),
    ):
        room.box("plaid", low, high, repeat=0.6)
    for k, x in enumerate((0.85, 1.45, 2.05)):
        material = "cushion" if k != 1 else "rug"
        room.box(material, (x - 0.2, 0.26, 0.43), (x + 0.2, 0.4, 0.8), repeat=0.4, angle=0.15 * (k - 1))


def _low_table(room: Builder) -> None:
    room.sheet("rug", (0.45, 1.0, 0.006), (2.1, 0, 0), (0, 1.5, 0))
    room.box("wood_red", (1.0, 1.3, 0.38), (1.9, 1.85, 0.42), repeat=0.8)
    legs(room, "wood_red", (1.02, 1.83), (1.32, 1.78), 0.05, 0.38)
    for k in range(4):
        low, high = (1.1 + 0.02 * k, 1.4, 0.42 + 0.035 * k), (1.35 + 0.01 * k, 1.6, 0.453 + 0.035 * k)
        uv = (0.03 * (5 * k + 1), 0.24, 0.03 * (5 * k + 2), 0.01)
        room.box(BOOK, low, high, uv=uv, angle=0.2 * k)
    glass = [(1e-3, 0), (0.045, 0), (0.05, 0.12), (0.047, 0.12), (0.042, 0.01), (1e-3, 0.01)]
    room.lathe("glass", glass, (1.65, 1.55, 0.4205), 32)
    room.sphere("glaze", (1.5, 1.7, 0.46), 0.04, (0.8, 0.05, 0.3), 14)


def _dining(room: Builder, random: np.random.Generator) -> None:
    room.box("wood_light", (3.65, 1.55, 0.71), (4.95, 2.35, 0.745), repeat=0.9)
    legs(room, "wood_dark", (3.7, 4.84), (1.6, 2.24), 0.06, 0.71)
    for x, y, back in ((4.0, 1.42, -1), (4.6, 1.42, -1), (4.0, 2.5, 1), (4.65, 2.48, 1)):
        chair(room, x, y, (0, back), random)
    outside = [(1e-3, 0), (0.05, 0), (0.075, 0.1), (0.05, 0.22), (0.065, 0.26)]
    within = [(0.06, 0.26), (0.045, 0.22), (0.069, 0.1), (0.045, 0.012), (1e-3, 0.012)]
    room.lathe("glass", outside + within, (4.3, 1.95, 0.7455), 40)
    flowers(room, 4.3, 1.95, random)
    plate = [(1e-3, 0), (0.06, 0), (0.12, 0.02), (0.118, 0.024), (0.06, 0.006), (1e-3, 0.006)]
    cup = [(1e-3, 0), (0.035, 0), (0.04, 0.09), (0.036, 0.09), (0.03, 0.008), (1e-3, 0.008)]
    for x, y in ((3.9, 1.72), (4.65, 1.72), (3.95, 2.18), (4.65, 2.18)):
        room.lathe("glaze", plate, (x, y, 0.7455), 32, (0.75, 0.72, 0.65))
        room.lathe("glaze", cup, (x + 0.19, y, 0.7455), 24, any_colour(random))
    dish = [(1e-3, 0), (0.05, 0), (0.14, 0.07), (0.135, 0.07), (0.05, 0.01), (1e-3, 0.01)]
    room.lathe("glaze", dish, (4.3, 2.2, 0.7455), 32, (0.1, 0.25, 0.6))
    for k in range(6):
        centre = (4.3 + 0.06 * np.cos(k), 2.2 + 0.06 * np.sin(k), 0.8 + 0.02 * (k % 2))
        room.sphere("glaze", centre, 0.035, FRUIT[k % 3], 12)


def _sideboard(room: Builder, random: np.random.Generator) -> None:
    room.box("wood_dark", (3.2, 0.02, 0.05), (4.9, 0.42, 0.7), repeat=0.8)
    for k in range(3):
        room.box("wood_light", (3.25 + 0.55 * k, 0.42, 0.12), (3.75 + 0.55 * k, 0.435, 0.64), repeat=0.5)
    room.sheet("mirror", (4.65, 0.03, 0.85), (-1.2, 0, 0), (0, 0, 1.15))
    for low, high in (
        ((3.39, 0, 0.79), (4.71, 0.045, 0.85)),
        ((3.39, 0, 2.0), (4.71, 0.045, 2.06)),
        ((3.39, 0, 0.85), (3.45, 0.045, 2.0)),
        ((4.65, 0, 0.85), (4.71, 0.045, 2.0)),
    ):
        room.box("wood_red", low, high, repeat=0.4)
    for k in range(9):
        _ornament(room, k, 3.3 + 0.19 * k, random)


def _ornament(room: Builder, k: int, x: float, random: np.random.Generator) -> None:
    r, high = random.uniform(0.03, 0.06), random.uniform(0.08, 0.2)
    kind = k % 4
    if kind == 0:
        profile = [(1e-3, 0), (r, 0), (r * 1.2, high * 0.4), (r * 0.4, high), (r * 0.6, high * 1.1)]
        room.lathe("glaze", profile, (x, 0.2, 0.7), 28, any_colour(random))
    elif kind == 1:
        uv = (k % 4 / 4, 0.5, k % 4 / 4 + 0.25, 0)
        room.box(LETTER_BLOCK, (x - r, 0.15, 0.7), (x + r, 0.15 + 2 * r, 0.7 + 2 * r), uv=uv, angle=0.4 * k)
    elif kind == 2:
        room.sphere("glaze", (x, 0.22, 0.7 + r), r, any_colour(random), 14)
    else:
        profile = [(1e-3, 0), (r, 0), (r * 0.2, 0.02), (r * 0.2, high), (r * 0.5, high + 0.03)]
        room.lathe("chrome", profile, (x, 0.2, 0.7), 24)


def _plant_and_lamp(room: Builder, random: np.random.Generator) -> None:
    pot = [(1e-3, 0), (0.13, 0), (0.17, 0.3), (0.15, 0.3), (0.15, 0.26), (1e-3, 0.26)]
    room.lathe("glaze", pot, (5.55, 0.42, 0), 32, (0.45, 0.16, 0.08))
    leaves(room, 5.55, 0.42, (0.05, 0.03, 0), (5.97, 3.9, 2.5), random)
    room.cylinder("chrome", (2.75, 0.3, 0), 0.14, 0.02)
    room.cylinder("chrome", (2.75, 0.3, 0.02), 0.014, 1.5)
    room.sphere("bulb", (2.75, 0.3, 1.62), 0.09)


def _toys(room: Builder, random: np.random.Generator) -> None:
    for k in range(16):
        x, y = random.uniform(2.3, 3.2), random.uniform(1.9, 3.0)
        r = random.uniform(0.03, 0.06)
        if k % 2:
            row = 0.5 * (k // 4 % 2)
            uv = (k % 4 / 4, row + 0.5, k % 4 / 4 + 0.25, row)
            room.box(LETTER_BLOCK, (x, y, 0), (x + 2 * r, y + 2 * r, 2 * r), uv=uv, angle=random.uniform(0, 3))
        else:
            room.sphere("glaze", (x, y, r), r, any_colour(random), 12)
    room.box("wood_light", (5.35, 3.3, 0), (5.85, 3.75, 0.35), repeat=0.4)
    for k in range(8):
        uv = (k * 3 / 32 + 0.002, 0.49, (k * 3 + 1) / 32 - 0.002, 0.26)
        high = 0.35 + random.uniform(0.15, 0.28)
        room.box(BOOK, (5.4 + 0.05 * k, 3.4, 0.35), (5.44 + 0.05 * k, 3.6, high), uv=uv)
