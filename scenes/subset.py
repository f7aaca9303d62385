"""Writes the chosen part of a scene as a scene of a format, with selection.json beside it."""

import filecmp
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from ..common import plugins
from ..common.errors import UserError
from ..common.files import sealed, whole_folder, write_json
from .image_files import check_picture, check_whole, is_file
from .types import UNCALIBRATED, Scene

LINKS = ("absolute", "relative", "copy")  # how images come into a subset


def write_subset(
    scene: Scene,
    selection: dict[str, Any],
    out: Path,
    links: str = "absolute",
    force: bool = False,
) -> tuple[str, list[str]]:
    """Writes the chosen training views and the whole test split to the folder `out`; returns the format, and notes.

    It is the format that was read or, where that is only read, transforms. The views are in capture order, so that
    equal steps, windows of time and test splits mean the same in a subset; the order chosen is in selection.json.
    Images are linked by their absolute paths (the subset can be moved), by relative ones (it can be moved together with
    the capture), or copied. The folder appears only when all of it is written. Raises UserError for an image that is
    missing or cut short, and for a folder that exists and is not empty unless `force` replaces it.
    """
    written = written_format(scene)
    indices = np.sort(np.asarray(selection["indices"], dtype=np.int64))
    if scene.format != "video":
        for path in (*scene.train.subset(indices).paths, *scene.test.paths):
            check_whole(path)
    return written, write_scene(scene, indices, out, written, links, force, selection)


def written_format(scene: Scene) -> str:
    """The format that a subset of the scene is written in."""
    return scene.format if writable(plugins.load("scenes.formats", scene.format)) else "transforms"


def write_scene(
    scene: Scene,
    indices: np.ndarray,
    out: Path,
    format_name: str,
    links: str = "absolute",
    force: bool = False,
    selection: dict[str, Any] | None = None,
) -> list[str]:
    """Writes the training views at `indices`, in that order, and the test split in a format; as `write_subset`."""
    check_target(scene, out, format_name, force)
    if links not in LINKS:
        raise UserError(f"unknown kind of links '{links}' (there are: {', '.join(LINKS)})")
    module = plugins.load("scenes.formats", format_name)
    with whole_folder(out) as temporary:
        notes = module.write(scene, indices, temporary, links == "copy") or []
        if links == "relative":
            _relate(temporary)
        if selection is not None:
            write_json(temporary / "selection.json", sealed({**selection, "holdout": scene.holdout}))
    return list(notes)


def check_target(scene: Scene, out: Path, format_name: str, force: bool) -> None:
    """Raises UserError where the scene cannot be written to the folder `out` in the format `format_name`."""
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
    _check_way(out, scene)
    if out.exists() and _holds(out, scene):  # said before anybody is told of --force
        raise UserError(f"'{out}' holds the capture itself, or files of it; name another folder")
    if out.exists() and (not out.is_dir() or any(out.iterdir())) and not force:
        raise UserError(f"'{out}' exists and is not empty; name another folder or give --force")


def _check_way(out: Path, scene: Scene) -> None:
    """Raises UserError where `out` lies in the capture and leads out of it by a link there: whoever made the capture
    would choose the folder that is written, and by --force replaced."""
    root, at = scene.root.resolve(), out.absolute()
    steps = [at, *at.parents]
    below = next((i for i, step in enumerate(steps) if step.resolve() == root), 0)
    link = next((step for step in steps[:below] if step.is_symlink()), None)
    if link is not None:
        raise UserError(f"'{out}' leads through '{link}', a link in the capture; name a folder elsewhere")


def _holds(out: Path, scene: Scene) -> bool:
    """Whether files of the capture lie in the folder, wherever links lead: replacing it would lose them."""
    folder = os.path.realpath(out)
    files = [scene.root, *scene.files]
    for split in (scene.train, scene.test):
        files += [*split.paths, *filter(None, (*split.masks, *split.depths))]
    found = {os.path.realpath(file) for file in files}
    return any(file == folder or file.startswith(folder.rstrip(os.sep) + os.sep) for file in found)


def _relate(folder: Path) -> None:
    """Makes absolute links relative. The folder is renamed where it lies, so that steps upwards stay right."""
    for link in [path for path in folder.rglob("*") if path.is_symlink()]:
        target = link.readlink()
        if target.is_absolute():
            link.unlink()
            link.symlink_to(os.path.relpath(target, link.parent.resolve()))


def writable(module: Any) -> bool:
    """Whether a format's module can write it: one with `detect` and `read` alone is only read."""
    return bool(getattr(module, "WRITABLE", False))


def place_image(source: Path, target: Path, copy: bool) -> None:
    """Links (absolute, so that the folder can move) or copies one image.

    Raises UserError when it is missing, and when another frame's has been written to the same place.
    """
    if not is_file(source):
        raise UserError(f"image '{source}' is missing")
    check_picture(source)
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        if filecmp.cmp(source, target, shallow=False):
            return  # two frames, or two splits, share one image
        raise UserError(f"image '{source}' and another frame's would both be written as '{target.name}'; rename one")
    if copy:
        shutil.copyfile(source, target)
        return
    try:
        target.symlink_to(source.resolve())
    except OSError as error:
        raise UserError(f"'{target.name}' cannot be a link there ({error.strerror}); give --copy") from None
