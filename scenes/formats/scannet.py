"""ScanNet as its exporter writes it: color/, depth/, pose/ (camera to world) and intrinsic/."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..image_files import image_size
from ..types import Scene
from ._frames import by_number, posed, split
from ._intrinsics import Intrinsics
from ._text import matrix

WRITABLE = False
DEPTH_UNIT = 0.001  # metres: depth images are in millimetres (nerfstudio's ScanNet parser has the same)
SAME_VIEW = 0.03  # of the image: depth whose camera looks elsewhere by more is not the colour picture's
SAME_PLACE = 0.005  # metres between two cameras that count as one


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    return "it has color/, pose/ and intrinsic/" if _complete(root) else None


def _complete(root: Path) -> bool:
    return all((root / name).is_dir() for name in ("color", "pose", "intrinsic"))


def read(root: Path) -> Scene:
    """All frames in numeric order; those without a pose file and those whose pose is infinite (tracking was lost) are
    dropped and counted.

    Depth images of the same number come along where the depth camera sees what the colour camera sees: they may be of
    another size (the exporter's are 640 x 480 beside 1296 x 968), since their readers stretch them over the picture.
    Raises UserError for files that are not as the exporter writes them.
    """
    images = by_number(root / "color", (".jpg", ".jpeg", ".png"))
    if not images:
        raise UserError(f"'{root / 'color'}' has no images; export the scan with its colour frames")
    files = [root / "pose" / f"{path.stem}.txt" for path in images]
    found, poses, notes = posed(images, files, root)
    camera_path = root / "intrinsic" / "intrinsic_color.txt"
    k = matrix(camera_path, "intrinsics")
    kept = [path for path, good in zip(images, found, strict=True) if good]
    depths = [root / "depth" / f"{path.stem}.png" for path in kept]
    here = [path if path.is_file() else None for path in depths]
    first = next((path for path in here if path), None)
    if first is not None:
        reason = _unregistered(root, k, image_size(kept[0]), image_size(first))
        notes += [f"depth images are left out: {reason}"] if reason else []
        here = [] if reason else here
    camera = Intrinsics(k[0, 0], k[1, 1], k[0, 2], k[1, 2], f"'{camera_path}'")
    train = split(root, kept, poses, camera, depths=here)
    if any(here) and not all(here):
        notes.append(f"{here.count(None)} of {len(here)} frames have no depth image")
    return Scene(
        name=root.name,
        root=root,
        format="scannet",
        train=train,
        test=train.subset([]),
        files=(camera_path, *(path for path, good in zip(files, found, strict=True) if good)),
        notes=tuple(notes),
        depth_unit=DEPTH_UNIT if any(here) else 0.0,
    )


def _unregistered(root: Path, colour: np.ndarray, size: tuple[int, int], depth_size: tuple[int, int]) -> str:
    """Why a depth image stretched over the picture would not fit it, or nothing.

    The two cameras' fields of view are compared, and their places where the exporter's extrinsics tell them.
    """
    folder = root / "intrinsic"
    if (folder / "intrinsic_depth.txt").is_file():
        depth = matrix(folder / "intrinsic_depth.txt", "intrinsics")
        views = [
            np.array([k[0, 0] / w, k[1, 1] / h, k[0, 2] / w, k[1, 2] / h])
            for k, (w, h) in ((colour, size), (depth, depth_size))
        ]
        # Where the picture's edges are, seen by either camera, in shares of the picture.
        edges = [np.abs((views[0][2:] - edge) / views[0][:2] * views[1][:2] + edge - views[1][2:]) for edge in (0, 1)]
        if not max(edge.max() for edge in edges) <= SAME_VIEW:
            return "the intrinsics in intrinsic_depth.txt are of another field of view than the colour pictures'"
    elif abs(size[0] / size[1] / (depth_size[0] / depth_size[1]) - 1) > SAME_VIEW:
        return f"they are {depth_size[0]} x {depth_size[1]} for pictures of {size[0]} x {size[1]}"
    extrinsics = [folder / f"extrinsic_{name}.txt" for name in ("color", "depth")]
    if all(path.is_file() for path in extrinsics):
        first, second = (matrix(path, "extrinsics") for path in extrinsics)
        if np.isfinite(first).all() and np.isfinite(second).all() and not np.allclose(first, second, atol=SAME_PLACE):
            return "extrinsic_depth.txt is not extrinsic_color.txt, so that depth is not registered to colour"
    return ""
