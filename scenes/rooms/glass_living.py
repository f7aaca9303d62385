"""A living room of glass and mirrors at evening, 5.4 x 5.2 x 2.8 m, art deco, before a window front."""

import math

import numpy as np

from . import _glass_cases, _glass_seats, _glass_shell
from ._builder import Builder
from ._furnished import furnished
from ._glass_cases import BAYS, CABINET
from ._glass_materials import MATERIALS, TEXTURES
from ._glass_paths import HUMAN, HUMAN_START, SMOOTH, TEST, TEST_START
from ._glass_seats import TABLE
from ._glass_shell import WINDOW, X, Y, Z
from ._paths import steered
from ._types import AreaLight, Room

WARM, DUSK = (1.0, 0.87, 0.7), (1.0, 0.84, 0.76)


def build() -> Room:
    """The room, the same at every call."""
    room, random = Builder(), np.random.default_rng(310)
    _glass_shell.add(room, random)
    _glass_seats.add(room, random)
    _glass_cases.add(room, random)
    human = steered(HUMAN, HUMAN_START, seed=31, jitter=0.7, look_s=1.0)
    test = steered(TEST, TEST_START, seed=32, jitter=0.6, look_s=1.1)
    return furnished(room, MATERIALS, TEXTURES, _lights(), (X, Y, Z), human, SMOOTH, test, smooth_rate=6.0)


def _lights() -> tuple[AreaLight, ...]:
    """Dusk through the window, the chandelier's light down and up, and what glass would let through.

    Cycles lets no light through glass without caustics, so the cabinet's bays and the floor under the low table have
    lights of their own.
    """
    y0, y1, z0, z1 = WINDOW
    sideways, up, down = (math.pi / 2, 0.0, math.pi / 2), (math.pi, 0.0, 0.0), (0.0, 0.0, 0.0)
    window = AreaLight("window", (X - 0.04, (y0 + y1) / 2, (z0 + z1) / 2), sideways, (y1 - y0, z1 - z0), 88.0, DUSK)
    ceiling = AreaLight("ceiling", (X / 2, Y / 2, Z - 0.14), down, (4.2, 4.0), 124.0, WARM)
    cove = AreaLight("cove", (X / 2, Y / 2, 2.05), up, (4.2, 4.0), 18.0, WARM)
    left, near, right, far, high = TABLE
    middle = ((left + right) / 2, (near + far) / 2, high - 0.005)
    table = AreaLight("table", middle, down, (right - left - 0.1, far - near - 0.1), 3.2, WARM)
    left, right, near, far = CABINET
    bays = (
        AreaLight(
            f"bay {k}",
            ((left + right) / 2, (near + far) / 2, top - 0.025),
            down,
            (right - left - 0.2, far - near - 0.14),
            4.0,
            WARM,
        )
        for k, top in enumerate(BAYS[1:])
    )
    return (window, ceiling, cove, table, *bays)
