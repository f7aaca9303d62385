"""Plants of `open_office`: small ones in pots, and trees in tubs."""

from typing import Any

import numpy as np

from ._builder import Builder
from ._furniture import TAU

TUBS = ((0.2, 0.22, 0.24), (0.68, 0.66, 0.6), (0.05, 0.2, 0.22), (0.6, 0.36, 0.08), (0.3, 0.09, 0.05))


def sprig(room: Builder, place: Any, wide: float, count: int, random: np.random.Generator) -> None:
    """A pot of this radius with `count` leaves that bend outward."""
    pot = [
        (1e-3, 0),
        (wide * 0.75, 0),
        (wide, wide * 1.7),
        (wide * 0.9, wide * 1.7),
        (wide * 0.85, wide * 1.4),
        (1e-3, wide * 1.4),
    ]
    room.lathe("glaze", pot, place, 24, TUBS[random.integers(0, len(TUBS))])
    foot = np.asarray(place, float) + [0, 0, wide * 1.4]
    for _ in range(count):
        _leaf(room, foot, random.uniform(0, TAU), random.uniform(0.5, 1.45), wide * random.uniform(1.6, 3.2), random)


def tree(room: Builder, x: float, y: float, high: float, low: Any, top: Any, random: np.random.Generator) -> None:
    """A tub with a stem and leaves on it, kept between two corners."""
    tub = [(1e-3, 0), (0.15, 0), (0.19, 0.34), (0.17, 0.34), (0.16, 0.3), (1e-3, 0.3)]
    room.lathe("concrete", tub, (x, y, 0), 32)
    room.cylinder("smoked", (x, y, 0.3), 0.018, high - 0.3)
    for k in range(64):
        foot = np.array([x, y, 0.5 + (high - 0.5) * (k + 0.5) / 64])
        _leaf(room, foot, k * 2.4, random.uniform(-0.1, 0.9), random.uniform(0.2, 0.36), random, (low, top))


def _leaf(room: Builder, foot: Any, angle: float, rise: float, long: float, random: Any, kept: Any = None) -> None:
    way = np.array([np.cos(angle) * np.cos(rise), np.sin(angle) * np.cos(rise), np.sin(rise)])
    side = np.array([-np.sin(angle), np.cos(angle), 0]) * long * random.uniform(0.12, 0.2)
    middle, tip = foot + way * long * 0.55, foot + way * long - np.array([0, 0, long * 0.25])
    outline = np.array([foot, middle + side, tip, middle - side])
    if kept is not None:
        outline = np.clip(outline, *kept)
    room.faces("leaf", outline, [[0, 1, 2], [0, 2, 3]], [[0, 0.5], [0.5, 1], [1, 0.5], [0.5, 0]])
