"""Things that stand in rooms: tables, chairs, books, jars, pictures, plants."""

import colorsys
from typing import Any

import numpy as np

from ._builder import Builder

TAU = 6.28
FRUIT = ((0.8, 0.1, 0.03), (0.85, 0.5, 0.02), (0.3, 0.55, 0.05))
LETTER_BLOCK, BOOK = "letters", "books"


def any_colour(random: np.random.Generator) -> np.ndarray:
    """(3,) linear RGB, a strong colour."""
    hue, saturation, value = random.random(), random.uniform(0.45, 0.95), random.uniform(0.35, 0.95)
    return np.array(colorsys.hsv_to_rgb(hue, saturation, value)) ** 2.2


def bottle(wide: float, high: float) -> list[tuple[float, float]]:
    """Profile of a bottle of this radius and height."""
    neck = wide * 0.35
    return [(1e-3, 0), (wide, 0), (wide, high * 0.6), (neck, high * 0.75), (neck, high), (1e-3, high)]


def bowl(wide: float, high: float) -> list[tuple[float, float]]:
    """Profile of a bowl."""
    return [(1e-3, 0), (wide * 0.6, 0), (wide, high * 0.35), (wide * 0.9, high * 0.5)]


def legs(room: Builder, material: str, xs: tuple[float, ...], ys: tuple[float, ...], side: float, high: float) -> None:
    """Square legs from the floor, their lower left corners at each of `xs` and `ys`."""
    for x in xs:
        for y in ys:
            room.box(material, (x, y, 0), (x + side, y + side, high))


def chair(room: Builder, x: float, y: float, back: tuple[int, int], random: np.random.Generator) -> None:
    """A chair in the middle of (x, y), its back to one of the four directions."""
    dx, dy = back
    colour = any_colour(random)
    for sx in (-1, 1):
        for sy in (-1, 1):
            left, front = x + sx * 0.19, y + sy * 0.19
            room.box("wood_dark", (left - 0.02, front - 0.02, 0), (left + 0.02, front + 0.02, 0.44))
    room.box("cushion", (x - 0.21, y - 0.21, 0.44), (x + 0.21, y + 0.21, 0.48), repeat=0.4)
    for across in (-0.17, 0, 0.17):
        px, py = x + dx * 0.2 + dy * across, y + dy * 0.2 + dx * across
        room.box("paint", (px - 0.02, py - 0.02, 0.48), (px + 0.02, py + 0.02, 0.92), colour=colour)
    px, py = x + dx * 0.2, y + dy * 0.2
    low = (px - 0.02 - abs(dy) * 0.19, py - 0.02 - abs(dx) * 0.19, 0.82)
    high = (px + 0.02 + abs(dy) * 0.19, py + 0.02 + abs(dx) * 0.19, 0.94)
    room.box("paint", low, high, colour=colour)


def cell(
    which: int, columns: int, rows: int, inset: tuple[float, float] = (0.004, 0.004)
) -> tuple[float, float, float, float]:
    """The part of a texture of `columns` x `rows` pictures that one of them takes, upright, `inset` from its edges."""
    column, row = which % columns, which // columns % rows
    across, down = inset
    left, right = column / columns + across, (column + 1) / columns - across
    return (left, (row + 1) / rows - down, right, row / rows + down)


def frame(
    room: Builder, material: str, corner: Any, u: Any, wide: float, high: float, margin: float, deep: float
) -> None:
    """A board on a wall that is `margin` larger than what hangs before it and `deep` thick.

    That has its lower left corner there and its width along the unit vector `u`.
    """
    rise = np.array([0.0, 0.0, 1.0])
    outward = np.cross(u, rise)
    first = corner - u * margin - rise * margin
    last = corner + u * (wide + margin) + rise * (high + margin) + outward * deep
    room.box(material, np.minimum(first, last), np.maximum(first, last), repeat=0.3)


def picture(room: Builder, which: int, corner: tuple, along: tuple, wide: float, high: float) -> None:
    """One of the eight pictures in a frame on a wall, its lower left corner there and its width along a unit vector."""
    place, u = np.asarray(corner, float), np.asarray(along, float)
    outward = np.cross(u, (0, 0, 1))
    room.sheet("art", place + outward * 0.022, u * wide, (0, 0, high), uv=cell(which, 4, 2))
    frame(room, "wood_dark", place, u, wide, high, 0.03, 0.018)


def spine(row: int, column: int) -> tuple[float, float, float, float]:
    """Texture of one of the 4 x 32 spines of books."""
    return cell(32 * row + column, 32, 4, (0.002, 0.01))


def bookcase(room: Builder, y0: float, y1: float, random: np.random.Generator) -> None:
    """A bookcase 2.15 m high on the wall x = 0 between `y0` and `y1`, in two halves, with books and trinkets."""
    middle = (y0 + y1) / 2
    for y in (y0, middle, y1):
        room.box("wood_light", (0, y - 0.015, 0), (0.32, y + 0.015, 2.15))
    for z in np.linspace(0.05, 2.13, 7):
        room.box("wood_light", (0, y0, z), (0.32, y1, z + 0.025))
        if z > 2:
            continue
        y = y0 + 0.03
        while y < y1 - 0.08:
            if -0.06 < y - middle < 0.0155:
                y = middle + 0.016
            elif random.random() < 0.82:
                y += _book(room, y, z + 0.025, random)
            else:
                y += _trinket(room, y, z + 0.025, random)


def _book(room: Builder, y: float, z: float, random: np.random.Generator) -> float:
    wide, high = random.uniform(0.018, 0.05), random.uniform(0.17, 0.3)
    deep = random.uniform(0.15, 0.24)
    uv = spine(int(random.integers(0, 4)), int(random.integers(0, 32)))
    room.box(BOOK, (0.03, y, z), (0.05 + deep, y + wide, z + high), uv=uv)
    return wide + 0.002


def _trinket(room: Builder, y: float, z: float, random: np.random.Generator) -> float:
    kind, r = random.integers(0, 3), random.uniform(0.04, 0.07)
    if kind == 0:
        room.sphere("glaze", (0.17, y + r, z + r), r, any_colour(random), 14)
    elif kind == 1:
        profile = [(1e-3, 0), (r * 0.6, 0), (r, r), (r * 0.3, r * 2), (r * 0.5, r * 2.6)]
        room.lathe("glaze", profile, (0.17, y + r, z), 24, any_colour(random))
    else:
        uv = (random.integers(0, 4) / 4, 0.5, random.integers(0, 4) / 4 + 0.25, 0)
        room.box(LETTER_BLOCK, (0.12, y, z), (0.12 + 1.6 * r, y + 1.6 * r, z + 1.6 * r), uv=uv, angle=0.3)
    return 2 * r + 0.03


def flowers(room: Builder, x: float, y: float, random: np.random.Generator) -> None:
    """Nine flowers, for a vase on a table at z = 0.75."""
    foot = np.array([x, y, 0.8])
    for _ in range(9):
        angle = random.uniform(0, TAU)
        random.uniform(0.02, 0.05)
        height = 1.1 + random.uniform(0, 0.15)
        top = np.array([x + 0.16 * np.cos(angle), y + 0.16 * np.sin(angle), height])
        room.sphere("paint", top, random.uniform(0.025, 0.04), any_colour(random), 10)
        stem = [foot, foot + [0.008, 0, 0], top, foot - [0.004, 0.008, 0]]
        room.faces("paint", stem, [[0, 1, 2], [1, 3, 2], [3, 0, 2]], [[0, 0]] * 4, (0.05, 0.25, 0.03))


def leaves(room: Builder, x: float, y: float, low: tuple, high: tuple, random: np.random.Generator) -> None:
    """Seventy leaves above a pot, kept between two corners."""
    for _ in range(70):
        angle, rise = random.uniform(0, TAU), random.uniform(0.1, 1.4)
        long = random.uniform(0.2, 0.4)
        stalk = np.array([x, y, 0.3 + random.uniform(0, 0.7)])
        way = np.array([np.cos(angle) * np.cos(rise), np.sin(angle) * np.cos(rise), np.sin(rise)])
        side = np.cross(way, (0, 0, 1))
        side /= np.linalg.norm(side)
        middle = stalk + way * long * 0.5
        tip = stalk + way * long + np.array([0, 0, -0.06])
        outline = np.clip([stalk, middle + side * 0.045, tip, middle - side * 0.045], low, high)
        room.faces("leaf", outline, [[0, 1, 2], [0, 2, 3]], [[0, 0.5], [0.5, 1], [1, 0.5], [0.5, 0]])
