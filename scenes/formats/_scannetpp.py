"""What ScanNet++ has beside its DSLR's pictures: points in the world of those, and the iPhone's frames by ARKit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json
from ..image_files import is_file, leaves
from ..splits import LEAST_TRACK
from ..types import Points, Scene, Split
from . import colmap
from ._frames import natural, split, times_of
from ._intrinsics import Intrinsics

PHONE = "pose_intrinsic_imu.json"
MILLIMETRE = 0.001  # iphone/depth, as the toolkit's prepare_iphone_data.py extracts it
ALIGNED = 1e-3  # largest deviation, in metres and sines, between the worlds of two files


def pose(file: Path, frame: dict, key: str) -> np.ndarray:
    """The (4, 4) matrix of a frame under `key`. Raises UserError for anything else."""
    try:
        return np.array(frame[key], dtype=np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError, OverflowError):
        name = frame.get("file_path", "?")
        raise UserError(f"'{file}': frame '{name}' has no {key} of 4 x 4 numbers") from None


def there(folder: Path | None, name: Any) -> Path | None:
    """The file of that name in the folder, or None."""
    if folder is None or not isinstance(name, str) or leaves(name):
        return None
    return folder / name if is_file(folder / name) else None


def points(folder: Path, train: Split) -> tuple[Points | None, tuple[Path, ...], list[str]]:
    """The points of folder/colmap that two training views see, in the world of transforms.json, and what was read.

    nerfstudio turns the world of the COLMAP model; the frames that both have tell how.
    """
    if colmap.detect(folder / "colmap") is None:
        return None, (), []
    try:
        model = colmap.read(folder / "colmap")
    except UserError as error:
        return None, (), [f"its points are left out: {error}"]
    if model.points is None or model.points.seen_by is None:
        return None, (), []
    place = {path.name: i for i, path in enumerate(train.paths)}
    indices = [place.get(name.rsplit("/", 1)[-1], -1) for name in model.train.names]
    common = [(i, j) for i, j in enumerate(indices) if j >= 0]
    if not common:
        return None, (), ["its points are left out: colmap/ has none of the training views"]
    ours, theirs = train.cameras.c2w[[j for _, j in common]], model.train.cameras.c2w[[i for i, _ in common]]
    worlds = ours @ np.linalg.inv(theirs)
    if not np.abs(worlds - worlds[0]).max() <= ALIGNED * max(1.0, np.ptp(ours[:, :3, 3], axis=0).max()):
        return None, (), ["its points are left out: colmap/ and transforms.json have different poses"]
    seen = [np.array(sorted({indices[i] for i in views} - {-1}), np.int64) for views in model.points.seen_by]
    kept = [i for i, views in enumerate(seen) if len(views) >= LEAST_TRACK]
    xyz = model.points.xyz[kept] @ worlds[0][:3, :3].T + worlds[0][:3, 3]
    return Points(xyz, model.points.rgb[kept], tuple(seen[i] for i in kept)), model.files, []


def phone(root: Path, folder: Path) -> Scene:
    """The iPhone's frames of rgb/ by ARKit's poses in the scene's world, each with intrinsics of its own."""
    file = folder / PHONE
    table = read_json(file, "poses")
    if not isinstance(table, dict) or not all(isinstance(frame, dict) for frame in table.values()):
        raise UserError(f"'{file}' should have an object with a frame under each name")
    every = sorted(table, key=natural)
    names = [name for name in every if not leaves(name) and is_file(folder / "rgb" / f"{name}.jpg")]
    if not names:
        raise UserError(f"'{folder / 'rgb'}' has no pictures; extract them by iphone/prepare_iphone_data.py")
    paths = [folder / "rgb" / f"{name}.jpg" for name in names]
    rows = [{**table[name], "file_path": name} for name in names]
    poses = np.stack([pose(file, row, "aligned_pose") for row in rows])
    try:
        k = np.array([row["intrinsic"] for row in rows], dtype=np.float64).reshape(len(rows), 3, 3)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise UserError(f"'{file}': a frame has no intrinsic of 3 x 3 numbers") from None
    first = Intrinsics(k[0, 0, 0], k[0, 1, 1], k[0, 0, 2], k[0, 1, 2], f"'{file}'")
    depths = [there(folder / "depth", f"{name}.png") for name in names]
    made = split(root, paths, poses, first, depths=depths)
    cameras = replace(made.cameras, fx=k[:, 0, 0], fy=k[:, 1, 1], cx=k[:, 0, 2], cy=k[:, 1, 2])
    masks = tuple(there(folder / "rgb_masks", f"{name}.png") for name in names)
    stamps = times_of([row.get("timestamp") for row in rows])
    train = replace(made, cameras=cameras, times=stamps, masks=masks if any(masks) else ())
    dropped = len(every) - len(names)
    return Scene(
        name=root.name,
        root=root,
        format="scannetpp",
        train=train,
        test=train.subset([]),
        files=(file,),
        notes=(f"{dropped} of {len(every)} frames have no picture in rgb/ and are left out",) if dropped else (),
        depth_unit=MILLIMETRE if train.depths else 0.0,
    )
