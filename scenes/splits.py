"""Makes a test split where a capture has none, by a rule that is the same whoever asks."""

import dataclasses
import re

import numpy as np

from ..common.errors import UserError
from .types import Points, Scene

LEAST_TRACK = 2  # views that see a point: fewer cannot have triangulated it
BLOCKS = 6  # held-out blocks of `blocks:8` in a capture that is long enough


def held_out(rule: str, n: int) -> np.ndarray:
    """Sorted indices of the test views among `n` frames in the order of the format.

    `every:8` takes 0, 8, 16, … (Mip-NeRF 360's rule). `blocks:8` cuts the capture into 8 · 6 runs of equal length
    (fewer in a short capture, so that a run has at least two frames) and takes every 8th run, the 4th of each eight:
    no test view but those at a run's ends has a training neighbour in time. `none` takes nothing.
    Raises UserError for another rule, or one that would leave fewer than two training views.
    """
    match = re.fullmatch(r"(every|blocks):(\d{1,9})|none", rule)
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
    points, notes = training_points(scene.points, kept, len(scene.train))
    return dataclasses.replace(
        scene,
        train=scene.train.subset(kept),
        test=scene.train.subset(held),
        points=points,
        holdout=rule,
        notes=(*scene.notes, *notes),
    )


def training_points(points: Points | None, kept: np.ndarray, n: int) -> tuple[Points | None, tuple[str, ...]]:
    """The points that training may know of when the views `kept` of `n` are its own, and a note if some are left out.

    Those that a held-out view sees and fewer than two training views do go: they are known from the test. Tracks become
    those of the training views. Where a format has no tracks all points stay, as do those that nobody is said to see.
    What stays keeps its place, to which held-out views may have contributed.
    """
    if points is None or points.seen_by is None:
        return points, ()
    place = np.full(n, -1)
    place[kept] = np.arange(len(kept))
    tracks = [place[views][place[views] >= 0] for views in points.seen_by]
    stays = [
        len(left) >= LEAST_TRACK or len(left) == len(views) for left, views in zip(tracks, points.seen_by, strict=True)
    ]
    use = np.flatnonzero(stays)
    left = Points(points.xyz[use], points.rgb[use], tuple(tracks[i] for i in use))
    if len(use) == len(points):
        return left, ()
    note = (
        f"{len(points) - len(use)} of {len(points)} points left out: fewer than {LEAST_TRACK} training views see them"
    )
    return left if len(use) else None, (note,)
