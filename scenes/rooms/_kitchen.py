"""The kitchen of `kitchen_living`: a row of cupboards on the wall y = 4, with what stands on it, and the door."""

import numpy as np

from ._builder import Builder
from ._furniture import any_colour, bottle, bowl

ROUND = ((0.8, 0.1, 0.03), (0.85, 0.45, 0.02), (0.2, 0.5, 0.05))  # colours of the fruit on the board
BLACK = (0.02, 0.02, 0.02)


def add(room: Builder, random: np.random.Generator) -> None:
    """The whole row, from left to right and from below."""
    _base(room)
    _wall_cupboards(room)
    _open_shelves(room, random)
    _worktop(room, random)
    _fridge(room, random)
    _door(room)


def _base(room: Builder) -> None:
    room.box("wood_dark", (0.1, 3.45, 0), (3.4, 4.0, 0.1))
    for k in range(6):
        x = 0.1 + k * 0.55
        room.box("wood_red", (x + 0.01, 3.42, 0.1), (x + 0.54, 4.0, 0.86), repeat=0.7)
        room.box("chrome", (x + 0.4, 3.39, 0.55), (x + 0.42, 3.42, 0.75))
    room.box("marble", (0.08, 3.38, 0.86), (3.42, 4.0, 0.9), repeat=0.9)
    # The sink, its tap, and the hob with a kettle and a pot.
    room.box("steel", (1.45, 3.5, 0.895), (2.0, 3.85, 0.904))
    room.box("paint", (1.5, 3.54, 0.9), (1.95, 3.8, 0.906), colour=(0.12, 0.12, 0.13))
    room.cylinder("chrome", (1.72, 3.88, 0.9), 0.018, 0.3)
    room.box("chrome", (1.705, 3.68, 1.19), (1.735, 3.9, 1.215))
    room.box("glaze", (2.4, 3.47, 0.9), (2.98, 3.87, 0.908), colour=(0.012, 0.012, 0.014))
    for i in range(2):
        for j in range(2):
            plate = (2.54 + 0.3 * i, 3.57 + 0.2 * j, 0.908)
            room.cylinder("paint", plate, 0.085, 0.004, colour=(0.25, 0.05, 0.04))
    kettle = [(1e-3, 0), (0.09, 0), (0.1, 0.05), (0.08, 0.14), (0.03, 0.2), (1e-3, 0.21)]
    room.lathe("steel", kettle, (2.54, 3.57, 0.912), 32)
    room.cylinder("glaze", (2.84, 3.77, 0.912), 0.09, 0.12, colour=(0.7, 0.08, 0.05))


def _wall_cupboards(room: Builder) -> None:
    for k in range(4):
        x = 0.1 + 0.48 * k
        room.box("wood_red", (x + 0.01, 3.66, 1.55), (x + 0.47, 4, 2.25), repeat=0.6)
        room.box("chrome", (x + 0.38, 3.635, 1.65), (x + 0.4, 3.66, 1.8))
    for z in (1.5, 1.88):
        room.box("wood_light", (2.2, 3.74, z), (3.45, 4, z + 0.025))


def _open_shelves(room: Builder, random: np.random.Generator) -> None:
    for z in (1.525, 1.905):
        x = 2.26
        while x < 3.36:
            wide, high = random.uniform(0.03, 0.06), random.uniform(0.1, 0.26)
            kind = random.integers(0, 4)
            foot = (x + wide, 3.86, z)
            colour = any_colour(random)
            if kind == 0:
                room.cylinder("glaze", foot, wide, high * 0.7, colour=colour)
            elif kind == 1:
                room.lathe("glaze", bottle(wide, high), foot, 24, colour)
            elif kind == 2:
                room.box("paint", (x, 3.8, z), (x + 2 * wide, 3.92, z + high * 0.8), colour=colour)
            else:
                room.lathe("glaze", bowl(wide, high), foot, 24, colour)
            x += 2 * wide + random.uniform(0.015, 0.05)


def _worktop(room: Builder, random: np.random.Generator) -> None:
    for k in range(7):
        wide, high = random.uniform(0.03, 0.05), random.uniform(0.15, 0.32)
        material = "glaze" if k % 3 else "glass"
        room.lathe(material, bottle(wide, high), (0.2 + 0.17 * k, 3.86, 0.9005), 24, any_colour(random))
    room.box("wood_light", (0.35, 3.45, 0.9), (0.75, 3.7, 0.925), angle=0.2)
    room.box("wood_dark", (1.15, 3.75, 0.9), (1.27, 3.93, 1.14))
    for k in range(6):
        x, y = 0.45 + 0.05 * k + random.uniform(-0.02, 0.02), 3.57 + random.uniform(-0.06, 0.06)
        room.sphere("paint", (x, y, 0.96), 0.033, ROUND[k % 3], 12)


def _fridge(room: Builder, random: np.random.Generator) -> None:
    room.box("steel", (3.5, 3.34, 0), (4.15, 4, 1.85), repeat=0.9)
    room.box("paint", (3.5, 3.335, 1.2), (4.15, 3.34, 1.21), colour=BLACK)
    room.box("chrome", (4.07, 3.29, 1.3), (4.095, 3.34, 1.7))
    room.box("chrome", (4.07, 3.29, 0.6), (4.095, 3.34, 1.1))
    for _ in range(9):  # pictures held by magnets
        x, z = random.uniform(3.54, 3.95), random.uniform(0.5, 1.7)
        wide = random.uniform(0.03, 0.07)
        i = random.integers(0, 8)
        uv = ((i % 4 + 1) / 4, i // 4 / 2, (i % 4) / 4, (i // 4 + 1) / 2)
        room.sheet("art", (x + wide, 3.333, z), (-wide * 1.5, 0, 0), (0, 0, wide * 1.7), uv=uv)


def _door(room: Builder) -> None:
    room.box("wood_light", (4.55, 3.96, 0), (5.5, 4, 2.1), repeat=0.9)
    for i in range(2):
        for j in range(2):
            low = (4.65 + 0.4 * i, 3.94, 0.2 + 0.95 * j)
            room.box("wood_red", low, (4.98 + 0.4 * i, 3.96, 1.0 + 0.95 * j), repeat=0.5)
    room.sphere("chrome", (4.63, 3.92, 1.03), 0.03)
