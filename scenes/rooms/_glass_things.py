"""Small things of `glass_living`: framed posters, vases, flowers, lamps, bottles, magazines, a chess game."""

import numpy as np

from ._builder import Builder
from ._furniture import BOOK, TAU, any_colour, bottle, cell, frame, spine

UPRIGHT = (0, 1, 1, 0)  # of a texture on a sheet that stands: all of it, its upper edge above
IVORY, EBONY = (0.7, 0.6, 0.42), (0.05, 0.03, 0.03)


def poster(which: int) -> tuple[float, float, float, float]:
    """Where one of the eight posters is in their texture."""
    return cell(which, 4, 2, (0.003, 0.006))


def framed(room: Builder, which: int, corner: tuple, along: tuple, wide: float, high: float) -> None:
    """A poster in a golden frame on a wall, its lower left corner there and its width along a unit vector."""
    place, u = np.asarray(corner, float), np.asarray(along, float)
    outward = np.cross(u, (0, 0, 1))
    room.sheet("posters", place + outward * 0.03, u * wide, (0, 0, high), uv=poster(which))
    for material, margin, deep in (("gold", 0.045, 0.018), ("walnut", 0.02, 0.025)):
        frame(room, material, place, u, wide, high, margin, deep)


def vase(room: Builder, foot: tuple, wide: float, high: float) -> None:
    """A hollow vase of glass."""
    x, y, z = foot
    outside = [(1e-3, 0), (wide * 0.6, 0), (wide, high * 0.4), (wide * 0.5, high * 0.8), (wide * 0.8, high)]
    within = [(r * 0.88, h) for r, h in outside[:0:-1]]
    within[-1] = (wide * 0.5, 0.02)
    room.lathe("glass", [*outside, *within, (1e-3, 0.02)], (x, y, z + 0.0005), 36)


def bunch(room: Builder, foot: tuple, high: float, spread: float, random: np.random.Generator, count: int = 19) -> None:
    """Flowers on stems that rise from `foot`."""
    start = np.array(foot) + [0, 0, 0.03]
    for k in range(count):
        angle = k * 2.4 + random.uniform(-0.2, 0.2)
        out = spread * np.sqrt((k + 0.5) / count)
        top = start + [out * np.cos(angle), out * np.sin(angle), high * random.uniform(0.8, 1.0)]
        _blossom(room, top, random.uniform(0.03, 0.05), any_colour(random), random.uniform(0, TAU))
        stem = [start, start + [0.008, 0, 0], top, start - [0.004, 0.008, 0]]
        room.faces("paint", stem, [[0, 1, 2], [1, 3, 2], [3, 0, 2]], [[0, 0]] * 4, (0.06, 0.28, 0.05))


def _blossom(room: Builder, middle: np.ndarray, r: float, colour: np.ndarray, turn: float) -> None:
    """Six petals about a yellow middle, open upwards."""
    rim = []
    for k in range(12):
        angle, reach = turn + k * np.pi / 6, r * (1.0 if k % 2 else 0.45)
        rim.append(middle + [reach * np.cos(angle), reach * np.sin(angle), 0.35 * reach])
    triangles = [[0, 1 + k, 1 + (k + 1) % 12] for k in range(12)]
    room.faces("paint", [middle, *rim], triangles, [[0, 0]] * 13, colour)
    room.sphere("paint", middle + [0, 0, 0.1 * r], 0.3 * r, (0.8, 0.5, 0.05), 6)


def bottles(room: Builder, places: list[tuple], random: np.random.Generator) -> None:
    """A bottle at each place, of glass, glaze or gold by turns."""
    for k, place in enumerate(places):
        wide, high = random.uniform(0.03, 0.045), random.uniform(0.2, 0.32)
        colour = any_colour(random)
        x, y, z = place
        room.lathe(("glass", "glaze", "glaze", "gold")[k % 4], bottle(wide, high), (x, y, z + 0.0005), 24, colour)


def books(room: Builder, foot: tuple, count: int, random: np.random.Generator) -> float:
    """Books lying on one another; returns where the pile ends."""
    x, y, z = foot
    for _ in range(count):
        wide, deep, high = random.uniform(0.1, 0.13), random.uniform(0.075, 0.1), random.uniform(0.02, 0.04)
        uv = spine(int(random.integers(0, 4)), int(random.integers(0, 32)))
        room.box(BOOK, (x - wide, y - deep, z), (x + wide, y + deep, z + high), uv=uv, angle=random.uniform(-0.4, 0.4))
        z += high
    return z


def lamp(room: Builder, foot: tuple, high: float, wide: float) -> None:
    """A chrome lamp with a shade of alabaster."""
    x, y, z = foot
    room.lathe("chrome", [(1e-3, 0), (wide * 0.7, 0), (wide * 0.7, 0.012), (0.015, 0.03)], foot, 28)
    room.cylinder("chrome", (x, y, z + 0.02), 0.011, high - 0.02 - wide)
    for k in range(3):
        room.sphere("gold", (x, y, z + 0.06 + (high - wide) * 0.3 * k), 0.022, segments=10)
    shade = [(wide * 0.35, 0), (wide, 0.03), (wide * 0.9, wide * 0.5), (wide * 0.5, wide), (1e-3, wide * 1.1)]
    room.lathe("alabaster", shade, (x, y, z + high - wide), 32)


def sconce(room: Builder, x: float, z: float) -> None:
    """A fan of alabaster on the wall y = 0."""
    room.box("gold", (x - 0.03, 0, z - 0.14), (x + 0.03, 0.05, z))
    for k in range(5):
        left = x - 0.15 + 0.06 * k
        top = z + 0.3 - 0.05 * abs(k - 2)
        room.box("alabaster", (left + 0.004, 0.02, z), (left + 0.056, 0.07, top), uv=(0.2 * k, 0.9, 0.2 * k + 0.2, 0.1))
    room.box("gold", (x - 0.16, 0.0, z - 0.02), (x + 0.16, 0.09, z))


def chess_game(room: Builder, x: float, y: float, z: float, random: np.random.Generator) -> None:
    """A board with the pieces of a game that is half played."""
    half = 0.17
    room.box("chess", (x - half, y - half, z), (x + half, y + half, z + 0.018), uv=UPRIGHT)
    pawn = np.array([(1e-3, 0), (0.011, 0), (0.006, 0.012), (0.005, 0.022), (0.009, 0.03), (1e-3, 0.038)])
    places = random.permutation(64)[:22]
    for k, place in enumerate(places):
        px, py = x - 0.119 + 0.034 * (place % 8), y - 0.119 + 0.034 * (place // 8)
        tall = pawn * [1, 1.0 + 0.5 * (k % 3 == 0) + 0.3 * (k % 5 == 0)]
        room.lathe("glaze", tall, (px, py, z + 0.018), 14, IVORY if k % 2 else EBONY)


def grasses(room: Builder, foot: tuple, high: float, low: tuple, top: tuple, random: np.random.Generator) -> None:
    """Dried grasses with feathery ends, kept between two corners."""
    start = np.array(foot)
    for _ in range(44):
        angle, lean = random.uniform(0, TAU), random.uniform(0.05, 0.35)
        way = np.array([np.cos(angle) * lean, np.sin(angle) * lean, 1.0])
        side = np.array([-np.sin(angle), np.cos(angle), 0.0])
        long = high * random.uniform(0.7, 1.0)
        neck, tip = start + way * long * 0.7, start + way * long
        outline = np.array([start - side * 0.003, start + side * 0.003, neck + side * 0.012, tip, neck - side * 0.012])
        shade = np.array([0.75, 0.55, 0.3]) * random.uniform(0.5, 1.0)
        room.faces("paint", np.clip(outline, low, top), [[0, 1, 2], [0, 2, 4], [4, 2, 3]], [[0, 0]] * 5, shade)
