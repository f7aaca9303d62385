"""Writes transforms.json for nerfstudio, and transforms_train/test.json in Blender's form."""

import math
import shutil
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...common.errors import UserError
from ...common.files import write_json
from ..companions import smaller
from ..image_files import is_file, leaves, stored_name
from ..subset import place_image
from ..types import Cameras, Scene, Split

SINGLE, TRAIN, TESTS = "transforms.json", "transforms_train.json", ("transforms_test.json", "transforms_val.json")
COMPANIONS = {"mask_path": "masks", "depth_file_path": "depths"}  # nerfstudio's other files of a frame
LENS = ("k1", "k2", "p1", "p2", "k3")  # in OpenCV's order
BLENDER = "blender"  # folder of the images as readers of Blender's form name them
OFF_CENTRE = 0.01  # of the picture: a principal point nearer to the middle is taken to be there
SQUARE = 0.005  # two focal lengths that differ by less are one
EVALUATED = 10  # nerfstudio's curves are of every 10th image where there is no test split


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> list[str]:
    """Writes what was read with fewer frames: a single transforms.json stays one, several files stay several.

    A scene that was read from this format keeps all its own keys and each frame's mask and depth; one from another
    format becomes a single transforms.json with its depth images and, where its cameras are what they can express, the
    two files of Blender's form beside it, which the 3DGS authors' code opens. In a single file nerfstudio's lists of
    file names tell the splits; without them it would leave out a tenth of the frames. Where there is no test split,
    some training frames are listed for its curves, and are trained on all the same. Points are written as points3d.ply.
    Returns notes for people.
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
    if own and names["train"] != SINGLE:
        for key, listed in frames.items():
            _write(out / names[key], {**head, **(own.get(key, {}) if key != "train" else {}), "frames": listed})
        return []
    every = [frame for listed in frames.values() for frame in listed]
    notes = [*([] if own else _without_bent_depths(every, splits)), *_without_gaps(every)]
    notes += _place_smaller(every, scene.root, out, copy) if own else []
    lists = {key: [frame["file_path"] for frame in listed] for key, listed in frames.items()}
    held = lists["test"] or lists["train"][::EVALUATED]
    lists = {"train_filenames": lists["train"], "val_filenames": lists.get("spare") or held, "test_filenames": held}
    _write(out / SINGLE, {**head, **lists, "frames": every})
    if own and not (scene.root / BLENDER).is_dir():
        return notes
    return [*notes, *_blender(frames, splits, head, out, copy)]


def _write(file: Path, table: dict[str, Any]) -> None:
    """Writes a file of transforms. Raises UserError for NaN in what is copied from the capture: JSON has none."""
    try:
        write_json(file, table)
    except (ValueError, RecursionError):
        raise UserError(
            f"the capture's transforms have NaN, infinity or lists too deep in a field that '{file.name}' would copy; "
            "take it out"
        ) from None


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
            for key, files in (("mask_path", split.masks), ("depth_file_path", split.depths)):
                if files and (file := files[i]) is not None and is_file(file):
                    frame[key] = f"{COMPANIONS[key]}/{PurePosixPath(name).with_suffix(file.suffix).as_posix()}"
                    place_image(file, out / frame[key], copy)
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


def _without_bent_depths(frames: list[dict[str, Any]], splits: Mapping[str, Split]) -> list[str]:
    """Takes depth images out where the lens has distortion, which nerfstudio takes out of the pictures alone."""
    bent = any(split.cameras.distortion is not None for split in splits.values())
    if not bent or not any("depth_file_path" in frame for frame in frames):
        return []
    for frame in frames:
        frame.pop("depth_file_path", None)
    return [
        f"depth images are written and not named in {SINGLE}: their lens has distortion, and readers leave it in them"
    ]


def _without_gaps(frames: list[dict[str, Any]]) -> list[str]:
    """Takes masks or depths out of all frames where some have none: nerfstudio refuses a file with gaps."""
    notes = []
    for key, what in (("mask_path", "masks"), ("depth_file_path", "depth images")):
        lacking = [frame["file_path"] for frame in frames if key not in frame]
        if lacking and len(lacking) < len(frames):
            for frame in frames:
                frame.pop(key, None)
            notes.append(
                f"{what} are written and not named in {SINGLE}: {len(lacking)} of {len(frames)} frames, "
                f"'{lacking[0]}' first, have none, and nerfstudio wants one for each or none"
            )
    return notes


def _place_smaller(frames: list[dict[str, Any]], root: Path, out: Path, copy: bool) -> list[str]:
    """Brings images_2 and the like of a capture that was in this format; notes what could not come."""
    listed = {"images": [frame["file_path"] for frame in frames]}
    for key, kind in COMPANIONS.items():
        listed[kind] = [frame[key] for frame in frames if isinstance(frame.get(key), str)]
    found, notes = smaller(root, listed)
    for source, place in found:
        place_image(source, out / place, copy)
    return notes


def _blender(
    frames: Mapping[str, list], splits: Mapping[str, Split], head: dict[str, Any], out: Path, copy: bool
) -> list[str]:
    """Writes the splits in Blender's form too, as the 3DGS authors' `readNerfSyntheticInfo` wants it.

    It adds ".png" to every file_path, whatever the file is, knows one angle for all, the principal point in the middle
    and no distortion (scene/dataset_readers.py, `readCamerasFromTransforms`). So the images have links that end so, and
    where the cameras say more than that nothing is written, and the note says why.
    """
    if "camera_angle_x" not in head:
        why = "its cameras differ"
    elif any(split.cameras.distortion is not None or split.lens for split in splits.values()):
        why = "its lens has distortion (convert --to colmap, then colmap image_undistorter)"
    elif max(abs(head["cx"] / head["w"] - 0.5), abs(head["cy"] / head["h"] - 0.5)) > OFF_CENTRE:
        why = "its principal point is not in the middle"
    elif abs(head["fl_y"] / head["fl_x"] - 1) > SQUARE:
        why = "its focal lengths differ"
    else:
        why = ""
    if why:
        return [f"the 3DGS authors' code, which reads Blender's form, cannot open it: {why}"]
    for key, file in (("train", TRAIN), ("test", TESTS[0])):
        listed = []
        for number, frame in enumerate(frames[key]):
            stored = PurePosixPath(frame["file_path"])
            place = f"{BLENDER}/{key}/{number:05d}_{stored.stem}"
            target = out / f"{place}.png"
            target.parent.mkdir(parents=True, exist_ok=True)
            if copy:
                _double(out / stored, target)
            else:
                target.symlink_to(Path("..", "..", stored))
            listed.append({"file_path": place, "transform_matrix": frame["transform_matrix"]})
        _write(out / file, {"camera_angle_x": head["camera_angle_x"], "frames": listed})
    return []


def _double(file: Path, target: Path) -> None:
    """The file under a second name: a hard link, or a copy where the file system has none."""
    try:
        target.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, target)


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
