"""What one sits on in `glass_living`, the tables of glass between, and what lies there."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, FRUIT, any_colour, leaves
from ._glass_things import UPRIGHT, books, bottles, bunch, chess_game, lamp, poster, vase
from ._spot import Spot

TABLE = (1.9, 1.4, 3.1, 2.1, 0.42)  # the low table: x and y from, x and y to, height of its plate's lower side
CART = (4.15, 0.1, 4.95, 0.52)
PLATE = 0.012  # thickness of glass


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    room.sheet("deco_rug", (1.15, 0.85, 0.006), (2.85, 0, 0), (0, 2.3, 0), uv=UPRIGHT)
    _sofa(room)
    _armchair(room, 1.75, 2.95, 0.2)
    _armchair(room, 3.25, 2.95, -0.22)
    _low_table(room, random)
    _side_table(room, random)
    _cart(room, random)
    _pouf(room, random)
    lamp(room, (1.0, 0.4, 0), 1.75, 0.2)
    _plant(room, random)
    _left_lying(room, random)


def _sofa(room: Builder) -> None:
    for low, high in (
        ((1.3, 0.06, 0.12), (3.7, 0.95, 0.4)),
        ((1.45, 0.06, 0.4), (3.55, 0.3, 0.9)),
        ((1.3, 0.06, 0.4), (1.5, 0.9, 0.64)),
        ((3.5, 0.06, 0.4), (3.7, 0.9, 0.64)),
        ((1.52, 0.3, 0.4), (2.18, 0.97, 0.46)),
        ((2.2, 0.3, 0.4), (2.8, 0.97, 0.46)),
        ((2.82, 0.3, 0.4), (3.48, 0.97, 0.46)),
    ):
        room.box("velvet_green", low, high, repeat=0.75)
    room.box("gold", (1.28, 0.05, 0.08), (3.72, 0.96, 0.12))
    for x in (1.4, 2.5, 3.6):
        for y in (0.15, 0.85):
            room.cylinder("gold", (x, y, 0), 0.03, 0.08)
    cushions = (("chevrons", 1.74), ("sunburst", 2.13), ("brocade", 2.5), ("sunburst", 2.9), ("chevrons", 3.27))
    for k, (material, x) in enumerate(cushions):
        turn = 0.18 * (k % 3 - 1)
        room.box(material, (x - 0.19, 0.34, 0.46), (x + 0.19, 0.47, 0.82), uv=UPRIGHT, angle=turn)


def _armchair(room: Builder, x: float, y: float, angle: float) -> None:
    """A low club chair; unturned it looks to -y."""
    at = Spot(room, x, y, angle)
    for low, high in (
        ((-0.4, -0.38, 0.1), (0.4, 0.4, 0.4)),
        ((-0.4, 0.2, 0.4), (0.4, 0.4, 0.78)),
        ((-0.4, -0.36, 0.4), (-0.24, 0.2, 0.6)),
        ((0.24, -0.36, 0.4), (0.4, 0.2, 0.6)),
    ):
        at.box("velvet_wine", low, high, repeat=0.6)
    at.box("chevrons", (-0.18, 0.04, 0.41), (0.18, 0.17, 0.74), repeat=0.45)
    at.box("gold", (-0.41, -0.39, 0.06), (0.41, 0.41, 0.1))
    for dx in (-0.3, 0.3):
        for dy in (-0.3, 0.3):
            at.box("walnut", (dx - 0.03, dy - 0.03, 0), (dx + 0.03, dy + 0.03, 0.06))


def _low_table(room: Builder, random: np.random.Generator) -> None:
    x0, y0, x1, y1, z = TABLE
    room.box("glass", (x0, y0, z), (x1, y1, z + PLATE))
    room.box("walnut", (x0 + 0.1, y0 + 0.08, 0.12), (x1 - 0.1, y1 - 0.08, 0.14), repeat=0.8)
    for x in (x0 + 0.06, x1 - 0.06):
        for y in (y0 + 0.06, y1 - 0.06):
            room.cylinder("gold", (x, y, 0), 0.022, z - 0.001)
    for k, (x, y) in enumerate(((2.15, 1.65), (2.45, 1.85), (2.75, 1.65))):
        low, high = (x - 0.1, y - 0.13, 0.14), (x + 0.1, y + 0.13, 0.15)
        room.box("posters", low, high, uv=poster(k + 3), angle=0.5 * k - 0.4)
    top = z + PLATE
    chess_game(room, 2.2, 1.75, top, random)
    vase(room, (2.62, 1.85, top), 0.07, 0.24)
    bunch(room, (2.62, 1.85, top), 0.48, 0.16, random)
    end = books(room, (2.9, 1.62, top), 4, random)
    room.sphere("glass", (2.9, 1.62, end + 0.0455), 0.045)
    room.lathe("gold", [(1e-3, 0), (0.05, 0), (0.12, 0.06), (0.115, 0.062), (0.05, 0.008)], (2.55, 1.56, top), 32)
    for k in range(5):
        place = (2.55 + 0.055 * np.cos(k * 1.26), 1.56 + 0.055 * np.sin(k * 1.26), top + 0.055)
        room.sphere("glaze", place, 0.035, FRUIT[k % 3], 12)


def _side_table(room: Builder, random: np.random.Generator) -> None:
    room.cylinder("chrome", (2.5, 3.12, 0), 0.15, 0.02)
    room.cylinder("chrome", (2.5, 3.12, 0.02), 0.02, 0.5)
    room.cylinder("rosewood", (2.5, 3.12, 0.52), 0.22, 0.025)
    lamp(room, (2.44, 3.18, 0.545), 0.4, 0.12)
    books(room, (2.56, 3.04, 0.545), 2, random)


def _cart(room: Builder, random: np.random.Generator) -> None:
    """A bar on wheels: two plates of glass between chrome posts, with bottles."""
    x0, y0, x1, y1 = CART
    for x in (x0, x1 - 0.025):
        for y in (y0, y1 - 0.025):
            room.box("chrome", (x, y, 0.06), (x + 0.025, y + 0.025, 0.84))
            room.sphere("gold", (x + 0.0125, y + 0.0125, 0.03), 0.03, segments=10)
    for z in (0.3, 0.72):
        room.box("gold", (x0 + 0.03, y0 + 0.002, z - 0.016), (x1 - 0.03, y0 + 0.02, z - 0.001))
        room.box("gold", (x0 + 0.03, y1 - 0.02, z - 0.016), (x1 - 0.03, y1 - 0.002, z - 0.001))
        room.box("glass", (x0 + 0.03, y0 + 0.002, z), (x1 - 0.03, y1 - 0.002, z + PLATE))
        bottles(room, [(x0 + 0.12 + 0.11 * k, y0 + 0.13 + 0.05 * (k % 2), z + PLATE) for k in range(6)], random)
    bucket = [(1e-3, 0), (0.07, 0), (0.1, 0.17), (0.095, 0.17), (0.066, 0.01), (1e-3, 0.01)]
    room.lathe("chrome", bucket, (x1 - 0.17, y1 - 0.14, 0.7325), 32)
    for k in range(3):
        cup = [(1e-3, 0), (0.03, 0), (0.004, 0.01), (0.004, 0.07), (0.04, 0.13)]
        room.lathe(
            "glaze", cup, (x0 + 0.12 + 0.13 * k, y1 - 0.1, 0.7325), 20, ((0.6, 0.1, 0.15), (0.1, 0.4, 0.3))[k % 2]
        )


def _pouf(room: Builder, random: np.random.Generator) -> None:
    """A round stool with magazines beside it, by the window."""
    room.cylinder("brocade", (4.65, 3.2, 0), 0.27, 0.4, segments=32)
    room.lathe("gold", [(0.272, 0), (0.28, 0.02), (0.272, 0.04)], (4.65, 3.2, 0.02), 32)
    room.box("posters", (4.55, 3.08, 0.4), (4.77, 3.34, 0.408), uv=poster(4), angle=0.5)
    for k in range(4):
        low = (4.35 + 0.08 * k, 2.3 + 0.06 * k, 0.012 * k)
        high = (low[0] + 0.22, low[1] + 0.28, low[2] + 0.012)
        room.box("posters", low, high, uv=poster((3 * k + 1) % 8), angle=random.uniform(-0.6, 0.6))


def _plant(room: Builder, random: np.random.Generator) -> None:
    pot = [(1e-3, 0), (0.13, 0), (0.18, 0.32), (0.16, 0.32), (0.15, 0.27), (1e-3, 0.27)]
    room.lathe("glaze", pot, (0.42, 0.42, 0), 32, (0.08, 0.3, 0.24))
    leaves(room, 0.42, 0.42, (0.04, 0.04, 0), (0.85, 0.92, 2.4), random)


def _left_lying(room: Builder, random: np.random.Generator) -> None:
    """A throw and a newspaper on the sofa, cups on the table, slippers, a tray and games on the floor."""
    room.box("plaid", (2.98, 0.6, 0.46), (3.42, 0.975, 0.478), repeat=0.5)
    room.box("plaid", (2.98, 0.972, 0.12), (3.42, 0.985, 0.478), repeat=0.5)
    room.box("posters", (1.75, 0.62, 0.46), (2.0, 0.9, 0.466), uv=poster(6), angle=0.4)
    room.box(BOOK, (2.3, 0.66, 0.46), (2.5, 0.8, 0.49), uv=(0.4, 0.24, 0.43, 0.01), angle=-0.5)
    cup = [(1e-3, 0), (0.028, 0), (0.038, 0.06), (0.034, 0.06), (0.024, 0.008), (1e-3, 0.008)]
    saucer = [(1e-3, 0), (0.04, 0), (0.07, 0.012), (0.068, 0.015), (0.04, 0.005), (1e-3, 0.005)]
    top = TABLE[4] + PLATE
    for k, (x, y) in enumerate(((2.02, 1.98), (2.42, 1.5), (2.98, 1.98))):
        room.lathe("glaze", saucer, (x, y, top), 28, (0.7, 0.62, 0.45))
        room.lathe("glaze", cup, (x, y, top + 0.006), 24, ((0.03, 0.25, 0.18), (0.5, 0.04, 0.1))[k % 2])
    for x, turn in ((1.02, 0.3), (1.16, -0.1)):
        room.box("velvet_wine", (x - 0.045, 2.55, 0), (x + 0.045, 2.8, 0.05), repeat=0.3, angle=turn)
    for k in range(12):
        x, y = random.uniform(3.75, 4.15), random.uniform(1.1, 1.75)
        r = random.uniform(0.025, 0.045)
        if k % 2:
            uv = (k % 4 / 4, 0.5, k % 4 / 4 + 0.25, 0)
            room.box("letters", (x, y, 0.0), (x + 2 * r, y + 2 * r, 2 * r), uv=uv, angle=random.uniform(0, 3))
        else:
            room.sphere("glaze", (x, y, r), r, any_colour(random), 12)
    for k in range(3):
        low = (0.5 + 0.02 * k, 3.42 + 0.28 * k, 0)
        room.box(
            "posters", low, (low[0] + 0.3, low[1] + 0.3, 0.004 + 0.003 * k), uv=poster(k * 2 + 1), angle=0.4 * k - 0.3
        )
