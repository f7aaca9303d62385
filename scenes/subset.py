"""Writes the chosen part of a scene as a scene of a format, with selection.json beside it."""

import filecmp
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ..common import plugins
from ..common.errors import UserError
from ..common.files import sealed, whole_folder, write_json
from .image_files import check_whole, is_file
from .types import UNCALIBRATED, Scene


def write_subset(scene: Scene, selection: dict[str, Any], out: Path, copy: bool = False, force: bool = False) -> str:
    """Writes the chosen training views and the whole test split to the folder `out`; returns the format written.

    It is the one that was read or, where that is only read, transforms. Images are linked, or with `copy` copied. The
    folder appears only when all of it is written. Raises UserError for an image that is missing or cut short, and for
    a folder that exists and is not empty unless `force` replaces it.
    """
    written = scene.format if writable(plugins.load("scenes.formats", scene.format)) else "transforms"
    indices = np.asarray(selection["indices"], dtype=np.int64)
    if scene.format != "video":
        for path in (*scene.train.subset(indices).paths, *scene.test.paths):
            check_whole(path)
    write_scene(scene, indices, out, written, copy, force, selection)
    return written


def write_scene(
    scene: Scene,
    indices: np.ndarray,
    out: Path,
    format_name: str,
    copy: bool = False,
    force: bool = False,
    selection: dict[str, Any] | None = None,
) -> None:
    """Writes the training views at `indices` and the test split in the format `format_name`; as `write_subset`."""
    module = plugins.load("scenes.formats", format_name)
    if not writable(module):
        raise UserError(
            f"format '{format_name}' can be read and not written; write transforms or colmap (convert --to)"
        )
    if (scene.format == "video") != (format_name == "video"):
        raise UserError(
            f"scene '{scene.name}' is in format {scene.format}; a video, and nothing else, is written by --to video"
        )
    if not scene.posed and getattr(module, "POSED", True):
        raise UserError(f"scene '{scene.name}' has no poses, and format '{format_name}' needs them; run COLMAP on it")
    lens = scene.train.lens or scene.test.lens
    if lens == UNCALIBRATED and getattr(module, "POSED", True):
        raise UserError(
            f"the intrinsics of '{scene.name}' are not known, and {format_name} needs them: give --intrinsics "
            f"fx,fy,cx,cy, or write them into '{scene.root / 'camera.txt'}'"
        )
    if lens not in ("", UNCALIBRATED) and format_name != scene.format:
        raise UserError(f"scene '{scene.name}' has {lens} cameras, which only its own format tells; undistort it first")
    if out.exists() and (not out.is_dir() or any(out.iterdir())) and not force:
        raise UserError(f"'{out}' exists and is not empty; name another folder or give --force")
    if out.resolve() == scene.root.resolve() or scene.root.resolve().is_relative_to(out.resolve()):
        raise UserError(f"'{out}' holds the capture itself; name another folder")
    with whole_folder(out) as temporary:
        module.write(scene, indices, temporary, copy)
        if selection is not None:
            write_json(temporary / "selection.json", sealed({**selection, "holdout": scene.holdout}))


def writable(module: Any) -> bool:
    """Whether a format's module can write it: one with `detect` and `read` alone is only read."""
    return bool(getattr(module, "WRITABLE", False))


def place_image(source: Path, target: Path, copy: bool) -> None:
    """Links (absolute, so that the folder can move) or copies one image.

    Raises UserError when it is missing, and when another frame's has been written to the same place.
    """
    if not is_file(source):
        raise UserError(f"image '{source}' is missing")
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        if filecmp.cmp(source, target, shallow=False):
            return  # two frames, or two splits, share one image
        raise UserError(f"image '{source}' and another frame's would both be written as '{target.name}'; rename one")
    if copy:
        shutil.copyfile(source, target)
    else:
        target.symlink_to(source.resolve())
