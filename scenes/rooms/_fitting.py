"""Brings a recorded trajectory into a room: turned, scaled and moved into its free space, and out of what stands there.

A recorded path keeps its rotations but for one turn about the vertical; of its places as few as can be are moved.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..formats._timed import Trajectory, read_tum
from ..types import OPENCV
from ._clearance import CLEARANCE_M, Space, clearance, space
from ._types import Room

TURNS = 24  # about the vertical that are tried
PLACES = 9  # along x and along y that are tried
SEARCHED = 200  # poses that the search looks at
ROUNDS = 8  # of moving poses out of the way smoothly; after them the rest is moved at once
SPREAD_S = 0.5  # over which a move is spread (the deviation of a Gaussian)
MOST = 5_000  # rows of a trajectory that are fitted, unless more frames are wanted


@dataclass(frozen=True)
class Fitted:
    """N poses in the room, and what was done to them."""

    times: np.ndarray  # (N,) seconds from 0
    c2w: np.ndarray  # (N, 4, 4) OpenGL axes
    notes: tuple[str, ...]


def fitted(file: Path, room: Room, count: int) -> Fitted:
    """`count` rows of a TUM trajectory, evenly spread over its rows, in the room. z is up in both.

    The way is the same for any `count` up to MOST, since so many rows are fitted, of which frames are taken. Every pose
    keeps CLEARANCE_M of everything. Raises UserError for a file that is no trajectory, fewer rows than `count`, and a
    room without space for a camera.
    """
    path, lost = read_tum(file)
    if count > len(path):
        raise UserError(f"trajectory '{file}' has {len(path)} rows; --frames {count} is more")
    path = _evenly(path, min(len(path), max(count, MOST)))
    free = space(room)
    if not len(free.points):
        raise UserError(f"the room has no place that is {CLEARANCE_M} m from everything; a path cannot be fitted")
    angle, scale, move = _placed(path.positions, free)
    turn = _about_z(angle)
    places = scale * (path.positions @ turn.T) + move
    spread = SPREAD_S / max(float(np.median(np.diff(path.times, append=path.times[-1] + 1))), 1e-3)
    clear, count_moved, farthest = _moved_out(places, room, free, spread)
    c2w = path.poses @ OPENCV
    c2w[:, :3, :3] = turn @ c2w[:, :3, :3]
    c2w[:, :3, 3] = clear
    chosen = np.linspace(0, len(path) - 1, count).round().astype(int)
    steps = [np.linalg.norm(np.diff(values[chosen], axis=0), axis=1).max(initial=0.0) for values in (places, clear)]
    notes = [
        f"scaled by {scale:.3f} and turned by {np.degrees(angle):.0f} degrees into the free space",
        f"{count_moved} of {len(path)} poses moved, by up to {farthest:.2f} m, to be {CLEARANCE_M} m from everything"
        if count_moved
        else f"no pose moved: all are {CLEARANCE_M} m or more from everything",
        f"longest step between frames {steps[1]:.3f} m ({steps[0]:.3f} m before that)",
    ]
    if lost:
        notes.insert(0, f"{lost} rows hold NaN and are left out")
    return Fitted(path.times[chosen] - path.times[0], c2w[chosen], tuple(notes))


def _evenly(path: Trajectory, count: int) -> Trajectory:
    rows = np.linspace(0, len(path) - 1, count).round().astype(int)
    return Trajectory(path.times[rows], path.positions[rows], path.quaternions[rows])


def _about_z(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _placed(positions: np.ndarray, free: Space) -> tuple[float, float, np.ndarray]:
    """The turn, the scale (at most 1) and the move for which the share of poses in the way plus 1 - scale is least."""
    low, high = free.points.min(axis=0), free.points.max(axis=0)
    looked_at = positions[:: max(1, len(positions) // SEARCHED)]
    best: tuple[float, float, float, np.ndarray] | None = None
    for k in range(TURNS):
        angle = k * 2 * np.pi / TURNS
        turned = positions @ _about_z(angle).T
        least, most = turned.min(axis=0), turned.max(axis=0)
        extent = np.maximum(most - least, 1e-9)
        scale = float(min(1.0, ((high - low) / extent).min()))
        room_left = np.maximum((high - low) - scale * extent, 0.0)
        # The height is the recorded one where that fits: rooms have their floors at 0, and so have motion captures.
        height = float(np.clip(scale * least[2], low[2], low[2] + room_left[2]))
        turned = scale * (looked_at @ _about_z(angle).T - least)
        for share_x in np.linspace(0, 1, PLACES):
            for share_y in np.linspace(0, 1, PLACES):
                corner = np.array([low[0] + share_x * room_left[0], low[1] + share_y * room_left[1], height])
                cost = float(1 - free.free_at(turned + corner).mean()) + 1 - scale
                if best is None or cost < best[0] - 1e-12:
                    best = (cost, angle, scale, corner - scale * least)
    assert best is not None
    return best[1:]


def _moved_out(places: np.ndarray, room: Room, free: Space, spread: float) -> tuple[np.ndarray, int, float]:
    """The places with their clearance, how many were moved by more than a millimetre, and the longest move in metres.

    What is in the way goes to the nearest free place, its neighbours a part of that way, which falls off over `spread`
    rows; what is still in the way after ROUNDS goes there alone.
    """
    from scipy.ndimage import gaussian_filter1d
    from scipy.spatial import KDTree

    tree = KDTree(free.points)
    clear = places.copy()
    for turn in range(ROUNDS + 1):
        blocked = clearance(room, clear) < CLEARANCE_M
        if not blocked.any():
            break
        goal = free.points[tree.query(clear[blocked])[1]]
        if turn == ROUNDS:
            clear[blocked] = goal
            break
        way = np.zeros_like(clear)
        way[blocked] = goal - clear[blocked]
        clear = clear + gaussian_filter1d(way, spread, axis=0, mode="nearest")
    moved = np.linalg.norm(clear - places, axis=1)
    return clear, int((moved > 1e-3).sum()), float(moved.max())
