"""The dressing corner of the bedroom: clothes and hats on hooks, a bench with shoes, a painted wardrobe."""

import numpy as np

from ._bedroom_bed import WARM
from ._bedroom_shapes import garment, pillow, poster
from ._bedroom_shell import X
from ._builder import Builder


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it."""
    _hooks(room)
    _bench(room, random)
    _wardrobe(room)


def _hooks(room: Builder) -> None:
    """A rail with coats, and hats on the shelf above it."""
    room.box("birch", (X - 0.022, 0.72, 1.62), (X, 1.78, 1.72), repeat=0.4)
    room.box("birch", (X - 0.2, 0.72, 1.84), (X, 1.78, 1.865), repeat=0.4)
    for y in (0.74, 1.73):
        room.box("birch", (X - 0.18, y, 1.72), (X, y + 0.025, 1.84))
    clothes = ("tweed", "knit_red", "tartan", "knit_grey", "ticking")
    for k, material in enumerate(clothes):
        y, long = 0.86 + 0.2 * k, (0.86, 0.6, 0.7, 0.62, 0.74)[k]
        room.box("steel", (X - 0.06, y - 0.008, 1.66), (X - 0.022, y + 0.008, 1.676))
        repeat = 0.3 if "knit" in material else 0.45
        garment(room, material, (X - 0.025 - 0.012 * (k % 2), y, 1.68), (0, -1, 0), 0.3, long, 0.1, repeat)
    for k, y in enumerate((0.92, 1.25, 1.55)):
        brim = [(0.14, 0), (0.08, 0.01), (0.075, 0.09), (0.05, 0.11), (1e-3, 0.11)]
        if k == 1:
            room.box("wicker", (X - 0.19, y - 0.12, 1.865), (X - 0.02, y + 0.12, 2.02), repeat=0.3)
        else:
            room.lathe(("tweed", "wicker")[k // 2], brim, (X - 0.15, y, 1.865), 28)
    poster(room, 6, (X - 0.001, 1.62, 2.02), (0, -1, 0), 0.36)


def _bench(room: Builder, random: np.random.Generator) -> None:
    """Shoes on and under a bench."""
    room.box("birch", (3.04, 0.72, 0.4), (3.36, 1.72, 0.43), repeat=0.5)
    room.box("birch", (3.06, 0.74, 0.14), (3.36, 1.7, 0.16), repeat=0.5)
    for x in (3.05, 3.33):
        for y in (0.73, 1.68):
            room.box("birch", (x, y, 0), (x + 0.03, y + 0.03, 0.4))
    pillow(room, "kilim", (3.2, 1.0, 0.47), (0.15, 0, 0), (0, 0.24, 0), (0, 0, 0.045), 0.7)
    for k in range(8):
        y, z, x = 0.8 + 0.115 * k, 0.16, 3.2
        colour = WARM[random.integers(0, 6)]
        pillow(room, ("tweed", "paint")[k // 2 % 2], (x, y, z + 0.045), (0.12, 0, 0), (0, 0.045, 0), (0, 0, 0.045), 0.4)
        room.lathe("glaze", [(0.045, 0), (0.04, 0.08), (0.034, 0.08), (0.03, 0)], (x + 0.06, y, z + 0.05), 16, colour)
    pillow(room, "tartan", (3.2, 1.5, 0.6), (0.02, 0.15, 0), (0, 0, 0.17), (0.1, 0, 0), 1)
    pillow(room, "tweed", (3.1, 1.5, 0.53), (0, -0.11, 0), (0, 0, 0.09), (-0.05, 0, 0), 0.6)


def _wardrobe(room: Builder) -> None:
    """Painted doors, and boxes and a bag on top."""
    room.box("walnut", (2.2, 0.02, 0.08), (3.37, 0.56, 1.98), repeat=0.6)
    room.box("walnut", (2.17, 0.0205, 1.98), (3.38, 0.6, 2.03), repeat=0.5)
    room.box("walnut", (2.22, 0.04, 0), (3.35, 0.54, 0.08))
    for k in range(2):
        left = 2.215 + 0.575 * k
        room.box("pine", (left, 0.56, 0.1), (left + 0.565, 0.58, 1.96), repeat=0.9)
        for z, high, upper in ((0.2, 0.72, 0.55), (1.02, 0.86, 0.0)):
            uv = (0.02, upper + 0.45, 0.98, upper + 0.01)
            room.sheet("folk", (left + 0.505, 0.585, z), (-0.445, 0, 0), (0, 0, high), uv)
        room.sphere("glaze", (left + (0.53, 0.035)[k], 0.595, 1.0), 0.02, (0.75, 0.5, 0.16), 10)
    room.box("wicker", (2.28, 0.1, 2.03), (2.72, 0.48, 2.27), repeat=0.35)
    room.box("tartan", (2.8, 0.08, 2.03), (3.3, 0.44, 2.18), repeat=0.5)
    pillow(room, "knit_red", (3.05, 0.26, 2.23), (0.22, 0, 0), (0, 0.15, 0), (0, 0, 0.05), 1)
