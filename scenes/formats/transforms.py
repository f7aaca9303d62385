"""transforms.json of Blender and nerfstudio: one file, or transforms_train/test/val.json (IndoorTraj, Replica)."""

import math
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from viewbench.common.errors import UserError
from viewbench.common.files import read_json, write_json
from viewbench.scenes.subset import place_image
from viewbench.scenes.types import Cameras, Points, Scene, Split

WRITABLE = True
SINGLE, TRAIN, TESTS = "transforms.json", "transforms_train.json", ("transforms_test.json", "transforms_val.json")
SUFFIXES = (".png", ".jpg", ".jpeg", ".JPG", ".PNG")  # tried in turn where file_path has none, as Blender's has not


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    for name in (SINGLE, TRAIN):
        if (root / name).is_file():
            return f"it has {name}"
    return None


def read(root: Path, allow_outside: bool = False) -> Scene:
    """Reads both splits, poses as they stand (they are camera-to-world with OpenGL axes already) and points.

    The test split is that of transforms_test.json (or transforms_val.json), or of nerfstudio's test_filenames (or
    val_filenames) in a single transforms.json. A file_path that leaves the folder is refused unless `allow_outside`.
    Raises UserError for files that are missing or not as documented.
    """
    if (root / SINGLE).is_file():
        files = {"train": root / SINGLE}
    else:
        test = next((root / name for name in TESTS if (root / name).is_file()), None)
        files = {"train": root / TRAIN} | ({"test": test} if test else {})
    tables = {key: read_json(file, "transforms") for key, file in files.items()}
    splits = {key: _split(root, files[key], table, allow_outside) for key, table in tables.items()}
    train, test_split = splits["train"], splits.get("test")
    if test_split is None:
        train, test_split = _listed(files["train"], tables["train"], train)
    points, point_file = _points(root, tables["train"])
    return Scene(
        name=root.name,
        root=root,
        format="transforms",
        train=train,
        test=test_split,
        points=points,
        files=(*files.values(), *([point_file] if point_file else [])),
        details={"tables": tables},
    )


def _listed(file: Path, table: dict, frames: Split) -> tuple[Split, Split]:
    """Both splits by nerfstudio's lists of file names. Raises UserError for a name that no frame has."""
    if not isinstance(table.get("train_filenames"), list):
        return frames, frames.subset([])
    index = {name: i for i, name in enumerate(frames.names)}
    chosen = []
    for key in ("train_filenames", "test_filenames" if table.get("test_filenames") else "val_filenames"):
        listed = table.get(key) or []
        unknown = [name for name in listed if not isinstance(name, str) or name not in index]
        if unknown:
            raise UserError(f"'{file}': {key} names {unknown[0]!r}, which no frame has")
        chosen.append(sorted({index[name] for name in listed}))
    both = set(chosen[0]) & set(chosen[1])
    if both:
        raise UserError(f"'{file}': frame '{frames.names[min(both)]}' is listed for training and for testing")
    return frames.subset(chosen[0]), frames.subset(chosen[1])


def _split(root: Path, file: Path, table: Any, allow_outside: bool) -> Split:
    if not isinstance(table, dict) or not isinstance(table.get("frames"), list):
        raise UserError(f"'{file}' has no list 'frames'; it should be a Blender or nerfstudio transforms file")
    rows, names, paths, poses, times = [], [], [], [], []
    sizes: dict[str, tuple[int, int]] = {}
    for number, frame in enumerate(table["frames"]):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise UserError(f"'{file}': frame {number} has no file_path")
        name = frame["file_path"]
        path = _image(root, name, file, allow_outside)
        rows.append(_intrinsics({**table, **frame}, name, path, file, sizes))
        poses.append(_pose(frame, name, file))
        names.append(name)
        paths.append(path)
        times.append(frame.get("time"))
    values = np.array(rows, dtype=np.float64).reshape(-1, 10)
    cameras = Cameras(
        c2w=np.array(poses, dtype=np.float64).reshape(-1, 4, 4),
        fx=values[:, 0],
        fy=values[:, 1],
        cx=values[:, 2],
        cy=values[:, 3],
        width=values[:, 4].astype(np.int64),
        height=values[:, 5].astype(np.int64),
        distortion=values[:, 6:] if values[:, 6:].any() else None,
    )
    timed = times and all(isinstance(time, (int, float)) for time in times)
    return Split(tuple(names), tuple(paths), cameras, np.array(times, dtype=np.float64) if timed else None)


def _leaves(name: str) -> bool:
    pure = PurePosixPath(name)
    return pure.is_absolute() or ".." in pure.parts


def _image(root: Path, name: str, file: Path, allow_outside: bool) -> Path:
    pure = PurePosixPath(name)
    if "\0" in name or (_leaves(name) and not allow_outside):
        raise UserError(f"'{file}': file_path '{name}' leaves the scene folder; give --allow-outside if that is meant")
    path = root / pure
    if path.is_file() or pure.suffix:
        return path
    return next(
        (path.with_name(path.name + end) for end in SUFFIXES if path.with_name(path.name + end).is_file()), path
    )


def _pose(frame: dict, name: str, file: Path) -> np.ndarray:
    try:
        pose = np.array(frame["transform_matrix"], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"'{file}': frame '{name}' has no transform_matrix of numbers") from None
    if pose.shape != (4, 4):
        raise UserError(f"'{file}': the transform_matrix of frame '{name}' is {pose.shape}, expected 4 x 4")
    return pose


def _intrinsics(table: dict, name: str, path: Path, file: Path, sizes: dict[str, tuple[int, int]]) -> list[float]:
    try:
        width, height = (float(table[key]) if key in table else 0.0 for key in ("w", "h"))
        if not width or not height:
            width, height = _size(path, sizes)
        if "fl_x" in table:
            fx = float(table["fl_x"])
            fy = float(table.get("fl_y", fx))
        elif "camera_angle_x" in table:
            fx = 0.5 * width / math.tan(0.5 * float(table["camera_angle_x"]))
            angle_y = table.get("camera_angle_y")
            fy = 0.5 * height / math.tan(0.5 * float(angle_y)) if angle_y is not None else fx
        else:
            raise UserError(f"'{file}': frame '{name}' has neither fl_x nor camera_angle_x")
        cx, cy = float(table.get("cx", width / 2)), float(table.get("cy", height / 2))
        lens = [float(table.get(key, 0.0)) for key in ("k1", "k2", "p1", "p2")]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise UserError(f"'{file}': the intrinsics of frame '{name}' are no numbers") from None
    if not (1 <= width <= 1e6 and 1 <= height <= 1e6):
        raise UserError(f"'{file}': frame '{name}' is {width} x {height} pixels")
    return [fx, fy, cx, cy, width, height, *lens]


def _size(path: Path, sizes: dict[str, tuple[int, int]]) -> tuple[int, int]:
    """Size of the first image stands for its folder: reading every header of a long capture takes minutes."""
    from PIL import Image

    folder = str(path.parent)
    if folder not in sizes:
        try:
            with Image.open(path) as image:
                sizes[folder] = image.size
        except FileNotFoundError:
            raise UserError(f"image '{path}' is missing") from None
        except (OSError, SyntaxError) as error:
            raise UserError(f"image '{path}' cannot be read: {error}") from None
    return sizes[folder]


def _points(root: Path, table: dict) -> tuple[Points | None, Path | None]:
    from viewbench.scenes.ply import read_points

    named = table.get("ply_file_path")
    candidates = ["points3d.ply", "points3D.ply", "sparse_pc.ply"]
    if isinstance(named, str):
        candidates.insert(0, named)
    for name in candidates:
        pure = PurePosixPath(name)
        if (root / pure).is_file() and not pure.is_absolute() and ".." not in pure.parts:
            return read_points(root / pure), root / pure
    return None, None


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes what was read with fewer frames: a single transforms.json stays one, two files stay two.

    A scene that was read from this format keeps all its own keys; one from another format becomes transforms_train and
    transforms_test, or a single file where it has no test split. In a single file the test split, if any, stands in
    nerfstudio's lists of file names. Points are written as points3d.ply.
    """
    from viewbench.scenes.ply import write_points

    own = scene.details["tables"] if scene.format == "transforms" else {}
    head = {key: value for key, value in own.get("train", {}).items() if not key.endswith("_filenames")}
    if scene.points is not None:
        write_points(out / "points3d.ply", scene.points)
        head["ply_file_path"] = "points3d.ply"
    frames = _frames(scene.train.subset(indices), own, out, copy)
    held = _frames(scene.test, own, out, copy)
    single = (scene.root / SINGLE).is_file() if own else not held
    if not single:
        write_json(out / TRAIN, {**head, "frames": frames})
        write_json(out / TESTS[0], {**head, **own.get("test", {}), "frames": held})
        return
    lists = {}
    if held:
        names = [frame["file_path"] for frame in held]
        lists = {"train_filenames": [frame["file_path"] for frame in frames]}
        lists |= {"val_filenames": names, "test_filenames": names}
    write_json(out / SINGLE, {**head, **lists, "frames": frames + held})


def _frames(split: Split, own: dict[str, dict], out: Path, copy: bool) -> list[dict[str, Any]]:
    """The frames of a split as they are written, their images placed; outside paths come to images/."""
    known = {frame["file_path"]: frame for table in own.values() for frame in table["frames"]}
    made = []
    for i, (name, source) in enumerate(zip(split.names, split.paths, strict=True)):
        if name in known:
            frame = dict(known[name])
            if _leaves(name):
                frame["file_path"] = f"images/{i:05d}_{source.name}"
        else:
            frame = _frame(split.cameras[i], f"images/{name}")
            if split.times is not None:
                frame["time"] = float(split.times[i])
        stored = PurePosixPath(frame["file_path"])
        place_image(source, out / (stored if stored.suffix else stored.with_name(stored.name + source.suffix)), copy)
        made.append(frame)
    return made


def _frame(camera: Cameras, file_path: str) -> dict[str, Any]:
    lens = [0.0] * 4 if camera.distortion is None else camera.distortion[0].tolist()
    values = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    frame: dict[str, Any] = {key: float(value[0]) for key, value in values.items()}
    frame |= {"w": int(camera.width[0]), "h": int(camera.height[0])}
    if any(lens):
        frame |= {"camera_model": "OPENCV", **dict(zip(("k1", "k2", "p1", "p2"), lens, strict=True))}
    return {"file_path": file_path, **frame, "transform_matrix": camera.c2w[0].tolist()}
