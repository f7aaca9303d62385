"""Up and the page's axes, for captures whose up is known."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viewbench.reports._topview import limits, pieces, plane, round_length

from .fixtures import ROOM


def room_cameras():
    frames = json.loads((ROOM / "human" / "transforms_train.json").read_text())["frames"]
    poses = np.array([frame["transform_matrix"] for frame in frames])
    return poses[:, :3, 3], -poses[:, :3, 2]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_up_is_found_and_snapped_whichever_axis_it_is(axis, sign):
    positions, forward = room_cameras()  # z up
    turn = np.roll(np.eye(3), axis + 1, axis=0)  # a cyclic change of axes is a rotation: z becomes `axis`
    if sign < 0:
        turn = np.diag([-1.0 if i == axis else 1.0 if i == (axis + 1) % 3 else -1.0 for i in range(3)]) @ turn
    right, ahead = plane(positions @ turn.T, forward @ turn.T)
    np.testing.assert_allclose(np.cross(right, ahead), turn @ [0, 0, 1], atol=1e-9)


def test_axes_are_orthonormal_and_never_mirrored():
    rng = np.random.default_rng(0)
    for _ in range(20):
        positions, forward = rng.normal(size=(50, 3)) * [3, 2, 0.1], rng.normal(size=(50, 3)) * [1, 1, 0.2]
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        forward[:, 2] -= 0.1
        axes = plane(positions, forward)
        np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-9)
        assert np.cross(*axes)[2] > 0.9


def test_one_camera_is_enough():
    assert np.isfinite(plane(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))).all()


def test_pieces_cut_at_jumps_and_lose_no_view():
    path = np.stack([np.r_[0:1:0.01, 3:4:0.01], np.zeros(200)], axis=1)
    cut = pieces(path)
    assert [len(piece) for piece in cut] == [100, 100]
    np.testing.assert_array_equal(np.vstack(cut), path)
    assert len(pieces(np.zeros((5, 2)))) == 1


@given(st.floats(1e-9, 1e12))
def test_a_round_length_is_the_longest_of_1_2_5_that_fits(most):
    length = round_length(most)
    assert length <= most * (1 + 1e-12)
    assert length > most * 0.4 * (1 - 1e-9)
    assert f"{length:.6e}"[:8] in ("1.000000", "2.000000", "5.000000")


def test_limits_have_the_cameras_and_the_walls_around_them_and_nothing_far_away():
    cameras = np.array([[0.0, 0], [4, 0], [4, 1]])
    walls, away = np.array([[-1.0, -1], [5, 2]]), np.array([[40.0, 0], [0, -40]])
    low, high = limits(cameras, np.vstack([walls, away]))
    for point in (*cameras, *walls):
        assert (low <= point).all()
        assert (point <= high).all()
    assert (high - low).max() < 8
    low, high = limits(np.zeros((3, 2)), np.zeros((0, 2)))
    assert (high > low).all()
    low, high = limits(np.zeros((3, 2)), np.vstack([3 * walls, 50 * away, 60 * away]))
    assert ((low < 0) & (high > 0)).all()
    low, high = limits(np.zeros((9, 2)), np.vstack([walls, 1.1 * walls, away]))
    for point in walls:
        assert (low <= point).all()
        assert (point <= high).all()
    assert (high - low).max() < 20
