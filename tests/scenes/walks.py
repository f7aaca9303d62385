"""Camera paths for the tests of readers: a real handheld one where the captures are, and one that is made up."""

import os
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

REAL = "trajectories/tum_rgbd/freiburg2_desk_groundtruth.txt"
FIRST_S = 1311868163.87  # of the real path


def walk(kind, n=400):
    """(times in seconds, (n, 3) positions, Rotation of n) of a body; None where the real path is not here."""
    if kind == "real":
        path = Path(os.environ.get("VIEWBENCH_DATA") or "/nowhere") / REAL
        if not path.is_file():
            return None
        rows = np.loadtxt(path)[:n]
        return rows[:, 0], rows[:, 1:4], Rotation.from_quat(rows[:, 4:])
    rng = np.random.default_rng(5)
    times = FIRST_S + np.cumsum(rng.uniform(0.004, 0.006, n))
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.02, (n, 3)), axis=0))
    return times, np.cumsum(rng.normal(0, 0.01, (n, 3)), axis=0), turns


def matrices(positions, turns):
    """(n, 4, 4)."""
    made = np.tile(np.eye(4), (len(positions), 1, 1))
    made[:, :3, :3], made[:, :3, 3] = turns.as_matrix(), positions
    return made


def between(times, positions, turns, wanted):
    """The poses at the times `wanted` by scipy: positions linear, rotations on the shortest arc."""
    from scipy.spatial.transform import Slerp

    places = np.stack([np.interp(wanted, times, positions[:, axis]) for axis in range(3)], axis=1)
    return matrices(places, Slerp(times, turns)(wanted))
