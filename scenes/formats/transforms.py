"""transforms.json of Blender and nerfstudio: one file, or transforms_train/test/val.json (IndoorTraj, Replica)."""

import math
from collections import ChainMap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...common import limits
from ...common.errors import UserError
from ...common.files import read_json
from ..image_files import image_size, is_file, leaves
from ..types import Cameras, Points, Scene, Split
from ._frames import times_of
from ._transforms_write import COMPANIONS, LENS, SINGLE, TESTS, TRAIN, write

__all__ = ["WRITABLE", "detect", "read", "write"]

WRITABLE = True
LENSES = ("", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")  # camera_model, where it is named
SUFFIXES = (".png", ".jpg", ".jpeg", ".JPG", ".PNG")  # tried in turn where file_path has none, as Blender's has not


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    for name in (SINGLE, TRAIN):
        if (root / name).is_file():
            return f"it has {name}"
    return None


def read(root: Path, allow_outside: bool = False) -> Scene:
    """Reads both splits, poses as they stand (they are camera-to-world with OpenGL axes already) and points.

    The test split is that of transforms_test.json (or transforms_val.json), or of nerfstudio's test_filenames (or
    val_filenames) in a single transforms.json. Where both files are there, the second is kept for the writer.
    A file_path that leaves the folder is refused unless `allow_outside`.
    Raises UserError for files that are missing or not as documented.
    """
    if (root / SINGLE).is_file():
        files: dict[str, Path] = {"train": root / SINGLE}
    else:
        held = [root / name for name in TESTS if (root / name).is_file()]
        files = dict(zip(("train", "test", "spare"), [root / TRAIN, *held], strict=False))
    tables = {key: read_json(file, "transforms") for key, file in files.items()}
    splits = {key: _split(root, files[key], table, allow_outside) for key, table in tables.items()}
    train, test_split = splits["train"], splits.get("test")
    notes: tuple[str, ...] = ()
    if test_split is None:
        train, test_split, spare, notes = _listed(files["train"], tables["train"], train)
        splits |= {"spare": spare} if len(spare) else {}
    points, point_file = _points(root, tables["train"])
    return Scene(
        name=root.name,
        root=root,
        format="transforms",
        train=train,
        test=test_split,
        points=points,
        files=(*files.values(), *([point_file] if point_file else [])),
        notes=notes,
        details={"tables": tables, "names": {key: file.name for key, file in files.items()}}
        | ({"spare": splits["spare"]} if "spare" in splits else {}),
    )


def _listed(file: Path, table: dict, frames: Split) -> tuple[Split, Split, Split, tuple[str, ...]]:
    """Training, test and validation split by nerfstudio's lists of file names, and notes.

    The test split is that of test_filenames or, where there is none, of val_filenames; the third is the other list
    without what is in the first two. Raises UserError for a name that no frame has, and for frames that are listed both
    for training and for testing, unless all test frames are: nerfstudio needs some to evaluate, and a capture without a
    test split lists training views.
    """
    none = frames.subset([])
    if not isinstance(table.get("train_filenames"), list):
        return frames, none, none, ()
    index = {name: i for i, name in enumerate(frames.names)}
    listed: dict[str, set[int]] = {}
    for key in ("train", "test", "val"):
        names = table.get(f"{key}_filenames") or []
        if not isinstance(names, list):
            raise UserError(f"'{file}': {key}_filenames is no list of names")
        unknown = [name for name in names if not isinstance(name, str) or name not in index]
        if unknown:
            raise UserError(f"'{file}': {key}_filenames names {unknown[0]!r}, which no frame has")
        listed[key] = {index[name] for name in names}
    train = listed["train"]
    test, spare = (listed["test"], listed["val"]) if listed["test"] else (listed["val"], set())
    if test and test <= train:
        return frames.subset(sorted(train)), none, frames.subset(sorted(spare - train)), ()
    both = train & test
    if both:
        raise UserError(f"'{file}': frame '{frames.names[min(both)]}' is listed for training and for testing")
    left = len(frames) - len(train | test | spare)
    notes = (f"{left} of {len(frames)} frames are in none of its lists and are left out",) if left else ()
    return frames.subset(sorted(train)), frames.subset(sorted(test)), frames.subset(sorted(spare - train - test)), notes


def _split(root: Path, file: Path, table: Any, allow_outside: bool) -> Split:
    if not isinstance(table, dict) or not isinstance(table.get("frames"), list):
        raise UserError(f"'{file}' has no list 'frames'; it should be a Blender or nerfstudio transforms file")
    rows, names, paths, poses, times = [], [], [], [], []
    sizes: dict[Path, tuple[int, int]] = {}
    lens = ""
    for number, frame in enumerate(table["frames"]):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise UserError(f"'{file}': frame {number} has no file_path")
        name = frame["file_path"]
        path = _image(root, name, file, allow_outside)
        camera = ChainMap(frame, table)  # a copy of a large table for each of many frames would take hours
        rows.append(_intrinsics(camera, name, path, file, sizes))
        lens = lens or _lens(camera)
        poses.append(_pose(frame, name, file))
        names.append(name)
        paths.append(path)
        times.append(frame.get("time"))
    values = np.array(rows, dtype=np.float64).reshape(-1, 11)
    cameras = Cameras(
        c2w=np.array(poses, dtype=np.float64).reshape(-1, 4, 4),
        fx=values[:, 0],
        fy=values[:, 1],
        cx=values[:, 2],
        cy=values[:, 3],
        width=values[:, 4].astype(np.int64),
        height=values[:, 5].astype(np.int64),
        distortion=values[:, 6:] if values[:, 6:].any() and not lens else None,
    )
    beside = (_beside(root, table["frames"], key) for key in COMPANIONS)
    masks, depths = (files if any(files) else () for files in beside)
    return Split(tuple(names), tuple(paths), cameras, times_of(times), lens, depths, masks)


def _beside(root: Path, frames: list[dict], key: str) -> tuple[Path | None, ...]:
    """The mask or depth image of each frame, where it is there."""
    named = (frame.get(key) for frame in frames)
    return tuple(root / name if isinstance(name, str) and is_file(root / name) else None for name in named)


def _lens(camera: Mapping[str, Any]) -> str:
    """The camera model where it is another one than OpenCV's with k1, k2, p1, p2, k3."""
    model = " ".join(str(camera.get("camera_model", "")).split())
    if model not in LENSES:
        return model
    if camera.get("is_fisheye"):  # instant-ngp's word for it
        return "OPENCV_FISHEYE"
    return "OPENCV with k4" if camera.get("k4") else ""


def _image(root: Path, name: str, file: Path, allow_outside: bool) -> Path:
    if "\0" in name:
        raise UserError(f"'{file}': file_path {name!r} is no name of a file; correct it")
    if leaves(name) and not allow_outside:
        raise UserError(
            f"'{file}': file_path '{name}' leaves the scene folder; give --allow-outside if that is meant, or set "
            "allow_outside = true for a scene of environment.toml"
        )
    path = root / name
    return next((found for end in ("", *SUFFIXES) if is_file(found := root / f"{name}{end}")), path)


def _pose(frame: dict, name: str, file: Path) -> np.ndarray:
    try:
        pose = np.array(frame["transform_matrix"], dtype=np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise UserError(f"'{file}': frame '{name}' has no transform_matrix of numbers") from None
    if pose.shape != (4, 4):
        raise UserError(f"'{file}': the transform_matrix of frame '{name}' is {pose.shape}, expected 4 x 4")
    return pose


def _intrinsics(
    table: Mapping[str, Any], name: str, path: Path, file: Path, sizes: dict[Path, tuple[int, int]]
) -> list[float]:
    try:
        width, height = (float(table[key]) if key in table else 0.0 for key in ("w", "h"))
        if not width or not height:
            # The first image stands for its folder: reading every head of a long capture takes minutes.
            if path.parent not in sizes:
                sizes[path.parent] = image_size(path)
            width, height = sizes[path.parent]
        if "fl_x" in table:
            fx = float(table["fl_x"])
            fy = float(table.get("fl_y", fx))
        elif "camera_angle_x" in table:
            fx = 0.5 * width / math.tan(0.5 * float(table["camera_angle_x"]))
            angle_y = table.get("camera_angle_y")
            fy = 0.5 * height / math.tan(0.5 * float(angle_y)) if angle_y is not None else fx
        else:
            raise UserError(f"'{file}': frame '{name}' has neither fl_x nor camera_angle_x")
        cx, cy = float(table.get("cx", width / 2)), float(table.get("cy", height / 2))
        lens = [float(table.get(key, 0.0)) for key in LENS]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise UserError(f"'{file}': the intrinsics of frame '{name}' are no numbers") from None
    if not (1 <= width <= limits.SIDE and 1 <= height <= limits.SIDE):
        raise UserError(f"'{file}': frame '{name}' is {width} x {height} pixels")
    return [fx, fy, cx, cy, width, height, *lens]


def _points(root: Path, table: dict) -> tuple[Points | None, Path | None]:
    from ..ply import read_points

    named = table.get("ply_file_path")
    candidates = ["points3d.ply", "points3D.ply", "sparse_pc.ply"]
    if isinstance(named, str):
        candidates.insert(0, named)
    for name in candidates:
        if not leaves(name) and is_file(root / name):
            return read_points(root / name), root / name
    return None, None
