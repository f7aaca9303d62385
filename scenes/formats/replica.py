"""Replica in the form of NICE-SLAM: traj.txt, results/frame*.jpg, and cam_params.json here or one folder up."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json
from ..types import Scene
from ._frames import by_number, matrix, numbers, split

WRITABLE = False
CAMERA = "cam_params.json"


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    posed = (root / "traj.txt").is_file() or (root / "poses").is_dir()
    return "it has results/ and a trajectory" if posed and (root / "results").is_dir() else None


def read(root: Path) -> Scene:
    """All frames, one pose of traj.txt (a row-major 4 x 4 camera-to-world matrix a line) or of poses/ for each.

    Raises UserError when there are more frames than poses or the other way round, and without camera parameters.
    """
    images = [path for path in by_number(root / "results", (".jpg", ".png")) if path.name.startswith("frame")]
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
    if len(poses) != len(images):
        raise UserError(f"'{root}' has {len(images)} frames and {len(poses)} poses; each frame needs its own")
    found = [folder / CAMERA for folder in (root, root.resolve().parent) if (folder / CAMERA).is_file()]
    if not found:
        raise UserError(f"'{root}' has no {CAMERA}, and neither has the folder above; copy it from the data set")
    camera = read_json(found[0], "camera parameters")
    try:
        values = [float(camera["camera"][key]) for key in ("fx", "fy", "cx", "cy")]
    except (KeyError, TypeError, ValueError):
        raise UserError(f"camera parameters '{found[0]}' lack fx, fy, cx or cy below 'camera'") from None
    # NICE-SLAM counts pixels from the centre of the first one.
    train = split(root, images, poses, (values[0], values[1]), (values[2] + 0.5, values[3] + 0.5))
    return Scene(
        name=root.name, root=root, format="replica", train=train, test=train.subset([]), files=(found[0], *files)
    )
