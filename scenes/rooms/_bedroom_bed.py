"""The sleeping side of the bedroom: bed, chest, bookcase, bedside table, and what is on the walls above them."""

import numpy as np

from ._bedroom_shapes import curved, paper, pillow, poster
from ._builder import Builder
from ._furniture import spine

BED = (0.04, 1.02, 2.08, 4.16)  # lowest and highest x, lowest and highest y
WARM = ((0.55, 0.16, 0.06), (0.75, 0.5, 0.16), (0.3, 0.32, 0.1), (0.8, 0.68, 0.46), (0.32, 0.08, 0.1), (0.6, 0.3, 0.14))


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    _bed(room)
    _bookcase(room, random)
    _chest(room)
    _bedside(room)
    for which, corner, along, high, frame in (
        (1, (0.001, 2.3, 0.85), (0, 1, 0), 0.5, "birch"),
        (5, (0.001, 2.85, 0.82), (0, 1, 0), 0.55, ""),
        (7, (0.001, 3.4, 0.87), (0, 1, 0), 0.5, "walnut"),
        (2, (0.56, 4.199, 1.12), (1, 0, 0), 0.56, "walnut"),
        (4, (2.84, 4.199, 1.25), (1, 0, 0), 0.66, "birch"),
        (0, (1.02, 0.001, 1.0), (-1, 0, 0), 0.72, "birch"),
    ):
        poster(room, which, corner, along, high, frame)


def _bed(room: Builder) -> None:
    x0, x1, y0, y1 = BED
    for x in (x0, x1 - 0.06):
        for y, high in ((y0, 0.62), (y1 - 0.06, 1.0)):
            room.box("birch", (x, y, 0), (x + 0.06, y + 0.06, high))
    room.box("folk", (x0 + 0.06, y0 + 0.015, 0.2), (x1 - 0.06, y0 + 0.045, 0.58), uv=(0.1, 0.4, 0.9, 0.1))
    room.box("folk", (x0 + 0.06, y1 - 0.045, 0.3), (x1 - 0.06, y1 - 0.015, 0.96), uv=(0.1, 0.86, 0.9, 0.4))
    for x in (x0 + 0.005, x1 - 0.035):
        room.box("birch", (x, y0 + 0.06, 0.2), (x + 0.03, y1 - 0.06, 0.36))
    room.box("ticking", (x0 + 0.04, y0 + 0.07, 0.3), (x1 - 0.04, y1 - 0.07, 0.5), repeat=0.5)
    _cover(room, "patchwork", (y0 + 0.08, 3.5), 0.0, 0.24, 1.05)
    _cover(room, "knit_red", (2.28, 2.68), 0.016, 0.3, 0.45)
    _cover(room, "ticking", (3.42, 3.66), 0.012, 0.4, 0.5)
    pillow(room, "ticking", (0.53, 3.9, 0.6), (0.4, 0, 0), (0, 0.22, 0.08), (0, -0.03, 0.09), 1.5)
    pillow(room, "knit_grey", (0.32, 3.72, 0.71), (0.2, 0.06, 0), (-0.05, 0.13, 0.16), (0.02, -0.06, 0.055), 0.9)
    pillow(room, "kilim", (0.74, 3.74, 0.7), (0.19, -0.07, 0), (0.05, 0.12, 0.15), (-0.02, -0.06, 0.055), 0.6)
    room.box("volumes", (0.5, 3.05, 0.572), (0.66, 3.27, 0.595), uv=spine(1, 9), angle=0.5)
    paper(room, 5, (0.28, 2.86, 0.6), 0.17, 0.3)


def _cover(room: Builder, material: str, ends: tuple[float, float], lift: float, low: float, repeat: float) -> None:
    """Cloth over the mattress between two `ends`, hanging down to `low` on the side of the room."""
    x0, x1 = BED[0] + 0.04, BED[1] + 0.03 + lift
    across = np.r_[np.linspace(0, x1 - 0.05 - x0, 26), np.full(12, x1 - 0.05 - x0)]
    down = np.r_[np.zeros(26), np.linspace(0, 1, 13)[1:]]
    along = np.linspace(*ends, 40)
    s, y = np.meshgrid(across, along)
    t = np.broadcast_to(down, s.shape)
    lumps = 0.018 * np.sin(7 * s + 4 * y) + 0.012 * np.sin(15 * s - 9 * y) + 0.014 * np.sin(11 * y + 3 * s)
    body = 0.05 * np.exp(-(((s - 0.42) / 0.2) ** 2)) * np.clip((y - 2.3) * 1.2, 0, 1)
    top = 0.53 + lumps * np.clip(s * 8, 0, 1) + body + lift
    turn = np.minimum(t * 6, 1) * np.pi / 2
    ruffle = 0.014 * np.sin(24 * y) * t
    x = x0 + s + 0.05 * np.sin(turn) + np.maximum(ruffle, 0)
    z = top - 0.05 * (1 - np.cos(turn)) - np.maximum(t - 1 / 6, 0) * 1.2 * (0.48 - low)
    for row in (0, -1):  # the edges are tucked in
        z[row] = np.minimum(z[row], 0.5)
    uv = np.stack([(s + 0.34 * t) / repeat, -y / repeat], -1)
    curved(room, material, np.stack([x, y, z], -1), uv)


def _bookcase(room: Builder, random: np.random.Generator) -> None:
    """A low bookcase under the slope, with a globe, a plant and a clock on it."""
    y0, y1 = 0.3, 1.62
    for y in (y0, (y0 + y1) / 2, y1):
        room.box("birch", (0.022, y - 0.012, 0), (0.31, y + 0.012, 1.3))
    room.sheet("walnut", (0.024, y0, 0), (0, y1 - y0, 0), (0, 0, 1.3), repeat=0.5)
    for z in (0.06, 0.37, 0.68, 0.99, 1.3):
        over = 0.03 if z == 1.3 else -0.012
        room.box("birch", (0.022, y0 - over, z), (0.305 + max(over, 0), y1 + over, z + 0.025))
        for half in (0, 1) if z < 1.2 else ():
            _row(room, y0 + 0.66 * half + 0.02, y0 + 0.66 * (half + 1) - 0.02, z + 0.025, random)
    room.cylinder("walnut", (0.19, 0.55, 1.325), 0.07, 0.03)
    room.sphere("globe", (0.2, 0.55, 1.46), 0.115, segments=24)
    pot = [(1e-3, 0), (0.06, 0), (0.08, 0.1), (0.07, 0.1), (0.07, 0.08), (1e-3, 0.08)]
    room.lathe("wicker", pot, (0.2, 1.05, 1.325), 28)
    _ivy(room, 0.2, 1.05, random)
    for k in range(3):
        low = (0.08, 1.3, 1.325 + 0.04 * k)
        room.box("volumes", low, (0.28 - 0.02 * k, 1.56, low[2] + 0.038), uv=spine(2, 4 + 7 * k), angle=0.12 * k)
    room.sheet("dial", (0.26, 0.76, 1.328), (0, 0.13, 0), (-0.02, 0, 0.13), (0, 1, 1, 0))
    room.box("walnut", (0.17, 0.755, 1.325), (0.235, 0.895, 1.455))


def _row(room: Builder, y: float, end: float, z: float, random: np.random.Generator) -> None:
    """Books and trinkets between two sides of the bookcase."""
    while y < end - 0.055:
        kind = random.random()
        if kind < 0.86 or y > end - 0.13:
            wide, high, deep = random.uniform(0.018, 0.048), random.uniform(0.17, 0.265), random.uniform(0.15, 0.23)
            uv = spine(int(random.integers(0, 4)), int(random.integers(0, 32)))
            room.box("volumes", (0.05, y, z), (0.05 + deep, y + wide, z + high), uv=uv)
            y += wide + 0.002
        elif kind < 0.93:
            r, colour = random.uniform(0.035, 0.05), WARM[random.integers(0, 6)]
            room.lathe(
                "glaze",
                [(1e-3, 0), (r * 0.6, 0), (r, r), (r * 0.4, 2 * r), (r * 0.6, 3 * r)],
                (0.2, y + r, z),
                24,
                colour,
            )
            y += 2 * r + 0.02
        else:
            room.box("wicker", (0.08, y, z), (0.27, y + 0.11, z + 0.14), repeat=0.25)
            y += 0.125


def _ivy(room: Builder, x: float, y: float, random: np.random.Generator) -> None:
    """Leaves that rise from a pot and fall over the bookcase's edge."""
    for k in range(46):
        turn, out = random.uniform(-1.5, 1.5), random.uniform(0.0, 0.17)
        foot = np.array(
            [x + out * np.cos(turn), y + 1.2 * out * np.sin(turn), 1.42 + 0.08 * np.sin(3 * k) - 2.2 * out**2]
        )
        way = np.array([np.cos(turn), np.sin(turn), random.uniform(-0.8, 0.9)]) * random.uniform(0.04, 0.075)
        side = np.cross(way, (0, 0, 1)) * 0.45
        corners = np.maximum([foot, foot + way / 2 + side, foot + way, foot + way / 2 - side], (0.03, 0, 0))
        room.faces("leaf", corners, [[0, 1, 2], [0, 2, 3]], [[0, 0.5], [0.5, 1], [1, 0.5], [0.5, 0]])


def _chest(room: Builder) -> None:
    """A painted chest at the foot of the bed, a blanket and a ball on it; a basket of wool in the corner."""
    room.box("folk", (0.06, 1.7, 0.04), (0.86, 2.04, 0.42), uv=(0.08, 0.62, 0.92, 0.4))
    room.box("walnut", (0.04, 1.685, 0.42), (0.88, 2.055, 0.46), repeat=0.4)
    room.box("walnut", (0.08, 1.72, 0), (0.84, 2.02, 0.04))
    pillow(room, "tartan", (0.3, 1.87, 0.51), (0.2, 0, 0), (0, 0.14, 0), (0, 0, 0.05), 1)
    pillow(room, "knit_grey", (0.31, 1.87, 0.6), (0.18, 0.02, 0), (-0.02, 0.13, 0), (0, 0, 0.045), 1)
    room.sphere("globe", (0.7, 1.87, 0.55), 0.09)
    basket = [(1e-3, 0), (0.19, 0), (0.24, 0.36), (0.22, 0.36), (0.2, 0.24), (1e-3, 0.24)]
    room.lathe("wicker", basket, (0.76, 0.34, 0), 36)
    for k in range(7):
        place = (0.76 + 0.11 * np.cos(2.3 * k), 0.34 + 0.11 * np.sin(2.3 * k), 0.3 + 0.03 * (k % 3))
        room.sphere(("knit_red", "tartan", "ticking", "knit_grey")[k % 4], place, 0.075, segments=12)


def _bedside(room: Builder) -> None:
    room.box("walnut", (1.1, 3.66, 0.44), (1.44, 4.0, 0.47), repeat=0.4)
    room.box("folk", (1.12, 3.68, 0.2), (1.42, 3.98, 0.44), uv=(0.1, 0.62, 0.9, 0.42))
    for x in (1.12, 1.38):
        for y in (3.68, 3.94):
            room.box("walnut", (x, y, 0), (x + 0.04, y + 0.04, 0.2))
    room.cylinder("glaze", (1.32, 3.88, 0.47), 0.06, 0.1, (0.6, 0.3, 0.14))
    room.cylinder("steel", (1.32, 3.88, 0.57), 0.012, 0.06)
    room.lathe("lantern", [(0.1, 0), (0.06, 0.15)], (1.32, 3.88, 0.61), 28)
    room.sheet("dial", (1.14, 3.745, 0.48), (0.09, 0, 0), (0, 0.02, 0.09), (0, 1, 1, 0))
    room.box("walnut", (1.14, 3.765, 0.47), (1.23, 3.8, 0.56))
    room.box("volumes", (1.14, 3.83, 0.47), (1.24, 3.97, 0.5), uv=spine(0, 5), angle=0.2)
