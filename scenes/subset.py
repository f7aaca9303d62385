"""Writes the chosen part of a scene as a scene of a format, with selection.json beside it."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.files import whole_folder, write_json
from viewbench.scenes.types import Scene


def write_subset(scene: Scene, selection: dict[str, Any], out: Path, copy: bool = False, force: bool = False) -> None:
    """Writes the chosen training views and the whole test split to the folder `out`, in the format that was read.

    Images are linked, or with `copy` copied. The folder appears only when all of it is written. Raises UserError for
    a format that is only read, and for a folder that exists and is not empty unless `force` replaces it.
    """
    write_scene(scene, np.asarray(selection["indices"], dtype=np.int64), out, scene.format, copy, force, selection)


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
    if not module.WRITABLE:
        raise UserError(
            f"format '{format_name}' can be read and not written; write transforms or colmap (convert --to)"
        )
    if out.exists() and (not out.is_dir() or any(out.iterdir())) and not force:
        raise UserError(f"'{out}' exists and is not empty; name another folder or give --force")
    if out.resolve() == scene.root.resolve() or scene.root.resolve().is_relative_to(out.resolve()):
        raise UserError(f"'{out}' holds the capture itself; name another folder")
    with whole_folder(out) as temporary:
        module.write(scene, indices, temporary, copy)
        if selection is not None:
            write_json(temporary / "selection.json", {**selection, "holdout": scene.holdout})


def place_image(source: Path, target: Path, copy: bool) -> None:
    """Links (absolute, so that the folder can move) or copies one image. Raises UserError when it is missing."""
    if not source.is_file():
        raise UserError(f"image '{source}' is missing")
    target.parent.mkdir(parents=True, exist_ok=True)
    if copy:
        shutil.copyfile(source, target)
    else:
        target.symlink_to(source.resolve())
