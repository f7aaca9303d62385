"""An open-plan office, 11 x 5 x 2.9 m, in cool colours: rows of desks, and a meeting space behind an opening."""

import numpy as np

from . import _office_meeting, _office_shell, _office_work
from ._builder import Builder
from ._furnished import furnished
from ._office_materials import MATERIALS, TEXTURES
from ._office_paths import HUMAN, HUMAN_START, SMOOTH, TEST, TEST_START
from ._office_shell import X, Y, Z, lights
from ._paths import steered
from ._types import Room

LOOK_S = 1.2  # how slowly the hand turns


def build() -> Room:
    """The room, the same at every call."""
    room, random = Builder(), np.random.default_rng(300)
    _office_shell.add(room, random)
    _office_work.add(room, random)
    _office_meeting.add(room, random)
    human = steered(HUMAN, HUMAN_START, seed=31, jitter=0.7, look_s=LOOK_S)
    test = steered(TEST, TEST_START, seed=32, jitter=0.6, look_s=LOOK_S)
    return furnished(room, MATERIALS, TEXTURES, lights(), (X, Y, Z), human, SMOOTH, test, smooth_rate=4.0)
