"""Checks what a reader returned, so that a broken capture ends in a sentence and not in a bad model."""

import numpy as np

from ..common.errors import UserError
from .image_files import image_size, is_file
from .types import Scene, Split

RIGID = 1e-3  # largest deviation of RᵀR from the identity; poses are often written with a few digits


def check_scene(scene: Scene) -> None:
    """Raises UserError for no frames, duplicate names, poses that are not rigid or finite, and bad intrinsics."""
    if not len(scene.train):
        raise UserError(f"scene '{scene.name}' has no training views in '{scene.root}'")
    names = [*scene.train.names, *scene.test.names]
    if len(set(names)) != len(names):
        known: set[str] = set()
        twice = next(name for name in names if name in known or known.add(name))
        raise UserError(f"scene '{scene.name}': frame '{twice}' is listed twice; frame names must be unique")
    for split in (scene.train, scene.test):
        _check_split(scene, split)
    if scene.points is not None and not np.isfinite(scene.points.xyz).all():
        raise UserError(f"scene '{scene.name}': its points have NaN or infinite coordinates; clean the point file")


def _check_split(scene: Scene, split: Split) -> None:
    cameras = split.cameras
    bad = ~np.all(np.isfinite(cameras.c2w), axis=(1, 2))
    if bad.any():
        raise UserError(f"scene '{scene.name}': the pose of frame '{_first(split, bad)}' has NaN or infinite entries")
    if split.times is not None and not np.isfinite(split.times).all():
        late = split.names[int(np.isfinite(split.times).argmin())]
        raise UserError(f"scene '{scene.name}': the time of frame '{late}' is NaN or infinite")
    with np.errstate(all="ignore"):  # huge numbers in a damaged file overflow, and are found so
        gram = cameras.rotations.transpose(0, 2, 1) @ cameras.rotations
        bad = ~(np.abs(gram - np.eye(3)).max(axis=(1, 2), initial=0) <= RIGID)
        bad |= np.linalg.det(cameras.rotations) < 0
    bad |= np.abs(cameras.c2w[:, 3] - [0, 0, 0, 1]).max(axis=1, initial=0) > RIGID
    if bad.any():
        raise UserError(f"scene '{scene.name}': the pose of frame '{_first(split, bad)}' is no rigid motion")
    if cameras.distortion is not None and not np.isfinite(cameras.distortion).all():
        first = split.names[int(np.isfinite(cameras.distortion).all(axis=1).argmin())]
        raise UserError(f"scene '{scene.name}': the lens of frame '{first}' has NaN or infinite numbers")
    sizes = np.stack([cameras.fx, cameras.fy, cameras.width, cameras.height])
    bad = ~((sizes > 0) & np.isfinite(sizes)).all(axis=0) | ~np.isfinite(cameras.cx + cameras.cy)
    if bad.any():
        raise UserError(f"scene '{scene.name}': frame '{_first(split, bad)}' has a focal length or size of zero or NaN")


def _first(split: Split, bad: np.ndarray) -> str:
    return split.names[int(np.flatnonzero(bad)[0])]


def check_present(scene: Scene) -> None:
    """Raises UserError for the first image of either split that is missing, is none, or is not of its camera's size.

    Only the heads of the files are read. Of an image that was resized without its intrinsics every ray would be wrong,
    and nobody would be told.
    """
    # A video's pictures are made small, its cameras have its own size; readers without poses have looked at all images.
    unlike = bool(scene.details.get("extracted")) or not scene.posed
    for split in (scene.train, scene.test):
        sizes = zip(split.cameras.width.tolist(), split.cameras.height.tolist(), strict=True)
        for name, path, size in zip(split.names, split.paths, sizes, strict=True):
            if not is_file(path):
                raise UserError(f"scene '{scene.name}': the image of frame '{name}' is missing: '{path}'")
            found = image_size(path)
            if found != size and not unlike:
                raise UserError(
                    f"scene '{scene.name}': the intrinsics of frame '{name}' are of {size[0]} x {size[1]} pixels, its "
                    f"image has {found[0]} x {found[1]}; {_remedy(size, found)}"
                )


def _remedy(camera: tuple[int, int], image: tuple[int, int]) -> str:
    across, down = image[0] / camera[0], image[1] / camera[1]
    if abs(across / down - 1) < 0.02:
        return f"multiply its focal lengths and centre by {across:.4g}, or bring the images in their first size"
    if abs(image[0] / camera[1] - image[1] / camera[0]) < 0.02:
        return "it was turned on its side: bring it as the camera took it, or turn its pose and intrinsics too"
    return "bring the images as they were when the intrinsics were made: these were cropped or squeezed"
