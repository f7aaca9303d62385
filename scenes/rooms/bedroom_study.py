"""A bedroom and study under the roof, 3.4 x 4.2 x 2.45 m, in warm wood, with morning light from one window."""

import math

import numpy as np

from . import _bedroom_bed, _bedroom_clothes, _bedroom_desk, _bedroom_shell
from ._bedroom_materials import MATERIALS, TEXTURES
from ._bedroom_paths import HUMAN, HUMAN_START, SMOOTH, TEST, TEST_START
from ._bedroom_shell import WINDOW, X, Y, Z
from ._builder import Builder
from ._furnished import furnished
from ._paths import steered
from ._types import AreaLight, Room

LOOK_S, JITTER = 1.0, 0.7


def build() -> Room:
    """The room, the same at every call."""
    room, random = Builder(), np.random.default_rng(200)
    _bedroom_shell.add(room)
    _bedroom_bed.add(room, random)
    _bedroom_desk.add(room, random)
    _bedroom_clothes.add(room, random)
    human = steered(HUMAN, HUMAN_START, seed=11, jitter=JITTER, look_s=LOOK_S)
    test = steered(TEST, TEST_START, seed=12, jitter=JITTER, look_s=LOOK_S)
    return furnished(room, MATERIALS, TEXTURES, _lights(), (X, Y, Z), human, SMOOTH, test)


def _lights() -> tuple[AreaLight, ...]:
    """Low sun through the window, and what the ceiling and the floor throw back."""
    x0, x1, z0, z1 = WINDOW
    window = ((x0 + x1) / 2, Y - 0.035, (z0 + z1) / 2)
    return (
        AreaLight("window", window, (-math.pi / 2, 0.0, 0.0), (x1 - x0, z1 - z0), 50.0, (1.0, 0.95, 0.88)),
        AreaLight("above", (1.85, 1.7, Z - 0.13), (0.0, 0.0, 0.0), (1.6, 3.0), 37.0, (1.0, 0.95, 0.89)),
        AreaLight("below", (1.6, 1.6, 0.9), (math.pi, 0.0, 0.0), (1.2, 2.4), 11.0, (1.0, 0.94, 0.86)),
    )
