"""An open-plan office, 11 x 5 x 2.9 m, in cool colours: rows of desks, and a meeting space behind an opening."""

import numpy as np

from . import _office_meeting, _office_shell, _office_work
from ._builder import Builder
from ._office_materials import OFFICE_MATERIALS, office_textures
from ._office_paths import HUMAN, HUMAN_START, SMOOTH, TEST, TEST_START
from ._paths import at_rate, constant_speed, frames, steered
from ._types import Room

LOOK_S = 1.2  # how slowly the hand turns


def build() -> Room:
    """The room, the same at every call."""
    room, random = Builder(), np.random.default_rng(300)
    _office_shell.add(room, random)
    _office_work.add(room, random)
    _office_meeting.add(room, random)
    meshes = room.meshes()
    materials = {name: OFFICE_MATERIALS[name] for name in meshes}
    human = steered(HUMAN, HUMAN_START, seed=31, jitter=0.7, look_s=LOOK_S)
    test = steered(TEST, TEST_START, seed=32, jitter=0.6, look_s=LOOK_S)
    return Room(
        meshes=meshes,
        materials=materials,
        textures=office_textures(materials.values()),
        lights=_office_shell.lights(),
        parts=tuple(room.parts),
        inside=((0.0, 0.0, 0.0), (_office_shell.X, _office_shell.Y, _office_shell.Z)),
        paths={
            "human": lambda count: frames(human, 10, count),
            "smooth": lambda count: constant_speed(SMOOTH, count, 4.0),
            "test": lambda count: frames(test, 1, count),
        },
        points_path=at_rate(human, 10),
    )
