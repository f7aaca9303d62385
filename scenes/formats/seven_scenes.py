"""7-Scenes: seq-XX/frame-XXXXXX.color.png with .pose.txt, split by TrainSplit.txt and TestSplit.txt."""

import re
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..types import Scene, Split
from ._frames import matrix, split

WRITABLE = False
FOCAL, CENTRE = 585.0, (320.0, 240.0)  # pixels, of the 640 x 480 pictures, as the data set says


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    found = next(root.glob("*.pose.txt"), None) or next(root.glob("seq-*/*.pose.txt"), None) if root.is_dir() else None
    return f"it has {found.name}" if found else None


def read(root: Path) -> Scene:
    """The sequences that the split files name; all as training views where there are none.

    Frames with a pose that is not finite are dropped and counted. Raises UserError for a sequence that is not there.
    """
    lists = {name: root / f"{name}Split.txt" for name in ("Train", "Test")}
    notes = [f"intrinsics are the data set's: focal length {FOCAL:g}, centre {CENTRE[0]:g}, {CENTRE[1]:g}"]
    if lists["Train"].is_file():
        train = _sequences(root, _named(root, lists["Train"]), notes)
        test = _sequences(root, _named(root, lists["Test"]), notes) if lists["Test"].is_file() else train.subset([])
    else:
        folders = sorted(path for path in root.glob("seq-*") if path.is_dir()) or [root]
        train = _sequences(root, folders, notes)
        test = train.subset([])
    poses = (path.with_name(path.name.replace(".color.png", ".pose.txt")) for path in (*train.paths, *test.paths))
    return Scene(
        name=root.name,
        root=root,
        format="seven-scenes",
        train=train,
        test=test,
        files=(*(path for path in lists.values() if path.is_file()), *poses),
        notes=tuple(notes),
    )


def _named(root: Path, file: Path) -> list[Path]:
    """Folders of the lines "sequence3" of a split file."""
    folders = []
    for line in file.read_text(encoding="utf-8", errors="replace").split():
        number = re.search(r"\d+", line)
        folder = root / f"seq-{int(number[0]):02d}" if number else root / "?"
        if not folder.is_dir():
            raise UserError(f"'{file}' names '{line}', but '{root}' has no folder '{folder.name}'")
        folders.append(folder)
    return folders


def _sequences(root: Path, folders: list[Path], notes: list[str]) -> Split:
    images = [path for folder in folders for path in sorted(folder.glob("*.color.png"))]
    if not images:
        raise UserError(f"'{root}' has no *.color.png beside its poses")
    files = [path.with_name(path.name.replace(".color.png", ".pose.txt")) for path in images]
    poses = np.stack([matrix(path, "pose") for path in files])
    found = np.all(np.isfinite(poses), axis=(1, 2))
    if not found.any():
        raise UserError(f"'{root}': none of the {len(images)} frames has a finite pose")
    if not found.all():
        notes.append(f"{int((~found).sum())} of {len(images)} frames dropped: their pose is not finite")
    kept = [path for path, good in zip(images, found, strict=True) if good]
    return split(root, kept, _rigid(poses[found]), (FOCAL, FOCAL), CENTRE)


def _rigid(poses: np.ndarray) -> np.ndarray:
    """The poses with the nearest rotation in place of one that was rounded on its way to the file."""
    u, _, vt = np.linalg.svd(poses[:, :3, :3])
    rounded = np.abs(u @ vt - poses[:, :3, :3]).max(axis=(1, 2)) < 0.01
    fixed = poses.copy()
    fixed[rounded, :3, :3] = (u @ vt)[rounded]
    return fixed
