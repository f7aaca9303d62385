"""KITTI odometry: image_2/ (or image_3, image_0, image_1), calib.txt, times.txt and poses of the left grey camera."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..types import Scene
from ._frames import by_number, split
from ._intrinsics import Intrinsics
from ._text import lines, numbers

WRITABLE = False
CAMERAS = (2, 3, 0, 1)  # those in colour first


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    camera = _camera(root)
    if camera is None or not (root / "calib.txt").is_file():
        return None
    return f"it has image_{camera}/, calib.txt and {_poses(root)}" if _poses(root) else None


def _camera(root: Path) -> int | None:
    return next((number for number in CAMERAS if (root / f"image_{number}").is_dir()), None)


def _poses(root: Path) -> Path | None:
    """poses.txt, or NN.txt in the folder poses/ that the data set has beside sequences/NN/."""
    beside = [path.parent.parent / "poses" / f"{path.name}.txt" for path in (root.absolute(), root.resolve())]
    return next((path for path in (root / "poses.txt", *beside) if path.is_file()), None)


def read(root: Path) -> Scene:
    """The frames of one camera of a sequence; pose and time i are those of the image with number i.

    A row of poses.txt is the upper 3 x 4 of the pose of camera 0; the matrix P of calib.txt has the intrinsics and the
    place of its camera beside that one, all being rectified to the same axes (devkit readme).
    Raises UserError for an image without a pose, and for files that are not as the data set documents them.
    """
    camera, file = _camera(root), _poses(root)
    if camera is None or file is None:
        raise UserError(f"'{root}' has no image_2/ or no poses; sequences 11 to 21 come without")
    folder = root / f"image_{camera}"
    images = by_number(folder, (".png", ".jpg", ".jpeg"))
    if not images:
        raise UserError(f"'{folder}' has no images")
    rows = numbers(file, "poses")
    if rows.shape[1] != 12:
        raise UserError(f"poses '{file}' have {rows.shape[1]} numbers a line, expected the 12 of a 3 x 4 matrix")
    odd = next((path for path in images if not path.stem.isdecimal() or len(path.stem) > 9), None)
    if odd is not None:
        raise UserError(f"image '{odd}' should be named by its number, as 000000.png")
    index = np.array([int(path.stem) for path in images])
    if index.max() >= len(rows):
        raise UserError(f"image '{images[-1]}' has no pose: '{file}' has {len(rows)} rows")
    projection = _projection(root / "calib.txt", camera)
    k = projection[:, :3]
    poses = np.tile(np.eye(4), (len(images), 1, 1))
    poses[:, :3] = rows[index].reshape(-1, 3, 4)
    beside = np.eye(4)
    beside[:3, 3] = -np.linalg.solve(k, projection[:, 3])  # P = K [I | t] with t from camera 0 to this one
    times = root / "times.txt"
    stamps = numbers(times, "times").ravel() if times.is_file() else None
    if stamps is not None and len(stamps) <= index.max():
        raise UserError(f"'{times}' has {len(stamps)} times for {len(images)} images")
    # Pixels are counted from the centre of the first one.
    lens = Intrinsics(k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5, f"'{root / 'calib.txt'}' (P{camera})")
    train = split(root, images, poses @ beside, lens, None if stamps is None else stamps[index])
    return Scene(
        name=root.name,
        root=root,
        format="kitti",
        train=train,
        test=train.subset([]),
        files=(root / "calib.txt", file, *([times] if stamps is not None else [])),
        notes=(f"pictures of camera {camera}, image_{camera}/",),
    )


def _projection(file: Path, camera: int) -> np.ndarray:
    """(3, 4) matrix P of the rectified camera."""
    for number, line in lines(file, "calibration"):
        name, _, values = line.partition(":")
        if name.strip() not in (f"P{camera}", f"P_rect_{camera:02d}"):
            continue
        try:
            matrix = np.array([float(word) for word in values.split()]).reshape(3, 4)
        except ValueError:
            raise UserError(f"calibration '{file}', line {number}: P{camera} should have 12 numbers") from None
        if not np.isfinite(matrix).all() or not matrix[0, 0] > 0 or not abs(np.linalg.det(matrix[:, :3])) > 0:
            raise UserError(f"calibration '{file}', line {number}: P{camera} is no projection matrix")
        return matrix
    raise UserError(f"calibration '{file}' has no line P{camera}:")
