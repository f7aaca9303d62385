"""Loose shapes and flat prints that the bedroom is furnished with: curved cloth, pillows, garments, posters, papers."""

from typing import Any

import numpy as np

from . import _furniture
from ._builder import WHITE, Builder
from ._furniture import cell

UP = np.array([0.0, 0.0, 1.0])


def curved(room: Builder, material: str, points: np.ndarray, uv: Any, colour: Any = WHITE) -> None:
    """(M, N, 3) points of a surface, seen from where N runs to the right and M upwards; `uv` (M, N, 2) or a repeat."""
    m, n = points.shape[:2]
    if np.ndim(uv) < 3:
        across, up = np.broadcast_to(uv, 2)
        u, v = np.meshgrid(np.linspace(0, across, n), np.linspace(up, 0, m))
        uv = np.stack([u, v], -1)
    i, j = np.meshgrid(np.arange(m - 1), np.arange(n - 1), indexing="ij")
    a = i * n + j
    halves = [np.stack(corners, -1).reshape(-1, 3) for corners in ([a, a + 1, a + n + 1], [a, a + n + 1, a + n])]
    room.faces(material, points.reshape(-1, 3), np.concatenate(halves), np.reshape(uv, (-1, 2)), colour)


def pillow(room: Builder, material: str, centre: Any, a: Any, b: Any, c: Any, repeat: float = 1.0) -> None:
    """A stuffed cushion with half axes `a` and `b` in its plane and `c`, which is a x b's direction, across."""
    centre, a, b, c = (np.asarray(value, float) for value in (centre, a, b, c))
    x, y = np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-1, 1, 17))
    thick = np.sqrt(np.clip((1 - x**4) * (1 - y**4), 0, 1)) * (1 + 0.06 * np.sin(5 * x + 3 * y))
    x, y = x * (1 - 0.07 * (1 - y**2) * x**2), y * (1 - 0.07 * (1 - x**2) * y**2)
    flat = centre + x[..., None] * a + y[..., None] * b
    curved(room, material, flat + thick[..., None] * c, repeat)
    curved(room, material, (flat - thick[..., None] * c)[:, ::-1], repeat)


def garment(
    room: Builder, material: str, top: Any, along: Any, wide: float, long: float, deep: float, repeat: float
) -> None:
    """Clothes that hang from `top` on a wall whose outward direction is along x z, with folds and two sleeves."""
    top, along = np.asarray(top, float), np.asarray(along, float)
    outward = np.cross(along, UP)
    for side, share, short in ((0.0, 1.0, 1.0), (-0.42, 0.27, 0.72), (0.42, 0.27, 0.72)):
        s, t = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 1, 15))
        shoulder = np.interp(t, (0, 0.8, 0.92, 1), (1, 0.86, 0.8, 0.3 if side == 0 else 0.5))
        folds = 0.012 * np.sin(9 * s + 20 * top[1] + 7 * top[0]) * (1 - t)
        reach = deep * np.sin(s) ** 0.7 * (0.6 + 0.4 * (1 - t)) + folds * np.sin(s)
        across = -np.cos(s) * wide / 2 * share * shoulder + side * wide * (1 - 0.28 * t**3)
        down = -long * short * (1 - t) - (0.0 if side == 0 else 0.07 * wide)
        reach = np.maximum(reach, 0) * (1 if side == 0 else 0.8) + (0.004 if side == 0 else 0.02)
        points = top + across[..., None] * along + reach[..., None] * outward + down[..., None] * UP
        curved(room, material, points, (wide * share * 1.4 / repeat, long * short / repeat))


def curtain(room: Builder, material: str, corner: Any, along: Any, wide: float, high: float, repeat: float) -> None:
    """Cloth in waves, its lower left corner there."""
    corner, along = np.asarray(corner, float), np.asarray(along, float)
    s, t = np.meshgrid(np.linspace(0, 1, 57), np.linspace(0, 1, 9))
    wave = 0.028 * np.sin(s * 7 * 2 * np.pi + 0.6 * t) * (1 - 0.4 * t)
    shift = wide * (s + 0.05 * np.sin(4 * t) * (1 - s))
    points = corner + shift[..., None] * along + wave[..., None] * np.cross(along, UP) + (high * t)[..., None] * UP
    curved(room, material, points, (wide * 1.6 / repeat, high / repeat))


def poster(room: Builder, which: int, corner: Any, along: Any, high: float, frame: str = "") -> None:
    """One of the eight posters on a wall, its lower left corner there; in a frame of that material if one is given."""
    corner, along = np.asarray(corner, float), np.asarray(along, float)
    wide, outward = high * 256 / 352, np.cross(along, UP)
    room.sheet("posters", corner + outward * (0.024 if frame else 0.006), along * wide, UP * high, cell(which, 4, 2))
    if frame:
        _furniture.frame(room, frame, corner, along, wide, high, 0.025, 0.02)


def note(room: Builder, which: int, corner: Any, u: Any, v: Any) -> None:
    """One of the sixteen notes, its lower left corner there."""
    room.sheet("notes", corner, u, v, cell(which, 4, 4))


def paper(room: Builder, which: int, place: Any, side: float, angle: float) -> None:
    """A note that lies flat, its lower left corner there."""
    u = np.array([np.cos(angle), np.sin(angle), 0.0]) * side
    note(room, which, place, u, np.array([-u[1], u[0], 0.0]) * 1.3)


def upright(room: Builder, material: str, corner: Any, u: Any, v: Any, repeat: float) -> None:
    """A wall covered by a texture that is `repeat` metres wide and not upside down."""
    across, up = np.linalg.norm(u) / repeat, np.linalg.norm(v) / repeat
    start = (np.asarray(corner, float)[:2].sum() * 0.31) % 1
    room.sheet(material, corner, u, v, (start, float(up), start + float(across), 0))
