"""TUM RGB-D: rgb.txt, depth.txt and groundtruth.txt; frames, depth and poses are matched by time."""

import re
from pathlib import Path

import numpy as np

from ...common.bounded import quoted
from ...common.errors import UserError
from ..image_files import is_file
from ..types import Scene
from ._frames import split
from ._intrinsics import CAMERA, FORM, Intrinsics, camera_file, opencv, read_camera
from ._text import lines
from ._timed import FARTHEST_S, associate, nearest, read_tum, seconds

WRITABLE = False
DEPTH_UNIT = 1 / 5000  # metres, as the data set documents
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

    Depth images come along where depth.txt has one within 0.02 s of the frame, matched as associate.py of the data set
    does, which goes over all frames of rgb.txt and uses none twice.
    Raises UserError when no frame has a pose, and for a camera that neither the folder's name nor camera.txt
    (fx fy cx cy, then k1 k2 p1 p2 k3 if there are any) tells.
    """
    stamps, paths = _listed(root, "rgb.txt")
    truth, _ = read_tum(root / "groundtruth.txt")
    match = nearest(truth.times, stamps)
    kept = np.abs(truth.times[match] - stamps) <= FARTHEST_S
    if not kept.any():
        raise UserError(f"'{root}': no frame of rgb.txt has a pose within {FARTHEST_S} s in groundtruth.txt")
    lost = int((~kept).sum())
    notes = [f"{lost} of {len(paths)} frames dropped: no pose within {FARTHEST_S} s"] if lost else []
    file, camera = camera_file(root), _camera(root)
    chosen = [path for path, good in zip(paths, kept, strict=True) if good]
    depths, listed = _depths(root, stamps, kept, notes)
    train = split(root, chosen, truth.poses[match[kept]], camera, stamps[kept], depths)
    if train.depths and train.cameras.distortion is not None:
        notes.append("depth images are distorted as the pictures are (nerfstudio corrects the pictures alone)")
    return Scene(
        name=root.name,
        root=root,
        format="tum-rgbd",
        train=train,
        test=train.subset([]),
        files=(root / "rgb.txt", root / "groundtruth.txt", *listed, *([file] if file else [])),
        details={"assumed": repr((camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5, *camera.lens))},
        notes=tuple(notes),
        depth_unit=DEPTH_UNIT if train.depths else 0.0,
    )


def _listed(root: Path, name: str) -> tuple[np.ndarray, list[Path]]:
    """Times in seconds and files of a list, in order of time; of a time that is listed twice the last file counts."""
    file = root / name
    rows: dict[float, str] = {}
    for number, line in lines(file, "list"):
        stamp, *rest = re.split(r"[\s,]+", line, maxsplit=1)
        image = rest[0] if rest else ""
        try:
            time = float(stamp)
        except ValueError:
            time = np.nan
        if not image or not np.isfinite(time):
            if not rows and not any(character.isdigit() for character in stamp):
                continue  # a heading
            raise UserError(
                f"'{file}', line {number}: there should be a time and a file name, not {quoted(file, line)}"
            )
        if Path(image).is_absolute() or ".." in Path(image).parts or "\0" in image:
            raise UserError(f"'{file}', line {number}: {quoted(file, image)} leaves the scene folder")
        rows[time] = image
    if not rows:
        raise UserError(f"'{file}' lists no frames")
    return seconds(np.array(sorted(rows))), [root / rows[stamp] for stamp in sorted(rows)]


def _depths(
    root: Path, stamps: np.ndarray, kept: np.ndarray, notes: list[str]
) -> tuple[list[Path | None], tuple[Path, ...]]:
    """The depth image of each kept frame, and the list that says so; nothing where there is none."""
    if not (root / "depth.txt").is_file():
        return [], ()
    times, paths = _listed(root, "depth.txt")
    partner = associate(stamps, times)
    found = [None if j is None else paths[j] for j, good in zip(partner, kept, strict=True) if good]
    here = [path if path is not None and is_file(path) else None for path in found]
    if not any(here):
        notes.append("depth images are left out: those that depth.txt names within 0.02 s of a frame are not there")
        return [], ()
    if not all(here):
        notes.append(f"{here.count(None)} of {len(here)} frames have no depth image within {FARTHEST_S} s")
    return here, (root / "depth.txt",)


def _camera(root: Path) -> Intrinsics:
    file = camera_file(root)
    if file:
        return read_camera(file)
    for camera, known in CAMERAS.items():
        if camera in root.absolute().name or camera in root.resolve().name:
            return opencv(known, f"published for {camera} (write others into '{root / CAMERA}')")
    raise UserError(f"the camera of '{root}' is not known: write {FORM} into '{root / CAMERA}'")
