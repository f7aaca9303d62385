"""Replica in the form of NICE-SLAM: traj.txt, results/frame*.jpg and depth*.png, and cam_params.json here or above."""

import re
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json
from ..image_files import image_size
from ..types import Scene
from ._frames import by_number, split
from ._intrinsics import Intrinsics
from ._text import matrix, numbers

WRITABLE = False
CAMERA = "cam_params.json"


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    posed = (root / "traj.txt").is_file() or (root / "poses").is_dir()
    return "it has results/ and a trajectory" if posed and (root / "results").is_dir() else None


def read(root: Path) -> Scene:
    """All frames, one pose of traj.txt (a row-major 4 x 4 camera-to-world matrix a line) or of poses/ for each.

    Where there are fewer frames than poses, the number in a frame's name is that of its pose. Depth images have the
    frame's number; 1 / `scale` of the camera parameters is their unit.
    Raises UserError when there are more frames than poses, for pictures that are not of the size that the camera
    parameters tell, and without these.
    """
    images = by_number(root / "results", (".jpg", ".jpeg", ".png"))
    images = [path for path in images if path.name.lower().startswith("frame")]
    if not images:
        raise UserError(f"'{root / 'results'}' has no frame*.jpg")
    if (root / "traj.txt").is_file():
        files = [root / "traj.txt"]
        table = numbers(files[0], "trajectory")
        if table.shape[1] != 16:
            raise UserError(f"trajectory '{files[0]}' has {table.shape[1]} numbers a line, expected 16")
        poses = table.reshape(-1, 4, 4)
    else:
        files = by_number(root / "poses", (".txt",))
        poses = np.stack([matrix(path, "pose") for path in files]) if files else np.zeros((0, 4, 4))
    notes = []
    if len(poses) != len(images):
        rows = _rows(images, [_number(path) for path in files] if len(files) == len(poses) else list(range(len(poses))))
        if rows is None:
            raise UserError(f"'{root}' has {len(images)} frames and {len(poses)} poses; each frame needs its own")
        notes.append(f"{len(images)} frames for {len(poses)} poses: matched by the numbers in the frames' names")
        poses = poses[rows]
    found = [folder / CAMERA for folder in (root, root.parent, root.resolve().parent) if (folder / CAMERA).is_file()]
    if not found:
        raise UserError(f"'{root}' has no {CAMERA}, and neither has the folder above; copy it from the data set")
    camera, unit = _camera(found[0], images[0])
    depths, unit = _depths(images, unit, notes)
    train = split(root, images, poses, camera, depths=depths)
    return Scene(
        name=root.name,
        root=root,
        format="replica",
        train=train,
        test=train.subset([]),
        files=(found[0], *files),
        notes=tuple(notes),
        depth_unit=unit if train.depths else 0.0,
    )


def _number(path: Path) -> int:
    found = re.findall(r"\d+", path.stem)
    return int(found[-1]) if found else -1


def _rows(images: list[Path], known: list[int]) -> list[int] | None:
    """The pose of each image by the number in its name; None where one has none."""
    row = {number: i for i, number in enumerate(known)}
    wanted = [_number(path) for path in images]
    return [row[number] for number in wanted] if all(number in row for number in wanted) else None


def _camera(file: Path, image: Path) -> tuple[Intrinsics, float]:
    """The intrinsics, and the metres that 1 in a depth image stands for (0 where the file does not say).

    NICE-SLAM counts pixels from the centre of the first one. Raises UserError for another size than the image's.
    """
    table = read_json(file, "camera parameters")
    try:
        camera = table["camera"]
        fx, fy, cx, cy = (float(camera[key]) for key in ("fx", "fy", "cx", "cy"))
        size = [int(camera[key]) for key in ("w", "h") if key in camera]
        scale = float(camera.get("scale", 0.0))
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        raise UserError(
            f"camera parameters '{file}' lack fx, fy, cx or cy below 'camera', or one is no number"
        ) from None
    found = image_size(image)
    if len(size) == 2 and tuple(size) != found:
        raise UserError(
            f"camera parameters '{file}' are of pictures of {size[0]} x {size[1]}, but '{image}' is "
            f"{found[0]} x {found[1]}; scale w, h, fx, fy, cx and cy, or take the original pictures"
        )
    unit = 1 / scale if np.isfinite(scale) and scale > 1e-9 else 0.0  # 1 / 5e-324 is infinite
    return Intrinsics(fx, fy, cx + 0.5, cy + 0.5, f"'{file}'"), unit


def _depths(images: list[Path], unit: float, notes: list[str]) -> tuple[list[Path | None], float]:
    """The depth image of each frame, and their unit; none, with a note, where the unit is not known."""
    named = (path.with_name(f"depth{path.stem[len('frame') :]}.png") for path in images)
    depths = [path if path.is_file() else None for path in named]
    if not any(depths):
        return [], 0.0
    if not unit:
        notes.append(f"depth images are left out: {CAMERA} has no 'scale'")
        return [], 0.0
    if not all(depths):
        notes.append(f"{depths.count(None)} of {len(depths)} frames have no depth image")
    return depths, unit
