"""The working side of the bedroom: desk, chair, pinboard, guitar, lantern, and what lies on the floor."""

import numpy as np

from ._bedroom_bed import WARM
from ._bedroom_shapes import UP, curved, garment, note, paper, pillow
from ._bedroom_shell import X, Z
from ._builder import Builder
from ._furniture import spine

TOP = 0.75  # height of the desk


def add(room: Builder, random: np.random.Generator) -> None:
    """All of it, in an order that the random numbers depend on."""
    _desk(room)
    _on_desk(room, random)
    _pinboard(room, random)
    _chair(room)
    _guitar(room)
    _floor(room)
    room.cylinder("walnut", (1.75, 1.5, 2.38), 0.05, Z - 2.38)
    room.sphere("lantern", (1.75, 1.5, 2.19), 0.2, segments=24)


def _desk(room: Builder) -> None:
    room.box("birch", (2.76, 2.5, TOP - 0.035), (3.37, 3.98, TOP), repeat=0.7)
    for y in (2.54, 3.9):
        for x in (2.8, 3.3):
            room.box("walnut", (x, y, 0), (x + 0.04, y + 0.04, TOP - 0.035))
    room.box("walnut", (2.84, 2.6, 0.12), (3.3, 3.0, TOP - 0.035), repeat=0.4)
    for k in range(3):
        z = 0.15 + 0.185 * k
        room.box("folk", (2.825, 2.62, z), (2.84, 2.98, z + 0.165), uv=(0.1, 0.61, 0.9, 0.43))
        room.box("steel", (2.805, 2.77, z + 0.07), (2.825, 2.83, z + 0.085))
    room.box("wicker", (2.9, 3.5, 0), (3.2, 3.8, 0.34), repeat=0.3)
    for k in range(4):
        room.cylinder("notes", (2.98 + 0.05 * k, 3.6 + 0.04 * (k % 2), 0.34), 0.022, 0.2 + 0.05 * (k % 3))


def _on_desk(room: Builder, random: np.random.Generator) -> None:
    room.box("steel", (3.16, 3.12, TOP), (3.3, 3.36, TOP + 0.012))
    room.box("steel", (3.24, 3.21, TOP + 0.012), (3.27, 3.27, TOP + 0.14))
    room.box("walnut", (3.21, 2.94, TOP + 0.1), (3.24, 3.54, TOP + 0.46))
    room.sheet("screen", (3.206, 3.525, TOP + 0.115), (0, -0.57, 0), (0, 0, 0.33), (0, 1, 1, 0))
    room.box("steel", (2.93, 3.02, TOP), (3.07, 3.46, TOP + 0.02))
    room.sheet("keys", (2.935, 3.455, TOP + 0.023), (0, -0.43, 0), (0.13, 0, 0), (0, 1, 1, 0))
    pillow(room, "walnut", (3.0, 2.93, TOP + 0.015), (0.05, 0, 0), (0, 0.03, 0), (0, 0, 0.018), 1)
    room.sheet("kilim", (2.9, 2.82, TOP + 0.003), (0.2, 0, 0), (0, 0.17, 0), (0.1, 0.4, 0.4, 0.1))
    for k in range(9):
        y = (3.64, 3.7, 3.8, 2.66, 2.72, 2.78)[k % 6]
        angle = -np.pi / 2 + random.uniform(-0.5, 0.5)
        paper(room, (4 * k + 2 * (k // 4)) % 16, (2.82 + 0.02 * k, y, TOP + 0.004 + 0.004 * k), 0.15, angle)
    for k in range(8):
        y, high = 3.72 + 0.032 * k, random.uniform(0.17, 0.26)
        room.box("volumes", (3.19, y, TOP), (3.36, y + 0.03, TOP + high), uv=spine(k % 4, int(random.integers(0, 32))))
    for x, y, r, high in ((3.12, 3.62, 0.04, 0.09), (3.3, 2.72, 0.045, 0.1)):
        mug = [(1e-3, 0), (r, 0), (r, high), (r * 0.88, high), (r * 0.85, 0.01), (1e-3, 0.01)]
        room.lathe("glaze", mug, (x, y, TOP), 24, WARM[int(20 * r)])
    for k in range(5):
        room.cylinder("paint", (3.28 + 0.012 * k, 2.7 + 0.014 * (k % 3), TOP + 0.012), 0.005, 0.17, WARM[k], 8)
    room.cylinder("steel", (3.05, 3.86, TOP), 0.075, 0.018)
    room.cylinder("steel", (3.05, 3.86, TOP + 0.018), 0.01, 0.33)
    room.lathe("lantern", [(0.11, 0), (0.05, 0.15)], (3.05, 3.86, TOP + 0.3), 28)


def _pinboard(room: Builder, random: np.random.Generator) -> None:
    """Cork with notes and photos, over the desk."""
    low, high = (2.58, 1.27), (3.74, 1.98)
    room.box("cork", (X - 0.018, low[0], low[1]), (X, high[0], high[1]), repeat=0.5)
    for first, last in (
        ((low[0] - 0.03, low[1] - 0.03), (high[0] + 0.03, low[1])),
        ((low[0] - 0.03, high[1]), (high[0] + 0.03, high[1] + 0.03)),
        ((low[0] - 0.03, low[1]), (low[0], high[1])),
        ((high[0], low[1]), (high[0] + 0.03, high[1])),
    ):
        room.box("birch", (X - 0.03, *first), (X, *last), repeat=0.3)
    for k in range(24):
        column, row = k % 6, k // 6
        side = random.uniform(0.11, 0.145)
        y = high[0] - 0.05 - 0.18 * column - random.uniform(0, 0.03)
        z, tilt = low[1] + 0.03 + 0.168 * row + random.uniform(0, 0.015), random.uniform(-0.12, 0.12)
        u = np.array([0, -np.cos(tilt), np.sin(tilt)]) * side
        v = np.array([0, np.sin(tilt), np.cos(tilt)]) * side
        off = 0.022 + 0.0035 * (k % 2)
        note(room, (5 * k + row) % 16, (X - off, y, z), u, v)
        pin = np.array([X - off - 0.004, y, z]) + u / 2 + v * 0.93
        room.sphere("glaze", pin, 0.008, WARM[k % 6], 6)


def _chair(room: Builder) -> None:
    """A desk chair on a cross of feet, its back to the bed."""
    x, y = 2.44, 3.24
    for angle, top in ((0.4, 0.07), (0.4 + np.pi / 2, 0.066)):
        room.box("steel", (x - 0.26, y - 0.025, 0.03), (x + 0.26, y + 0.025, top), angle=angle)
        for side in (-1, 1):
            foot = (x + side * 0.23 * np.cos(angle), y + side * 0.23 * np.sin(angle), 0.03)
            room.sphere("glaze", foot, 0.03, (0.06, 0.04, 0.03), 8)
    room.cylinder("steel", (x, y, 0.07), 0.03, 0.34)
    room.box("walnut", (x - 0.2, y - 0.2, 0.4), (x + 0.2, y + 0.2, 0.43), repeat=0.3)
    pillow(room, "knit_grey", (x, y, 0.47), (0.23, 0, 0), (0, 0.23, 0), (0, 0, 0.05), 1.3)
    for side in (-0.12, 0.12):
        room.box("walnut", (x - 0.225, y + side - 0.02, 0.41), (x - 0.2, y + side + 0.02, 0.9))
    s, t = np.meshgrid(np.linspace(-1, 1, 15), np.linspace(0, 1, 9))
    bow = 0.05 * s**2 + 0.02 * np.sin(3 * t)
    for sign, off in ((1, 0.0), (-1, -0.028)):
        points = np.stack([x - 0.215 + bow + off, y + 0.22 * s, 0.56 + 0.38 * t], -1)
        curved(room, "tweed", points[:, ::sign], (1.1, 0.95))
    garment(room, "knit_red", (x - 0.245, y, 0.95), (0, -1, 0), 0.4, 0.4, 0.04, 0.4)


def _guitar(room: Builder) -> None:
    """It hangs on the wall by its head, the top towards the room."""
    y, z, long = 2.08, 0.72, 0.5
    along, outward = np.array([0.0, -1.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    t = np.linspace(0, 1, 45)
    places = (0, 0.03, 0.1, 0.25, 0.4, 0.55, 0.62, 0.75, 0.9, 0.97, 1)
    half = np.interp(t, places, (0.02, 0.1, 0.155, 0.19, 0.172, 0.135, 0.128, 0.14, 0.13, 0.09, 0.03))
    half = np.convolve(np.r_[0, half, 0], (0.25, 0.5, 0.25), "valid")
    foot = np.array([X - 0.03, y, z])
    s, up = np.meshgrid(np.linspace(-1, 1, 9), t)
    flat = foot + (s * half[:, None])[..., None] * along + (up * long)[..., None] * UP
    uv = np.stack([0.5 + s * half[:, None] / 0.4, 1 - up], -1)
    curved(room, "guitar", flat + outward * 0.09, uv)
    edge = np.concatenate([flat[:, 0], flat[::-1, -1], flat[:1, 0]])
    curved(room, "walnut", np.stack([edge + outward * 0.09, edge]), (4, 0.3))
    room.box("walnut", (X - 0.14, y - 0.027, z + long - 0.14), (X - 0.121, y + 0.027, z + long + 0.4))
    room.box("walnut", (X - 0.14, y - 0.045, z + long + 0.4), (X - 0.115, y + 0.045, z + long + 0.57))
    for k in range(6):
        side, high = (-1, 1)[k % 2], z + long + 0.43 + 0.05 * (k // 2)
        room.cylinder("steel", (X - 0.128, y + side * 0.055, high), 0.01, 0.02, segments=8)
    room.box("walnut", (X - 0.15, y - 0.02, z + long + 0.57), (X, y + 0.02, z + long + 0.6))


def _floor(room: Builder) -> None:
    """What lies about: a bag, books, slippers, a ball of wool, an open book."""
    pillow(room, "tartan", (2.75, 2.2, 0.23), (0.13, -0.1, 0), (0, 0, 0.23), (-0.07, -0.09, 0.0), 1)
    pillow(room, "tweed", (2.66, 2.08, 0.16), (0.09, -0.07, 0), (0, 0, 0.12), (-0.03, -0.04, 0.0), 0.5)
    for k in range(5):
        low = (1.16, 3.35, 0.04 * k)
        room.box("volumes", low, (1.36, 3.6 - 0.015 * k, 0.04 * k + 0.038), uv=spine(3, 2 + 6 * k), angle=0.25 * k)
    for y in (2.5, 2.63):
        pillow(room, "knit_red", (1.3, y, 0.04), (0.12, 0.02, 0), (-0.01, 0.045, 0), (0, 0, 0.035), 0.4)
    paper(room, 8, (1.75, 2.35, 0.01), 0.2, 0.4)
    paper(room, 13, (1.94, 2.43, 0.014), 0.2, 0.5)
    paper(room, 10, (2.05, 1.5, 0.01), 0.18, -0.6)
    room.sphere("tartan", (1.5, 1.4, 0.076), 0.07, segments=14)
