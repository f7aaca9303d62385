"""What training views see of test views, against a slow caster of rays and against what geometry says."""

from typing import ClassVar

import numpy as np
import pytest

from viewbench.scenes.rooms import _rendering, _tracing
from viewbench.scenes.rooms._builder import Builder
from viewbench.scenes.rooms._materials import MATERIALS
from viewbench.scenes.rooms._types import Room, Walk
from viewbench.scenes.rooms._visibility import seen_shares


def cell(*boxes: tuple, glass: tuple = ()) -> Room:
    """A cube of 4 m around the origin whose walls face inwards, with boxes in it."""
    made = Builder()
    for axis in range(3):
        u, v = np.zeros(3), np.zeros(3)
        u[(axis + 1) % 3] = v[(axis + 2) % 3] = 4.0
        made.sheet("plaster", (-2, -2, -2), u, v, repeat=1)
        far = np.full(3, -2.0)
        far[axis] = 2
        made.sheet("plaster", far, v, u, repeat=1)
    for low, high in boxes:
        made.box("wood_red", low, high)
    for low, high in glass:
        made.box("glass", low, high)
    meshes = made.meshes()
    materials = {name: MATERIALS[name] for name in meshes}
    nowhere = looking([((0, 0, 0), (1, 0, 0))])
    return Room(meshes, materials, {}, (), tuple(made.parts), ((-2, -2, -2), (2, 2, 2)), {}, nowhere)


def looking(poses: list[tuple]) -> Walk:
    positions, directions = (np.array(values, dtype=float) for values in zip(*poses, strict=True))
    return Walk(np.arange(len(poses)), positions, directions / np.linalg.norm(directions, axis=1, keepdims=True))


class SlowTracer:
    """Every ray against every triangle (Möller and Trumbore 1997)."""

    kinds: ClassVar = {"glass"}

    def __init__(self, room: Room) -> None:
        meshes = [mesh for name, mesh in room.meshes.items() if room.materials[name].kind not in self.kinds]
        self.corners = np.concatenate([mesh.vertices[mesh.triangles].astype(float) for mesh in meshes])

    def distance(self, origin: np.ndarray, ways: np.ndarray) -> np.ndarray:
        a, b, c = self.corners.transpose(1, 0, 2)
        first, second = b - a, c - a
        across = np.cross(ways[:, None], second)
        volume = np.einsum("tk,rtk->rt", first, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("tk,rtk->rt", origin - a, across) / volume
            other = np.cross(origin - a, first)
            v = np.einsum("rk,tk->rt", ways, other) / volume
            far = np.einsum("tk,tk->t", second, other) / volume
            hit = (np.abs(volume) > 1e-12) & (u >= 0) & (v >= 0) & (u + v <= 1) & (far > 1e-6)
        return np.where(hit, far, np.inf).min(axis=1)

    def first_hits(self, pose: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
        ways = rays @ pose[:3, :3].T
        far = self.distance(pose[:3, 3], ways)
        met = np.isfinite(far)
        return met, (pose[:3, 3] + ways * far[:, None])[met], None

    def sees(self, origin: np.ndarray, places: np.ndarray, slack: float) -> np.ndarray:
        ways = places - origin
        return self.distance(origin, ways) >= 1 - slack / np.linalg.norm(ways, axis=1)


def shares(room: Room, test: list[tuple], train: list[tuple]) -> list[float]:
    return seen_shares(room, looking(test).c2w, looking(train).c2w, 8, SlowTracer(room)).tolist()


AHEAD, BEHIND = ((-1, 0, 0), (1, 0, 0)), ((-1, 0, 0), (-1, 0, 0))


def test_the_same_view_sees_all_and_the_opposite_one_nothing():
    assert shares(cell(), [AHEAD, BEHIND], [AHEAD]) == [1, 0]
    assert shares(cell(), [AHEAD, BEHIND], [AHEAD, BEHIND]) == [1, 1]


def test_a_view_from_farther_back_sees_all_of_it_and_a_nearer_one_a_part():
    near, far = ((1, 0, 0), (1, 0, 0)), ((-1, 0, 0), (1, 0, 0))
    assert shares(cell(), [near], [far]) == [1]
    # At x = 1 a wall 1 m away is seen 2 tan(37.5°) m wide; from x = -1 all three times as wide, or up to the walls.
    assert shares(cell(), [far], [near])[0] == pytest.approx((1 / 3) ** 2, abs=0.13)


def test_what_is_behind_a_box_is_not_seen_and_what_is_behind_glass_is():
    wall = ((0, -1.9, -1.9), (0.1, 1.9, 1.9))
    beyond = ((0.5, 0, 0), (1, 0, 0))
    assert shares(cell(wall), [beyond], [AHEAD]) == [0]
    assert shares(cell(glass=(wall,)), [beyond], [AHEAD]) == [1]


def test_pixels_out_of_the_room_are_not_seen():
    room = cell()
    room.meshes["plaster"].triangles[:] = room.meshes["plaster"].triangles[0]  # of the walls there is one triangle left
    assert shares(room, [AHEAD], [AHEAD])[0] < 1


@pytest.mark.skipif(_rendering.available() is not None, reason="bpy is not installed")
def test_the_tree_of_triangles_says_what_the_slow_caster_says():
    room = cell(((0, -0.5, -0.5), (0.5, 0.5, 0.5)), glass=(((-1.5, -1, -1), (-1.4, 1, 1)),))
    test, train = looking([AHEAD, ((1, 1, 1), (-1, -1, -0.5))]).c2w, looking([((1.5, 1, 0), (-1, -0.4, 0.1))]).c2w
    slow = seen_shares(room, test, train, 12, SlowTracer(room))
    assert seen_shares(room, test, train, 12, _tracing.Tracer(room, ("glass",))).tolist() == slow.tolist()
