"""transforms.json of Blender and nerfstudio: one file, or transforms_train/test/val.json (IndoorTraj, Replica)."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json, write_json
from ..image_files import image_size, is_file, leaves, stored_name
from ..subset import place_image
from ..types import Cameras, Points, Scene, Split

WRITABLE = True
SINGLE, TRAIN, TESTS = "transforms.json", "transforms_train.json", ("transforms_test.json", "transforms_val.json")
COMPANIONS = ("mask_path", "depth_file_path")  # nerfstudio's other files of a frame, which it insists on
LENS = ("k1", "k2", "p1", "p2", "k3")  # in OpenCV's order
LENSES = ("", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")  # camera_model, where it is named
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
    val_filenames) in a single transforms.json. Where both files are there, the second is kept for the writer.
    A file_path that leaves the folder is refused unless `allow_outside`.
    Raises UserError for files that are missing or not as documented.
    """
    if (root / SINGLE).is_file():
        files: dict[str, Path] = {"train": root / SINGLE}
    else:
        held = [root / name for name in TESTS if (root / name).is_file()]
        files = dict(zip(("train", "test", "spare"), [root / TRAIN, *held], strict=False))
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
        details={"tables": tables, "names": {key: file.name for key, file in files.items()}}
        | ({"spare": splits["spare"]} if "spare" in splits else {}),
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
    sizes: dict[Path, tuple[int, int]] = {}
    lens = ""
    for number, frame in enumerate(table["frames"]):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise UserError(f"'{file}': frame {number} has no file_path")
        name = frame["file_path"]
        path = _image(root, name, file, allow_outside)
        camera = {**table, **frame}
        rows.append(_intrinsics(camera, name, path, file, sizes))
        lens = lens or _lens(camera)
        poses.append(_pose(frame, name, file))
        names.append(name)
        paths.append(path)
        times.append(frame.get("time"))
    values = np.array(rows, dtype=np.float64).reshape(-1, 11)
    cameras = Cameras(
        c2w=np.array(poses, dtype=np.float64).reshape(-1, 4, 4),
        fx=values[:, 0],
        fy=values[:, 1],
        cx=values[:, 2],
        cy=values[:, 3],
        width=values[:, 4].astype(np.int64),
        height=values[:, 5].astype(np.int64),
        distortion=values[:, 6:] if values[:, 6:].any() and not lens else None,
    )
    return Split(tuple(names), tuple(paths), cameras, _times(times), lens)


def _times(values: list[Any]) -> np.ndarray | None:
    """(N,) seconds, or None unless every frame has a finite one."""
    if not values or not all(isinstance(value, (int, float)) for value in values):
        return None
    try:
        times = np.array(values, dtype=np.float64)
    except OverflowError:
        return None
    return times if np.isfinite(times).all() else None


def _lens(camera: dict) -> str:
    """The camera model where it is another one than OpenCV's with k1, k2, p1, p2, k3."""
    model = str(camera.get("camera_model", ""))
    if model not in LENSES:
        return model
    if camera.get("is_fisheye"):  # instant-ngp's word for it
        return "OPENCV_FISHEYE"
    return "OPENCV with k4" if camera.get("k4") else ""


def _image(root: Path, name: str, file: Path, allow_outside: bool) -> Path:
    if "\0" in name or (leaves(name) and not allow_outside):
        raise UserError(f"'{file}': file_path '{name}' leaves the scene folder; give --allow-outside if that is meant")
    path = root / name
    return next((found for end in ("", *SUFFIXES) if is_file(found := root / f"{name}{end}")), path)


def _pose(frame: dict, name: str, file: Path) -> np.ndarray:
    try:
        pose = np.array(frame["transform_matrix"], dtype=np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise UserError(f"'{file}': frame '{name}' has no transform_matrix of numbers") from None
    if pose.shape != (4, 4):
        raise UserError(f"'{file}': the transform_matrix of frame '{name}' is {pose.shape}, expected 4 x 4")
    return pose


def _intrinsics(table: dict, name: str, path: Path, file: Path, sizes: dict[Path, tuple[int, int]]) -> list[float]:
    try:
        width, height = (float(table[key]) if key in table else 0.0 for key in ("w", "h"))
        if not width or not height:
            # The first image stands for its folder: reading every head of a long capture takes minutes.
            if path.parent not in sizes:
                sizes[path.parent] = image_size(path)
            width, height = sizes[path.parent]
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
        lens = [float(table.get(key, 0.0)) for key in LENS]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise UserError(f"'{file}': the intrinsics of frame '{name}' are no numbers") from None
    if not (1 <= width <= 1e6 and 1 <= height <= 1e6):
        raise UserError(f"'{file}': frame '{name}' is {width} x {height} pixels")
    return [fx, fy, cx, cy, width, height, *lens]


def _points(root: Path, table: dict) -> tuple[Points | None, Path | None]:
    from ..ply import read_points

    named = table.get("ply_file_path")
    candidates = ["points3d.ply", "points3D.ply", "sparse_pc.ply"]
    if isinstance(named, str):
        candidates.insert(0, named)
    for name in candidates:
        if not leaves(name) and is_file(root / name):
            return read_points(root / name), root / name
    return None, None


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes what was read with fewer frames: a single transforms.json stays one, several files stay several.

    A scene that was read from this format keeps all its own keys and each frame's mask and depth; one from another
    format becomes transforms_train and transforms_test, or a single file where it has no test split. In a single file
    the test split, if any, stands in nerfstudio's lists of file names. Points are written as points3d.ply.
    """
    from ..ply import write_points

    details = scene.details if scene.format == "transforms" else {}
    own, names = details.get("tables", {}), {"train": TRAIN, "test": TESTS[0], **details.get("names", {})}
    head = {key: value for key, value in own.get("train", {}).items() if not key.endswith("_filenames")}
    splits = {"train": scene.train.subset(indices), "test": scene.test}
    splits |= {"spare": details["spare"]} if "spare" in details else {}
    if not own:
        head = _shared([splits["train"].cameras, scene.test.cameras])
    if scene.points is not None:
        write_points(out / "points3d.ply", scene.points)
        head["ply_file_path"] = "points3d.ply"
    frames, number = {}, 0
    for key, split in splits.items():
        frames[key] = _frames(split, own, head, number, scene.root, out, copy)
        number += len(split)
    held = frames["test"]
    if not (names["train"] == SINGLE if own else not held):
        for key, listed in frames.items():
            write_json(out / names[key], {**head, **(own.get(key, {}) if key != "train" else {}), "frames": listed})
        return
    lists = {}
    if held:
        held_names = [frame["file_path"] for frame in held]
        lists = {"train_filenames": [frame["file_path"] for frame in frames["train"]]}
        lists |= {"val_filenames": held_names, "test_filenames": held_names}
    write_json(out / SINGLE, {**head, **lists, "frames": frames["train"] + held})


def _frames(
    split: Split, own: dict[str, dict], head: dict[str, Any], number: int, root: Path, out: Path, copy: bool
) -> list[dict[str, Any]]:
    """The frames of a split as they are written, their images placed; outside paths come to images/."""
    known = {frame["file_path"]: frame for table in own.values() for frame in table["frames"]}
    made = []
    for i, (name, source) in enumerate(zip(split.names, split.paths, strict=True)):
        if name in known:
            frame = dict(known[name])
            stored = stored_name(name, source, number + i)
            if leaves(name):
                frame["file_path"] = stored
            _place_companions(frame, root, out, copy)
        else:
            stored = stored_name(f"images/{name}", source, number + i)
            camera = _camera(split.cameras[i])
            frame = {"file_path": stored, **{key: value for key, value in camera.items() if key not in head}}
            if split.times is not None:
                frame["time"] = float(split.times[i])
        place_image(source, out / stored, copy)
        made.append(frame)
    return made


def _place_companions(frame: dict[str, Any], root: Path, out: Path, copy: bool) -> None:
    """Mask and depth beside the image; frames may share one. What lies outside the folder is named in full."""
    for key in COMPANIONS:
        name = frame.get(key)
        if not isinstance(name, str) or not is_file(root / name):
            continue
        if leaves(name):
            frame[key] = str((root / name).resolve())
        elif not (out / name).exists():
            place_image(root / name, out / name, copy)


def _shared(groups: list[Cameras]) -> dict[str, Any]:
    """The intrinsics that all cameras have, with the angle that Blender-form readers want; nothing if they differ."""
    tables = [_camera(camera) for cameras in groups for camera in cameras]
    for table in tables:
        del table["transform_matrix"]
    if any(table != tables[0] for table in tables):
        return {}
    return {"camera_angle_x": 2 * math.atan(0.5 * tables[0]["w"] / tables[0]["fl_x"]), **tables[0]}


def _camera(camera: Cameras) -> dict[str, Any]:
    values = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    table: dict[str, Any] = {key: float(value[0]) for key, value in values.items()}
    table |= {"w": int(camera.width[0]), "h": int(camera.height[0])}
    if camera.distortion is not None:
        table |= {"camera_model": "OPENCV", **dict(zip(LENS, camera.distortion[0].tolist(), strict=True))}
    return {**table, "transform_matrix": camera.c2w[0].tolist()}
