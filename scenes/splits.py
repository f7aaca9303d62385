"""Makes a test split where a capture has none, by a rule that is the same whoever asks."""

import dataclasses
import re

import numpy as np

from viewbench.common.errors import UserError
from viewbench.scenes.types import Scene

BLOCKS = 6  # held-out blocks of `blocks:8` in a capture that is long enough


def held_out(rule: str, n: int) -> np.ndarray:
    """Sorted indices of the test views among `n` frames in the order of the format.

    `every:8` takes 0, 8, 16, … (Mip-NeRF 360's rule). `blocks:8` cuts the capture into 8 · 6 runs of equal length
    (fewer in a short capture, so that a run has at least two frames) and takes every 8th run, the 4th of each eight:
    no test view but those at a run's ends has a training neighbour in time. `none` takes nothing.
    Raises UserError for another rule, or one that would leave fewer than two training views.
    """
    match = re.fullmatch(r"(every|blocks):(\d+)|none", rule)
    if not match or (match[1] and int(match[2]) < 2):
        raise UserError(f"unknown holdout rule '{rule}'; it is every:K or blocks:K with K of at least 2, or none")
    if not match[1]:
        return np.zeros(0, dtype=np.int64)
    step = int(match[2])
    if match[1] == "every":
        held = np.arange(0, n, step)
    else:
        runs = step * max(1, min(BLOCKS, n // (2 * step)))
        run_of = np.arange(n) * runs // n
        held = np.flatnonzero(run_of % step == step // 2)
    if n - len(held) < 2:
        raise UserError(f"holdout '{rule}' leaves {n - len(held)} of {n} frames for training; at least 2 are needed")
    return held


def hold_out(scene: Scene, rule: str) -> Scene:
    """The scene with the rule's frames moved from the training to the test split.

    Raises UserError when the scene has a test split already and the rule is another one than none.
    """
    if rule in ("", "none"):
        return dataclasses.replace(scene, holdout="none" if not len(scene.test) else scene.holdout)
    if len(scene.test):
        raise UserError(f"scene '{scene.name}' has {len(scene.test)} test views of its own; leave --holdout out")
    held = held_out(rule, len(scene.train))
    kept = np.setdiff1d(np.arange(len(scene.train)), held)
    points = scene.points
    if points is not None and points.seen_by is not None:
        place = np.full(len(scene.train), -1)
        place[kept] = np.arange(len(kept))
        seen = tuple(place[views][place[views] >= 0] for views in points.seen_by)
        points = dataclasses.replace(points, seen_by=seen)
    return dataclasses.replace(
        scene, train=scene.train.subset(kept), test=scene.train.subset(held), points=points, holdout=rule
    )
