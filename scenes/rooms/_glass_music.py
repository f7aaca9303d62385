"""Music in `glass_living`: records with a gramophone, and an upright piano."""

import numpy as np

from ._builder import Builder
from ._glass_shell import Y
from ._glass_things import UPRIGHT, books, bunch, grasses, lamp, poster, vase


def records(room: Builder, random: np.random.Generator) -> None:
    """Six open boxes of records, a gramophone, a lamp and a bunch of flowers on top, grasses beside it."""
    y0, y1, deep, high = 3.3, 4.52, 0.42, 0.86
    for z in (0.05, 0.445, high - 0.03):
        room.box("rosewood", (0.02, y0, z), (deep, y1, z + 0.03), repeat=0.5)
    for y in np.linspace(y0, y1 - 0.03, 4):
        room.box("rosewood", (0.02, y, 0), (deep - 0.006, y + 0.03, high - 0.01), repeat=0.5)
    room.box("brocade", (0.02, y0, 0.05), (0.035, y1, high), repeat=0.6)
    for column in range(3):
        for z in (0.08, 0.475):
            y = y0 + 0.034 + 0.397 * column
            end = y + 0.355
            while y < end - 0.06:
                wide = min(random.uniform(0.08, 0.2), end - y)
                left = random.uniform(0, 0.8)
                low, top = (0.06, y, z), (0.36 + random.uniform(0, 0.04), y + wide, z + 0.315)
                room.box("records", low, top, uv=(left, 1, left + wide * 0.9, 0.05))
                y += wide + random.uniform(0.003, 0.03)
    room.box("walnut", (0.06, 3.42, high), (0.38, 3.74, high + 0.16), repeat=0.4)
    room.cylinder("paint", (0.22, 3.58, high + 0.16), 0.14, 0.012, colour=(0.02, 0.02, 0.025))
    room.cylinder("paint", (0.22, 3.58, high + 0.172), 0.045, 0.003, colour=(0.5, 0.05, 0.08))
    horn = [
        (0.012, 0),
        (0.02, 0.12),
        (0.05, 0.24),
        (0.12, 0.33),
        (0.19, 0.37),
        (0.185, 0.375),
        (0.11, 0.34),
        (1e-3, 0.2),
    ]
    room.lathe("gold", horn, (0.22, 3.68, high + 0.16), 36)
    lamp(room, (0.2, 4.36, high), 0.42, 0.13)
    vase(room, (0.2, 4.05, high), 0.07, 0.22)
    bunch(room, (0.2, 4.05, high), 0.42, 0.13, random)
    end = books(room, (0.26, 3.88, high), 1, random)
    room.sphere("glass", (0.26, 3.88, end + 0.0405), 0.04)
    room.lathe(
        "glass", [(1e-3, 0), (0.12, 0), (0.15, 0.3), (0.08, 0.6), (0.1, 0.66), (1e-3, 0.66)], (0.36, 4.82, 0.001), 36
    )
    grasses(room, (0.36, 4.82, 0.66), 0.85, (0.05, 4.6, 0), (0.7, 5.14, 2.2), random)


def piano(room: Builder, random: np.random.Generator) -> None:
    """An upright piano with notes on it and a velvet stool before it."""
    x0, x1, back, front = 0.9, 2.4, Y - 0.02, 4.72
    for low, high in (
        ((x0, front, 0), (x1, back, 1.2)),
        ((x0 - 0.02, front - 0.02, 1.2), (x1 + 0.02, back, 1.24)),
        ((x0, 4.4, 0.6), (x1, front, 0.68)),
        ((x0, 4.4, 0.68), (x0 + 0.12, front, 0.76)),
        ((x1 - 0.12, 4.4, 0.68), (x1, front, 0.76)),
        ((x0, 4.42, 0), (x0 + 0.08, 4.5, 0.6)),
        ((x1 - 0.08, 4.42, 0), (x1, 4.5, 0.6)),
        ((x0 + 0.2, front - 0.06, 0.8), (x1 - 0.2, front, 0.82)),
    ):
        room.box("rosewood", low, high, repeat=0.9)
    room.box("keys", (x0 + 0.125, 4.43, 0.68), (x1 - 0.125, 4.62, 0.7), uv=UPRIGHT)
    room.box("brocade", (x0 + 0.125, 4.62, 0.68), (x1 - 0.125, 4.7, 0.705), repeat=0.3)
    for k in range(4):
        room.box("gold", (x0 + 0.02 + 0.47 * k, front - 0.008, 0.1), (x0 + 0.05 + 0.47 * k, front, 0.58))
    for k, which in enumerate((6, 3, 5)):
        corner = (1.3 + 0.25 * k, front - 0.012 - 0.006 * k, 0.82)
        room.sheet("posters", corner, (0.23, 0, 0), (0, 0, 0.3), uv=poster(which))
    for x in (1.55, 1.65, 1.75):
        room.box("gold", (x - 0.02, front - 0.14, 0.03), (x + 0.02, front, 0.045))
    top = 1.24
    room.lathe("walnut", [(1e-3, 0), (0.06, 0), (0.03, 0.22), (1e-3, 0.24)], (1.05, 4.95, top), 4)
    for k, x in enumerate((1.28, 1.5)):
        room.box("gold", (x - 0.08, 4.9, top), (x + 0.08, 4.925, top + 0.21))
        room.sheet("posters", (x - 0.065, 4.896, top + 0.015), (0.13, 0, 0), (0, 0, 0.18), uv=poster(4 + 3 * k))
    vase(room, (1.78, 4.95, top), 0.07, 0.22)
    bunch(room, (1.78, 4.95, top), 0.4, 0.14, random)
    books(room, (2.02, 4.95, top), 5, random)
    lamp(room, (2.27, 4.97, top), 0.4, 0.11)
    room.cylinder("velvet_wine", (1.65, 4.0, 0.42), 0.19, 0.08, segments=28)
    room.cylinder("gold", (1.65, 4.0, 0.02), 0.03, 0.4)
    room.cylinder("gold", (1.65, 4.0, 0), 0.16, 0.02)
