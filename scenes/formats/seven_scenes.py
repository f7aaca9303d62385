"""7-Scenes: seq-XX/frame-XXXXXX.color.png with .pose.txt, split by TrainSplit.txt and TestSplit.txt."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...common.bounded import quoted
from ...common.errors import UserError
from ..types import Scene, Split
from ._frames import by_number, posed, split
from ._intrinsics import CAMERA, Intrinsics, camera_file, read_camera
from ._text import lines, matrix

WRITABLE = False
# The data set has poses of its depth camera (focal length 585). Its colour camera is beside it, with a calibration that
# was never published; those who localise in these scenes take 525, the middle of the 640 x 480 picture, and this
# transform of another Kinect (LIRIS, https://projet.liris.cnrs.fr/voir/activities-dataset/kinect-calibration.html, as
# in datasets/setup_7scenes.py of github.com/nianticlabs/ace). It takes points, in metres, x right, y down, z forward.
COLOUR = Intrinsics(525.0, 525.0, 320.0, 240.0, f"of 7-Scenes (write others into {CAMERA})")
DEPTH_TO_COLOUR = np.array(
    [
        [9.9996518012567637e-01, 2.6765126468950343e-03, -7.9041012313000904e-03, -2.5558943178152542e-02],
        [-2.7409311281316700e-03, 9.9996302803027592e-01, -8.1504520778013286e-03, 1.0109636268061706e-04],
        [7.8819942130445332e-03, 8.1718328771890631e-03, 9.9993554558014031e-01, 2.0318321729487039e-03],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
TRANSFORM = "depth_to_color.txt"
COLOUR_SUFFIX, POSE_SUFFIX, DEPTH_SUFFIX = ".color.png", ".pose.txt", ".depth.png"


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    found = next(root.glob("*.pose.txt"), None) or next(root.glob("seq-*/*.pose.txt"), None) if root.is_dir() else None
    return f"it has {found.name}" if found else None


def read(root: Path) -> Scene:
    """The sequences that the split files name; all as training views where there are none.

    Poses are moved from the depth camera to the colour camera, whose intrinsics go with them. One's own calibration
    stands in camera.txt (fx fy cx cy [k1 k2 p1 p2 [k3]]) and depth_to_color.txt (4 x 4, depth camera to colour camera;
    the identity where the poses are the colour camera's). Depth images are of the depth camera and are left out.
    Frames without a finite pose are dropped and counted. Raises UserError for a sequence that is not there.
    """
    lists = {name: root / f"{name}Split.txt" for name in ("Train", "Test")}
    notes: list[str] = []
    folders = (root, root.parent) if root.name.startswith("seq-") else (root,)
    own = {"camera": camera_file(*folders), "transform": next(_present(folders, TRANSFORM), None)}
    camera = read_camera(own["camera"]) if own["camera"] else COLOUR
    transform = matrix(own["transform"], "transform") if own["transform"] else DEPTH_TO_COLOUR
    rigid = np.isfinite(transform).all() and transform[3].tolist() == [0, 0, 0, 1]
    if not rigid or not abs(np.linalg.det(transform[:3, :3]) - 1) <= 0.01:
        raise UserError(f"transform '{own['transform']}' is no rigid motion from the depth to the colour camera")
    if lists["Train"].is_file():
        train = _sequences(root, _named(root, lists["Train"]), camera, transform, notes)
        held = _named(root, lists["Test"]) if lists["Test"].is_file() else []
        test = _sequences(root, held, camera, transform, notes) if held else train.subset([])
    else:
        sequences = sorted(path for path in root.glob("seq-*") if path.is_dir()) or [root]
        train = _sequences(root, sequences, camera, transform, notes)
        test = train.subset([])
    every = (*train.paths, *test.paths)
    return Scene(
        name=root.name,
        root=root,
        format="seven-scenes",
        train=train,
        test=test,
        files=(
            *(path for path in (*lists.values(), *own.values()) if path and path.is_file()),
            *(_beside(path, POSE_SUFFIX) for path in every),
        ),
        notes=(*_assumed(own), *_depth_note(every), *notes),
        details={} if all(own.values()) else {"assumed": repr((replace(camera, source=""), transform.tolist()))},
    )


def _present(folders: tuple[Path, ...], name: str):
    return (folder / name for folder in folders if (folder / name).is_file())


def _assumed(own: dict[str, Path | None]) -> list[str]:
    notes = []
    if not own["camera"]:
        notes.append(f"intrinsics are the customary ones of the colour camera, 525, 320, 240; {CAMERA} would be read")
    if not own["transform"]:
        notes.append(
            "poses are moved from the depth camera to the colour camera by the calibration of another Kinect that ACE "
            f"uses; {TRANSFORM} would be read"
        )
    return notes


def _depth_note(paths: tuple[Path, ...]) -> list[str]:
    if not any(_beside(path, DEPTH_SUFFIX).is_file() for path in paths[:1]):
        return []
    return ["depth images are left out: they are of the depth camera and not registered to the colour pictures"]


def _beside(image: Path, suffix: str) -> Path:
    return image.with_name(image.name[: -len(COLOUR_SUFFIX)] + suffix)


def _named(root: Path, file: Path) -> list[Path]:
    """Folders of the lines "sequence3" of a split file."""
    folders = []
    for _, line in lines(file, "split"):
        number = re.search(r"\d+", line)
        folder = root / f"seq-{int(number[0]):02d}" if number and len(number[0]) < 10 else root / "?"
        if not folder.is_dir():
            raise UserError(f"'{file}' names {quoted(file, line)}, but '{root}' has no folder '{folder.name}'")
        folders.append(folder)
    return folders


def _sequences(root: Path, folders: list[Path], camera: Intrinsics, transform: np.ndarray, notes: list[str]) -> Split:
    images = [path for folder in folders for path in by_number(folder, (COLOUR_SUFFIX,))]
    if not images:
        raise UserError(f"'{root}' has no *{COLOUR_SUFFIX} beside its poses")
    found, poses, dropped = posed(images, [_beside(path, POSE_SUFFIX) for path in images], root)
    notes += dropped
    kept = [path for path, good in zip(images, found, strict=True) if good]
    return split(root, kept, _rigid(poses) @ np.linalg.inv(transform), camera)


def _rigid(poses: np.ndarray) -> np.ndarray:
    """The poses with the nearest rotation in place of one that was rounded on its way to the file."""
    u, _, vt = np.linalg.svd(poses[:, :3, :3])
    rounded = np.abs(u @ vt - poses[:, :3, :3]).max(axis=(1, 2)) < 0.01
    fixed = poses.copy()
    fixed[rounded, :3, :3] = (u @ vt)[rounded]
    return fixed
