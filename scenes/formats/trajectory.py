"""A folder of images and a trajectory: poses as TUM or KITTI write them, matched by time or in order (--poses)."""

import os
import re
from pathlib import Path

import numpy as np

from ...common.bounded import quoted
from ...common.errors import UserError
from ..image_files import image_size, is_file
from ..types import UNCALIBRATED, Scene
from . import images as folder_of_images
from ._frames import split
from ._intrinsics import CAMERA, Intrinsics, camera_file, given, read_camera
from ._text import lines, table
from ._timed import FARTHEST_S, poses_at, read_tum, seconds

WRITABLE = False
LAST = True  # asked when no other format with poses knows the folder
NAMES = ("traj.txt", "trajectory.txt")  # and *.tum
COLUMNS = (8, 12, 16)  # TUM's time x y z qx qy qz qw, KITTI's 3 x 4 and a whole 4 x 4 matrix, row by row
# A time in a file's name, alone or behind "_" or "-": seconds with a point, or as many digits as whole seconds, milli-,
# micro- and nanoseconds since 1970 have in our days (a date, 20240131120000, has fourteen).
STAMP = re.compile(r"(?:.*[_-])?(\d+\.\d+|[1-9]\d{9}(?:\d{3}){0,3})")


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None: it has images and beside them one file that is a trajectory."""
    file = _beside(root)
    return f"it has images and {file.name}" if file and folder_of_images.detect(root) else None


def _beside(root: Path) -> Path | None:
    """The single file of a trajectory's name in the folder whose first row is one of a trajectory's."""
    if not root.is_dir():
        return None
    named = [path for path in root.iterdir() if path.suffix.lower() == ".tum" or path.name.lower() in NAMES]
    found = [path for path in named if path.is_file() and _columns(path) in COLUMNS]
    return found[0] if len(found) == 1 else None


def _columns(file: Path) -> int:
    """How many numbers the first row has; 0 where it is none."""
    try:
        for _, line in lines(file, "trajectory")[:2]:
            words = line.split("#")[0].replace(",", " ").split()
            if all(re.fullmatch(r"[-+.\deE]+|[-+]?(nan|inf)", word, re.I) for word in words):
                return len(words)
    except UserError:
        pass
    return 0


def read(root: Path, poses: Path | None = None, intrinsics: str = "", times: Path | None = None) -> Scene:
    """The images of the folder (or of its images/) that have a pose in the trajectory; the others are counted.

    `poses` has rows of TUM (time x y z qx qy qz qw), or the 12 or 16 numbers of a matrix; all are camera-to-world with
    OpenCV axes, quaternions with w last. Rows with a time are matched by the times in the images' names (seconds, or
    milli-, micro- or nanoseconds since 1970) or in `times` (lines "time name", or a time for each image in order), a
    pose being interpolated between rows; without times, and matrices always, row by row to the images in natural order
    of their names. `intrinsics` is "fx,fy,cx,cy[,k1,k2,p1,p2[,k3]]"; else camera.txt with the same (or a 3 x 3 matrix)
    is looked for in the folder, in images/, beside the trajectory and above the folder where the images are in it.
    Without any the views can be chosen from and not written.
    Raises UserError for rows that are no pose, with their line, and where images and rows do not fit.
    """
    if root.is_file():
        raise UserError(f"'{root}' is a file; poses go with a folder of images, so extract the frames of a video first")
    found = folder_of_images.read(root)  # checks sizes
    paths = found.train.paths
    file = poses or _beside(root)
    if file is None:
        raise UserError(f"'{root}' has no single *.tum, {' or '.join(NAMES)}; name the trajectory by --poses FILE")
    if not is_file(file):
        what = "a folder" if os.path.isdir(file) else "missing"  # noqa: PTH112
        raise UserError(f"trajectory '{file}' is {what}; name a text file")
    rows, numbers = table(file, "trajectory")
    if rows.shape[1] not in COLUMNS:
        raise UserError(
            f"trajectory '{file}', line {numbers[0]} has {rows.shape[1]} numbers, expected 8 (TUM: time x y z qx qy qz "
            "qw), 12 (KITTI: 3 x 4 matrix) or 16 (4 x 4 matrix)"
        )
    if rows.shape[1] == 8:
        kept, matrices, stamps, notes = _by_time(file, rows, paths, times)
    else:
        kept, matrices, notes = _in_order(file, rows, numbers, paths)
        stamps = _stamps(paths, times)
        stamps = None if stamps is None or np.isnan(stamps).any() else stamps
    chosen = [path for path, good in zip(paths, kept, strict=True) if good]
    above = [root.absolute().parent] if chosen[0].parent == root else []
    lens_file = None if intrinsics else camera_file(root, chosen[0].parent, file.parent, *above)
    camera = given(intrinsics) if intrinsics else read_camera(lens_file) if lens_file else None
    folder = chosen[0].parent
    seen = camera or _nominal(chosen[0])
    train = split(folder, chosen, matrices, seen, None if stamps is None else stamps[kept])
    return Scene(
        name=root.name,
        root=root,
        format="trajectory",
        train=train,
        test=train.subset([]),
        files=tuple(path for path in (file, times, lens_file) if path),
        notes=(f"poses of '{file}', {notes[0]}", *notes[1:], *([] if camera else [f"no intrinsics: {_hint(root)}"])),
        details={"assumed": intrinsics} if intrinsics else {},
    )


def _nominal(image: Path) -> Intrinsics:
    """What stands for intrinsics that nobody has told; marked so that nothing is computed with them."""
    width, height = image_size(image)
    return Intrinsics(width, width, width / 2, height / 2, "", model=UNCALIBRATED)


def _hint(root: Path) -> str:
    return f"give --intrinsics fx,fy,cx,cy or write them into '{root / CAMERA}'"


def _by_time(
    file: Path, rows: np.ndarray, paths: tuple[Path, ...], times: Path | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, list[str]]:
    """Which images have a pose, the poses of those, the times of all images, and notes."""
    path, lost = read_tum(file)
    notes = [f"{lost} of {len(rows)} rows hold NaN and are left out"] if lost else []
    stamps = _stamps(paths, times)
    if stamps is None and len(rows) == len(paths):
        # A row that was lost has no pose, and its image neither; rows are taken as they stand in the file.
        good = np.all(np.isfinite(rows), axis=1)
        back = np.argsort(np.argsort(rows[good, 0], kind="stable"), kind="stable")
        return good, path.poses[back], seconds(rows[:, 0]), ["row by row in the order of the images' names", *notes]
    if stamps is None:
        raise UserError(
            f"'{file}' has {len(rows)} rows for {len(paths)} images, and '{paths[0].name}' has no time in its name: "
            'give --times FILE with lines "time name", or a time for each image in order'
        )
    known = np.isfinite(stamps)
    kept = np.zeros(len(paths), dtype=bool)
    kept[known], poses = poses_at(path, stamps[known])
    if not kept.any():
        raise UserError(
            f"no image has a pose within {FARTHEST_S} s: images are from {np.nanmin(stamps):.3f} to "
            f"{np.nanmax(stamps):.3f} s, '{file}' from {path.times[0]:.3f} to {path.times[-1]:.3f} s"
        )
    if not kept.all():
        notes.insert(0, f"{int((~kept).sum())} of {len(paths)} images dropped: no pose within {FARTHEST_S} s")
    by = f"in '{times}'" if times else "in the images' names"
    return kept, poses, stamps, [f"matched by the times {by}", *notes]


def _in_order(
    file: Path, rows: np.ndarray, numbers: list[int], paths: tuple[Path, ...]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Matrices row by row; those that hold NaN or infinity have no image. Raises UserError for another number."""
    if len(rows) != len(paths):
        raise UserError(f"'{file}' has {len(rows)} rows for {len(paths)} images; matrices without times need one each")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    width = rows.shape[1]
    poses[:, : width // 4] = rows.reshape(len(rows), width // 4, 4)
    kept = np.all(np.isfinite(rows), axis=1)
    turn = poses[:, :3, :3]
    with np.errstate(all="ignore"):
        skew = np.abs(turn.transpose(0, 2, 1) @ turn - np.eye(3)).max(axis=(1, 2))
        bad = kept & ~((skew <= 0.01) & (np.linalg.det(turn) > 0) & (np.abs(poses[:, 3] - [0, 0, 0, 1]).max(1) < 1e-6))
    if bad.any():
        first = numbers[int(np.flatnonzero(bad)[0])]
        raise UserError(
            f"trajectory '{file}', line {first} is no rigid motion: expected rows of a {width // 4} x 4 matrix"
        )
    if not kept.any():
        raise UserError(f"trajectory '{file}' has no row of finite numbers")
    notes = ["row by row in the order of the images' names"]
    if not kept.all():
        notes.append(f"{int((~kept).sum())} of {len(paths)} images dropped: their row holds NaN or infinity")
    return kept, poses[kept], notes


def _stamps(paths: tuple[Path, ...], times: Path | None) -> np.ndarray | None:
    """(N,) seconds of the images, NaN for one that the file of times does not name; None where nothing tells.

    Raises UserError for a file of times that fits none of the images.
    """
    if times is None:
        found = [STAMP.fullmatch(path.stem) for path in paths]
        return seconds(np.array([float(match[1]) for match in found if match])) if all(found) else None
    rows = [(number, line.replace(",", " ").split(maxsplit=1) or [line]) for number, line in lines(times, "times")]
    stamps, names = [], []
    for number, words in rows:
        try:
            stamps.append(float(words[0]))
        except ValueError:
            if not stamps:
                continue  # a heading
            raise UserError(f"times '{times}', line {number}: {quoted(times, words[0], 40)} is no number") from None
        names.append(words[1].strip() if len(words) == 2 else "")
    if not stamps or not np.isfinite(stamps).all():
        raise UserError(f"times '{times}' should have a time on each line")
    if not any(names):
        if len(stamps) != len(paths):
            raise UserError(
                f"times '{times}' has {len(stamps)} lines for {len(paths)} images; write lines \"time name\""
            )
        return seconds(np.array(stamps))
    by_name = {Path(name).name: value for name, value in zip(names, seconds(np.array(stamps)), strict=True)}
    return np.array([by_name.get(path.name, by_name.get(path.stem, np.nan)) for path in paths])
