"""ScanNet++: the DSLR pictures of a scene (dslr/), undistorted where they are, or those of the iPhone (iphone/)."""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json
from ..image_files import is_file, leaves
from ..types import OPENCV, Scene, Split
from ._frames import natural, split
from ._intrinsics import Intrinsics
from ._scannetpp import MILLIMETRE, PHONE, phone, points, pose, there

WRITABLE = False
TRANSFORMS = "nerfstudio"  # the folder of transforms.json
LISTS = "train_test_lists.json"


class Variant(NamedTuple):
    """Files of one kind of picture: the names that the data set and its toolkit give to the folders."""

    transforms: str
    images: tuple[str, ...]
    masks: tuple[str, ...]
    depth: str = ""


# github.com/scannetpp/scannetpp: common/scene_release.py, dslr/undistort.py and its configuration.
DSLR = (
    Variant(
        "transforms_undistorted.json",
        ("resized_undistorted_images", "undistorted_images"),
        ("resized_undistorted_masks", "undistorted_anon_masks"),
    ),
    Variant("transforms.json", ("resized_images",), ("resized_anon_masks",)),
)
IPHONE = (Variant("transforms.json", ("rgb",), ("rgb_masks",), "depth"),)


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    part = _part(root)
    return f"it has the {'DSLR' if part[0] == 'dslr' else 'iPhone'}'s pictures of ScanNet++" if part else None


def _part(root: Path) -> tuple[str, Path] | None:
    """Which part, dslr or iphone, and its folder: below a scene's, where the DSLR comes first, or the one named."""
    for name, variants in (("dslr", DSLR), ("iphone", IPHONE)):
        for folder in (root / name, root):
            listed = any((folder / TRANSFORMS / variant.transforms).is_file() for variant in variants)
            phone = name == "iphone" and (folder / PHONE).is_file()
            if phone or (listed and (folder != root or root.absolute().name == name or _is_dslr(folder))):
                return name, folder
    return None


def _is_dslr(folder: Path) -> bool:
    return any(_folder(folder, variant.images) for variant in DSLR)


def read(root: Path) -> Scene:
    """The pictures of the DSLR with the test views of the data set, or those of the iPhone, in order of their names.

    Undistorted pictures are taken where they and transforms_undistorted.json are there, else the fisheye ones, which
    can be chosen from and not trained on. Masks come along (black where a face or a name is hidden), depth with the
    iPhone's, and of dslr/colmap the points that two training views see.
    Test views are those of `test_frames` and of train_test_lists.json, wherever else they are listed: the toolkit's
    undistortion writes them among the training frames as well.
    Raises UserError for folders that are missing and files that are not as the toolkit writes them.
    """
    found = _part(root)
    if found is None:
        raise UserError(f"'{root}' has neither dslr/{TRANSFORMS}/transforms.json nor iphone/{PHONE} of ScanNet++")
    name, folder = found
    variants = DSLR if name == "dslr" else IPHONE
    listed = [variant for variant in variants if (folder / TRANSFORMS / variant.transforms).is_file()]
    pictured = [variant for variant in listed if _folder(folder, variant.images)]
    if not listed:
        return phone(root, folder)
    if not pictured:
        wanted = listed[0].images[0]
        raise UserError(f"'{folder}' has {TRANSFORMS}/{listed[0].transforms}, but no pictures in '{folder / wanted}'")
    variant = pictured[0]
    file = folder / TRANSFORMS / variant.transforms
    table = read_json(file, "transforms")
    frames, held = _listed(file, table, folder / LISTS)
    notes = []
    images = _folder(folder, variant.images)
    assert images is not None
    if held and not any(is_file(images / frame["file_path"]) for frame in held):
        notes.append(f"the {len(held)} test views are left out: the data set keeps their pictures to itself")
        held = []
    bad = sum(frame.get("is_bad") is True for frame in frames)
    if bad:
        notes.append(f"{bad} training views are marked is_bad by the data set (blurred, or with heavy shadows)")
    camera = _camera(file, table)
    if camera.model:
        notes.append(f"the pictures are {camera.model}: run dslr/undistort.py of the toolkit before training on them")
    masks = _folder(folder, variant.masks) if table.get("has_mask", True) else None
    if not frames:
        raise UserError(f"'{file}' has no training frame")
    train = _frames(root, images, frames, camera, masks, folder / variant.depth if variant.depth else None, file)
    size = (int(train.cameras.width[0]), int(train.cameras.height[0]))
    if "w" in table and "h" in table and (table["w"], table["h"]) != size:
        raise UserError(
            f"'{file}' is of pictures of {table['w']} x {table['h']}, but '{train.paths[0]}' is {size[0]} x {size[1]}; "
            "take those that it was made for"
        )
    test = _frames(root, images, held, camera, masks, None, file) if held else train.subset([])
    cloud, model_files, left_out = points(folder, train)
    if name == "dslr" and folder != root and _part(root / "iphone"):
        notes.append(f"only the DSLR's pictures are read; the iPhone's are the capture '{root / 'iphone'}'")
    return Scene(
        name=root.name,
        root=root,
        format="scannetpp",
        train=train,
        test=test,
        points=cloud,
        files=(file, *([folder / LISTS] if (folder / LISTS).is_file() else []), *model_files),
        notes=(*notes, *left_out),
        depth_unit=MILLIMETRE if train.depths else 0.0,
    )


def _folder(root: Path, names: tuple[str, ...]) -> Path | None:
    return next((root / name for name in names if (root / name).is_dir()), None)


def _listed(file: Path, table: Any, lists: Path) -> tuple[list[dict], list[dict]]:
    """Frames to train on and to test on, each in natural order of their names and named once."""
    if not isinstance(table, dict) or not isinstance(table.get("frames"), list):
        raise UserError(f"'{file}' has no list 'frames'; it should be the transforms file of ScanNet++")
    extra = table.get("test_frames") or []
    every: dict[str, dict] = {}
    for number, frame in enumerate([*table["frames"], *(extra if isinstance(extra, list) else [])]):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str) or leaves(frame["file_path"]):
            raise UserError(f"'{file}': frame {number} has no file_path that names a picture of the folder")
        every.setdefault(frame["file_path"], frame)
    held = {frame["file_path"] for frame in extra} if isinstance(extra, list) else set()
    if lists.is_file():
        own = read_json(lists, "lists of views")
        names = own.get("test") if isinstance(own, dict) else None
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise UserError(f"'{lists}' has no list 'test' of file names")
        held |= set(names)
    ordered = sorted(every.values(), key=lambda frame: natural(frame["file_path"]))
    return [f for f in ordered if f["file_path"] not in held], [f for f in ordered if f["file_path"] in held]


def _camera(file: Path, table: dict) -> Intrinsics:
    """The camera of all frames; pixels are counted as nerfstudio does, from the corner."""
    try:
        fx, fy, cx, cy = (float(table[key]) for key in ("fl_x", "fl_y", "cx", "cy"))
        lens = tuple(float(table.get(key) or 0.0) for key in ("k1", "k2", "p1", "p2", "k3"))
        last = float(table.get("k4") or 0.0)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise UserError(f"'{file}' lacks fl_x, fl_y, cx or cy, or one of them is no number") from None
    model = " ".join(str(table.get("camera_model", "PINHOLE")).split())
    model = "" if model in ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "RADIAL", "SIMPLE_RADIAL") else model
    if last and not model:
        model = "OPENCV with k4"
    return Intrinsics(fx, fy, cx, cy, f"'{file}'", (0.0,) * 5 if model else lens, model)


def _frames(
    root: Path, images: Path, frames: list[dict], camera: Intrinsics, masks: Path | None, depth: Path | None, file: Path
) -> Split:
    """Frames of one camera with their masks and depth images, where there are any."""
    poses = np.stack([pose(file, frame, "transform_matrix") for frame in frames])  # OpenGL axes, as we have them
    paths = [images / frame["file_path"] for frame in frames]
    depths = [there(depth, f"{path.stem}.png") for path in paths]
    made = split(root, paths, poses @ OPENCV, camera, depths=depths)
    named = [frame.get("mask_path") or f"{path.stem}.png" for frame, path in zip(frames, paths, strict=True)]
    hidden = tuple(there(masks, name) for name in named)
    return replace(made, masks=hidden if any(hidden) else ())
