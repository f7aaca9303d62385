"""Poses by time: trajectories as text, poses between two of their rows, and what belongs to which frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ._text import table

FARTHEST_S = 0.02  # between a frame and what belongs to it, as in TUM's associate.py
LONGEST_GAP_S = 0.1  # over which poses are interpolated
UNIT = 0.1  # largest deviation of a quaternion's length from 1: they are often written with a few digits


@dataclass(frozen=True)
class Trajectory:
    """Camera-to-world poses in order of time."""

    times: np.ndarray  # (N,) float64 seconds, rising
    positions: np.ndarray  # (N, 3)
    quaternions: np.ndarray  # (N, 4), unit, x y z w

    def __len__(self) -> int:
        return len(self.times)

    @property
    def poses(self) -> np.ndarray:
        """(N, 4, 4) matrices."""
        return matrices(self.positions, self.quaternions)


def trajectory(times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray) -> Trajectory:
    """A trajectory of rows in any order, the quaternions brought to length 1."""
    order = np.argsort(times, kind="stable")
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return Trajectory(times[order], positions[order], unit[order])


def seconds(stamps: np.ndarray) -> np.ndarray:
    """Time stamps in seconds, whichever unit they are in: seconds of our days have 10 digits, nanoseconds 19."""
    largest = float(np.max(np.abs(stamps), initial=0.0))
    unit = next((10.0**-power for power in (0, 3, 6) if largest < 10.0 ** (power + 11)), 1e-9)
    return stamps * unit


def read_tum(path: Path) -> tuple[Trajectory, int]:
    """The rows time tx ty tz qx qy qz qw of a text file, and how many of them hold NaN (tracking was lost).

    Raises UserError, which names the line, for anything else and for a rotation that is no unit quaternion.
    """
    rows, numbers = table(path, "trajectory")
    if rows.shape[1] != 8:
        raise UserError(
            f"trajectory '{path}' has {rows.shape[1]} numbers a line, expected the 8 of time tx ty tz qx qy qz qw"
        )
    finite = np.isfinite(rows).all(axis=1)
    if not finite.any():
        raise UserError(f"trajectory '{path}' has no row of finite numbers")
    length = np.linalg.norm(rows[:, 4:], axis=1)
    bad = np.flatnonzero(finite & ~(np.abs(length - 1) <= UNIT))
    if len(bad):
        raise UserError(
            f"trajectory '{path}', line {numbers[bad[0]]}: its last four numbers are no quaternion of length 1 (theirs "
            f"is {length[bad[0]]:.3g}); rows are time tx ty tz qx qy qz qw"
        )
    kept = rows[finite]
    return trajectory(seconds(kept[:, 0]), kept[:, 1:4], kept[:, 4:]), int((~finite).sum())


def matrices(positions: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """(N, 4, 4) of (N, 3) positions and (N, 4) unit quaternions x y z w."""
    x, y, z, w = quaternions.T
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, :3] = np.array(turn).transpose(2, 0, 1)
    poses[:, :3, 3] = positions
    return poses


def nearest(stamps: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(N,) index of the rising `stamps` nearest to each of (N,) `times`, the earlier of two that are as near."""
    after = np.minimum(np.searchsorted(stamps, times), len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(stamps[before] - times) <= np.abs(stamps[after] - times), before, after)


def poses_at(path: Trajectory, times: np.ndarray, outside: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Which of (N,) `times` have a row within 0.02 s (N booleans), and the (K, 4, 4) poses of those.

    Between two rows that are at most 0.1 s apart a pose is interpolated, the position linearly and the rotation along
    the shortest arc; elsewhere it is the nearest row's. Without `outside` nothing before the first row or after the
    last has a pose.
    """
    near = nearest(path.times, times)
    kept = np.abs(path.times[near] - times) <= FARTHEST_S
    if not outside:
        kept &= (times >= path.times[0]) & (times <= path.times[-1])
    near, times = near[kept], times[kept]
    before = np.clip(np.searchsorted(path.times, times, side="right") - 1, 0, len(path) - 1)
    after = np.minimum(before + 1, len(path) - 1)
    gap = path.times[after] - path.times[before]
    between = (gap > 0) & (gap <= LONGEST_GAP_S) & (times >= path.times[before]) & (times <= path.times[after])
    before, after = np.where(between, before, near), np.where(between, after, near)
    share = np.where(between, (times - path.times[before]) / np.where(between, gap, 1.0), 0.0)[:, None]
    positions = (1 - share) * path.positions[before] + share * path.positions[after]
    return kept, matrices(positions, _slerp(path.quaternions[before], path.quaternions[after], share))


def _slerp(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions on the shorter arc from `first` to `second` (Shoemake, SIGGRAPH 1985)."""
    cosine = np.sum(first * second, axis=1, keepdims=True)
    second = np.where(cosine < 0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    small = angle < 1e-4  # where the arc is its chord
    sine = np.where(small, 1.0, np.sin(angle))
    weights = np.where(small, 1 - share, np.sin((1 - share) * angle) / sine)
    mixed = weights * first + np.where(small, share, np.sin(share * angle) / sine) * second
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def associate(first: np.ndarray, second: np.ndarray, farthest: float = FARTHEST_S) -> list[int | None]:
    """For each time in `first` the index of its partner in `second`, nearer than `farthest`, or None.

    Both are rising. As in TUM's associate.py (rgbd_benchmark_tools): of all pairs the nearest is matched first, and
    neither of the two is matched again.
    """
    begin = np.searchsorted(second, first - farthest, side="left")
    end = np.searchsorted(second, first + farthest, side="right")
    pairs = [
        (abs(first[i] - second[j]), i, j)
        for i in range(len(first))
        for j in range(begin[i], end[i])
        if abs(first[i] - second[j]) < farthest
    ]
    partner: list[int | None] = [None] * len(first)
    taken = set()
    for _, i, j in sorted(pairs):
        if partner[i] is None and j not in taken:
            partner[i] = j
            taken.add(j)
    return partner
