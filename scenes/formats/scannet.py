"""ScanNet as its exporter writes it: color/, pose/ (camera to world) and intrinsic/; depth/ is not read."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..types import Scene
from ._frames import by_number, matrix, split

WRITABLE = False


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    return "it has color/, pose/ and intrinsic/" if _complete(root) else None


def _complete(root: Path) -> bool:
    return all((root / name).is_dir() for name in ("color", "pose", "intrinsic"))


def read(root: Path) -> Scene:
    """All frames in numeric order; those whose tracking was lost (an infinite pose) are dropped and counted.

    Raises UserError for a frame without a pose file, and for files that are not as the exporter writes them.
    """
    images = by_number(root / "color", (".jpg", ".jpeg", ".png"))
    if not images:
        raise UserError(f"'{root / 'color'}' has no images; export the scan with its colour frames")
    files = [root / "pose" / f"{path.stem}.txt" for path in images]
    poses = np.stack([matrix(path, "pose") for path in files])
    found = np.all(np.isfinite(poses), axis=(1, 2))
    if not found.any():
        raise UserError(f"'{root}': none of the {len(images)} frames has a finite pose")
    camera = root / "intrinsic" / "intrinsic_color.txt"
    k = matrix(camera, "intrinsics")
    kept = [path for path, good in zip(images, found, strict=True) if good]
    lost = int((~found).sum())
    train = split(root, kept, poses[found], (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]))
    return Scene(
        name=root.name,
        root=root,
        format="scannet",
        train=train,
        test=train.subset([]),
        files=(camera, *(path for path, good in zip(files, found, strict=True) if good)),
        notes=(f"{lost} of {len(images)} frames dropped: their pose is infinite (tracking was lost)",) if lost else (),
    )
