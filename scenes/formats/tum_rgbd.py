"""TUM RGB-D: rgb.txt and groundtruth.txt, frames and poses matched by time."""

from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..types import Scene
from ._frames import numbers, split

WRITABLE = False
FARTHEST_S = 0.02  # between a frame and its pose, as the data set's own tools
CAMERA = "camera.txt"
# fx, fy, cx, cy and OpenCV's k1, k2, p1, p2, k3 that the data set publishes for its three cameras.
CAMERAS = {
    "freiburg1": (517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
    "freiburg2": (520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
    "freiburg3": (535.4, 539.2, 320.1, 247.6, 0.0, 0.0, 0.0, 0.0, 0.0),
}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    return "it has rgb.txt and groundtruth.txt" if _complete(root) else None


def _complete(root: Path) -> bool:
    return all((root / name).is_file() for name in ("rgb.txt", "groundtruth.txt"))


def read(root: Path) -> Scene:
    """Frames of rgb.txt that have a pose within 0.02 s, the nearest one; the others are dropped and counted.

    Raises UserError when no frame has a pose, and for a camera that neither the folder's name nor camera.txt
    (fx fy cx cy, then k1 k2 p1 p2 k3 if there are any) tells.
    """
    stamps, paths = _listed(root)
    truth = numbers(root / "groundtruth.txt", "trajectory")
    if truth.shape[1] != 8:
        raise UserError(f"trajectory '{root / 'groundtruth.txt'}' has {truth.shape[1]} numbers a line, expected 8")
    truth = truth[np.argsort(truth[:, 0], kind="stable")]
    after = np.minimum(np.searchsorted(truth[:, 0], stamps), len(truth) - 1)
    before = np.maximum(after - 1, 0)
    match = np.where(np.abs(truth[before, 0] - stamps) <= np.abs(truth[after, 0] - stamps), before, after)
    kept = np.abs(truth[match, 0] - stamps) <= FARTHEST_S
    if not kept.any():
        raise UserError(f"'{root}': no frame of rgb.txt has a pose within {FARTHEST_S} s in groundtruth.txt")
    values = _camera(root)
    chosen = [path for path, good in zip(paths, kept, strict=True) if good]
    poses = _poses(truth[match[kept], 1:], root / "groundtruth.txt")
    lost = int((~kept).sum())
    # Published principal points count from the centre of the first pixel.
    fx, fy, cx, cy = values[:4]
    train = split(root, chosen, poses, (fx, fy), (cx + 0.5, cy + 0.5), stamps[kept], values[4:])
    camera = (root / CAMERA,) if (root / CAMERA).is_file() else ()
    return Scene(
        name=root.name,
        root=root,
        format="tum-rgbd",
        train=train,
        test=train.subset([]),
        files=(root / "rgb.txt", root / "groundtruth.txt", *camera),
        details={"assumed": repr(values)},
        notes=(f"{lost} of {len(paths)} frames dropped: no pose within {FARTHEST_S} s",) if lost else (),
    )


def _listed(root: Path) -> tuple[np.ndarray, list[Path]]:
    file = root / "rgb.txt"
    try:
        lines = [line.split(maxsplit=1) for line in file.read_text(encoding="utf-8").splitlines()]
        rows = [(float(line[0]), line[1].strip()) for line in lines if line and not line[0].startswith("#")]
    except (ValueError, IndexError, UnicodeDecodeError, OSError):
        raise UserError(f"'{file}' should have a time and a file name on each line") from None
    if not rows:
        raise UserError(f"'{file}' lists no frames")
    for _, name in rows:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise UserError(f"'{file}': '{name}' leaves the scene folder")
    stamps = np.array([stamp for stamp, _ in rows])
    if not np.isfinite(stamps).all():
        raise UserError(f"'{file}' has a time that is no number")
    order = np.argsort(stamps, kind="stable")
    return stamps[order], [root / rows[i][1] for i in order]


def _poses(rows: np.ndarray, file: Path) -> np.ndarray:
    """(N, 4, 4) camera-to-world of rows tx ty tz qx qy qz qw. Raises UserError for a quaternion of length 0."""
    x, y, z, w = rows[:, 3:].T
    length = np.sqrt(x * x + y * y + z * z + w * w)
    if not (length > 0).all():
        raise UserError(f"trajectory '{file}' has a rotation that is no quaternion")
    x, y, z, w = x / length, y / length, z / length, w / length
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = np.array(turn).transpose(2, 0, 1)
    poses[:, :3, 3] = rows[:, :3]
    return poses


def _camera(root: Path) -> tuple[float, ...]:
    if (root / CAMERA).is_file():
        values = numbers(root / CAMERA, "intrinsics").ravel().tolist()
        if len(values) not in (4, 8, 9):
            raise UserError(f"intrinsics '{root / CAMERA}' have {len(values)} numbers, expected 4, 8 or 9")
        return tuple(values + [0.0] * (9 - len(values)))
    name = root.resolve().name
    for camera, known in CAMERAS.items():
        if camera in name:
            return known
    raise UserError(f"the camera of '{root}' is not known: write fx fy cx cy [k1 k2 p1 p2 [k3]] into '{root / CAMERA}'")
