"""Checks what a reader returned, so that a broken capture ends in a sentence and not in a bad model."""

import numpy as np

from ..common.errors import UserError
from .image_files import image_size, is_file
from .types import Scene, Split

RIGID = 1e-3  # largest deviation of RᵀR from the identity; poses are often written with a few digits


def check_scene(scene: Scene) -> None:
    """Raises UserError for no frames, duplicate names, mixed sizes, poses that are not rigid or finite, and bad
    intrinsics.
    """
    if not len(scene.train):
        raise UserError(f"scene '{scene.name}' has no training views in '{scene.root}'")
    names = [*scene.train.names, *scene.test.names]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"scene '{scene.name}': frame '{twice}' is listed twice; frame names must be unique")
    for split in (scene.train, scene.test):
        _check_split(scene, split)
    _check_sizes(scene)
    if scene.points is not None and not np.isfinite(scene.points.xyz).all():
        raise UserError(f"scene '{scene.name}': its points have NaN or infinite coordinates; clean the point file")


def _check_split(scene: Scene, split: Split) -> None:
    cameras = split.cameras
    bad = ~np.all(np.isfinite(cameras.c2w), axis=(1, 2))
    if bad.any():
        raise UserError(f"scene '{scene.name}': the pose of frame '{_first(split, bad)}' has NaN or infinite entries")
    with np.errstate(all="ignore"):  # huge numbers in a damaged file overflow, and are found so
        gram = cameras.rotations.transpose(0, 2, 1) @ cameras.rotations
        bad = ~(np.abs(gram - np.eye(3)).max(axis=(1, 2), initial=0) <= RIGID)
        bad |= np.linalg.det(cameras.rotations) < 0
    bad |= np.abs(cameras.c2w[:, 3] - [0, 0, 0, 1]).max(axis=1, initial=0) > RIGID
    if bad.any():
        raise UserError(f"scene '{scene.name}': the pose of frame '{_first(split, bad)}' is no rigid motion")
    sizes = np.stack([cameras.fx, cameras.fy, cameras.width, cameras.height])
    bad = ~((sizes > 0) & np.isfinite(sizes)).all(axis=0) | ~np.isfinite(cameras.cx + cameras.cy)
    if bad.any():
        raise UserError(f"scene '{scene.name}': frame '{_first(split, bad)}' has a focal length or size of zero or NaN")


def _first(split: Split, bad: np.ndarray) -> str:
    return split.names[int(np.flatnonzero(bad)[0])]


def _check_sizes(scene: Scene) -> None:
    """Raises UserError when frames have different sizes: trainers and scores want one."""
    for split in (scene.train, scene.test):
        sizes = np.stack([split.cameras.width, split.cameras.height], axis=1)
        first = np.array([scene.train.cameras.width[0], scene.train.cameras.height[0]])
        bad = (sizes != first).any(axis=1)
        if bad.any():
            i = int(np.flatnonzero(bad)[0])
            raise UserError(
                f"scene '{scene.name}' mixes sizes: frame '{split.names[i]}' is {sizes[i][0]} x {sizes[i][1]}, "
                f"'{scene.train.names[0]}' {first[0]} x {first[1]}; resize the images to one size"
            )


def check_present(scene: Scene) -> None:
    """Raises UserError for the first image of either split that is missing, is no image or is not as big as the first.

    Only the heads of the files are read.
    """
    first = None
    for split in (scene.train, scene.test):
        for name, path in zip(split.names, split.paths, strict=True):
            if not is_file(path):
                raise UserError(f"scene '{scene.name}': the image of frame '{name}' is missing: '{path}'")
            size = image_size(path)
            first = first or size
            if size != first and scene.posed:  # readers of captures without poses have looked at all of them
                raise UserError(
                    f"scene '{scene.name}' mixes sizes: the image of frame '{name}' is {size[0]} x {size[1]}, "
                    f"that of '{scene.train.names[0]}' {first[0]} x {first[1]}; resize the images to one size"
                )
