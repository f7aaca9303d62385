"""EuRoC MAV: mav0/ with one or two cameras of a rig, body poses from the state estimate, times in nanoseconds."""

import re
from pathlib import Path

import numpy as np

from ...common.bounded import quoted
from ...common.errors import UserError
from ..types import Cameras, Scene, Split
from ._frames import split
from ._intrinsics import Intrinsics, opencv
from ._text import lines
from ._timed import FARTHEST_S, Trajectory, poses_at, trajectory

WRITABLE = False
TRUTH = "state_groundtruth_estimate0"
NS = 1e-9
LENSES = {"radial-tangential": "", "radtan": "", "plumb_bob": "", "none": "", "equidistant": "OPENCV_FISHEYE"}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    folder = _folder(root)
    return f"it has {(folder / 'cam0').relative_to(root)}/data.csv" if folder else None


def _folder(root: Path) -> Path | None:
    """The folder that has cam0/ and cam1/: mav0/, or the one named."""
    return next((place for place in (root / "mav0", root) if (place / "cam0" / "data.csv").is_file()), None)


def read(root: Path) -> Scene:
    """The frames of cam0 and, where it is there, of cam1, as cam0/data/… and cam1/data/… in order of time.

    Poses of the body at 200 Hz are interpolated at the time of a frame (rotations along the shortest arc) and moved to
    the camera by T_BS of its sensor.yaml. Frames before the first, after the last, or more than 0.02 s from any of
    them are dropped and counted. Raises UserError for files that are not as the data set documents them.
    """
    folder = _folder(root)
    if folder is None:
        raise UserError(f"'{root}' has no mav0/cam0/data.csv")
    truth_file = folder / TRUTH / "data.csv"
    start, truth = _truth(truth_file)
    splits, files, notes = [], [truth_file], []
    for name in ("cam0", "cam1"):
        if not (folder / name / "data.csv").is_file():
            continue
        stamps, images = _frames(folder / name)
        sensor = folder / name / "sensor.yaml"
        camera, offset = _sensor(sensor)
        kept, poses = poses_at(truth, (stamps - start) * NS, outside=False)
        if not kept.all():
            notes.append(f"{name}: {int((~kept).sum())} of {len(kept)} frames dropped: no pose at their time")
        if not kept.any():
            raise UserError(f"'{folder / name}': no frame has a pose within {FARTHEST_S} s in '{truth_file}'")
        chosen = [path for path, good in zip(images, kept, strict=True) if good]
        splits.append(split(folder, chosen, poses @ offset, camera, stamps[kept] * NS))
        files += [folder / name / "data.csv", sensor]
    train = _merged(splits)
    if len(splits) > 1:
        notes.append(
            "two cameras on a rig: frames of one moment are neighbours in the order of the capture, so hold out "
            "blocks:8 (after every:8 the other eye of each test view is trained on)"
        )
    return Scene(
        name=root.name,
        root=root,
        format="euroc",
        train=train,
        test=train.subset([]),
        files=tuple(files),
        notes=tuple(notes),
    )


def _merged(splits: list[Split]) -> Split:
    """One split of all, by time; of frames of one time that of the first camera comes first."""
    arrays = {}
    lenses = [part.cameras.distortion for part in splits]
    for key in ("c2w", "fx", "fy", "cx", "cy", "width", "height"):
        arrays[key] = np.concatenate([getattr(part.cameras, key) for part in splits])
    distortion = None
    if any(lens is not None for lens in lenses):
        parts = zip(splits, lenses, strict=True)
        distortion = np.concatenate([np.zeros((len(part), 5)) if lens is None else lens for part, lens in parts])
    times = np.concatenate([part.times for part in splits if part.times is not None])
    every = Split(
        tuple(name for part in splits for name in part.names),
        tuple(path for part in splits for path in part.paths),
        Cameras(**arrays, distortion=distortion),
        times,
        next((part.lens for part in splits if part.lens), ""),
    )
    return every.subset(np.argsort(times, kind="stable"))


def _frames(folder: Path) -> tuple[np.ndarray, list[Path]]:
    """(N,) int64 nanoseconds and the images of data.csv, in order of time."""
    file = folder / "data.csv"
    rows = []
    for number, line in lines(file, "list of images"):
        stamp, _, name = (part.strip() for part in line.partition(","))
        if not stamp.isdecimal() or not name:
            if not rows and not re.match(r"\d", stamp):
                continue  # a heading without its '#'
            raise UserError(
                f"'{file}', line {number}: there should be nanoseconds and a file name, not {quoted(file, line)}"
            )
        if Path(name).name != name or name in ("..", ".") or "\0" in name:
            raise UserError(f"'{file}', line {number}: {quoted(file, name)} is no name of a file in data/")
        rows.append((_nanoseconds(stamp, file, number), folder / "data" / name))
    if not rows:
        raise UserError(f"'{file}' lists no images")
    rows.sort(key=lambda row: row[0])
    return np.array([stamp for stamp, _ in rows], dtype=np.int64), [path for _, path in rows]


def _nanoseconds(word: str, file: Path, number: int) -> int:
    if len(word) > 18 + 1 or int(word) >= 1 << 63:
        raise UserError(f"'{file}', line {number}: {quoted(file, word, 40)} is no time in nanoseconds")
    return int(word)


def _truth(file: Path) -> tuple[int, Trajectory]:
    """The first time in nanoseconds, and the poses of the body at seconds after it.

    Rows are timestamp, position x y z, quaternion w x y z, and what else the estimate has (velocity, biases). Whole
    numbers of 19 digits are subtracted before they become floats, which have 16.
    """
    if not file.is_file():
        raise UserError(f"'{file}' is not there: the sequence needs the state estimate of the ground truth")
    stamps, rows = [], []
    for number, line in lines(file, "ground truth"):
        words = [word.strip() for word in line.split(",")]
        try:
            row = [float(word) for word in words[1:8]]
            if not words[0].isdecimal() or len(row) != 7 or not np.isfinite(row).all() or not any(row[3:]):
                raise ValueError
        except ValueError:
            if not rows and not re.match(r"\d", line):
                continue
            raise UserError(
                f"ground truth '{file}', line {number}: expected nanoseconds, a position x,y,z and a quaternion w,x,y,z"
            ) from None
        stamps.append(_nanoseconds(words[0], file, number))
        rows.append(row)
    if not rows:
        raise UserError(f"ground truth '{file}' has no poses")
    values, start = np.array(rows), min(stamps)
    times = np.array([(stamp - start) * NS for stamp in stamps])
    return start, trajectory(times, values[:, :3], values[:, [4, 5, 6, 3]])


def _sensor(file: Path) -> tuple[Intrinsics, np.ndarray]:
    """The camera's intrinsics and T_BS, the (4, 4) transform from it to the body.

    The file is OpenCV's YAML, whose `%YAML:1.0` and tags other parsers refuse: the keys needed are looked for alone.
    """
    text = "\n".join(line.split("#")[0] for _, line in lines(file, "camera"))
    offset = _list(text, "T_BS", file)
    values = _list(text, "intrinsics", file)
    model = _word(text, "distortion_model") or "none"
    lens = _list(text, "distortion_coefficients", file) if model != "none" else []
    if len(offset) != 16 or len(values) != 4:
        raise UserError(f"camera '{file}' has {len(offset)} numbers in T_BS and {len(values)} intrinsics, not 16 and 4")
    transform = np.array(offset).reshape(4, 4)
    other = LENSES.get(model.lower(), model)
    if other or len(lens) > 5:
        camera = opencv(values, f"'{file}'")
        return Intrinsics(camera.fx, camera.fy, camera.cx, camera.cy, camera.source, model=other or model), transform
    lens = [*lens, *[0.0] * (5 - len(lens))]
    return opencv([*values, *lens], f"'{file}'"), transform


def _list(text: str, key: str, file: Path) -> list[float]:
    """The numbers of a key: [1, 2] over any number of lines, a list of "- 1", or an OpenCV matrix's `data`."""
    begin = re.search(rf"^[ \t]*{key}[ \t]*:", text, re.M)
    if not begin:
        raise UserError(f"camera '{file}' has no '{key}'")
    rest = text[begin.end() :].lstrip()
    if not rest.startswith(("[", "- ")) and (data := re.search(r"^data[ \t]*:", rest, re.M)):
        rest = rest[data.end() :].lstrip()
    words = _bracketed(rest).replace(",", " ").split() if rest.startswith("[") else _dashes(rest)
    try:
        return [float(word) for word in words]
    except ValueError:
        raise UserError(f"camera '{file}': '{key}' is no list of numbers") from None


def _bracketed(text: str) -> str:
    """What stands in the brackets that the text begins with, without those inside."""
    depth = 0
    for place, letter in enumerate(text):
        depth += {"[": 1, "]": -1}.get(letter, 0)
        if not depth:
            return text[:place].replace("[", " ").replace("]", " ")
    return text


def _dashes(text: str) -> list[str]:
    words = []
    for line in text.splitlines():
        if not line.lstrip().startswith("- "):
            break
        words.append(line.lstrip()[2:].strip())
    return words


def _word(text: str, key: str) -> str:
    found = re.search(rf"^[ \t]*{key}[ \t]*:[ \t]*(.*)$", text, re.M)
    return found[1].strip().strip("\"'") if found else ""
