"""Opens a scene by name or path: finds its format, reads it, checks it and makes the test split."""

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..common import plugins
from ..common.errors import UserError, nearest
from ..common.settings import SceneEntry, Settings
from . import shipped_features
from .reading import reader_of
from .splits import hold_out
from .types import Scene
from .validate import check_scene

FORMATS = "scenes.formats"


def open_scene(
    name_or_path: str,
    settings: Settings,
    format: str | None = None,
    holdout: str | None = None,
    **reading: Any,
) -> Scene:
    """The scene that `environment.toml` calls by this name, or the one in this folder.

    `format` forces a reader, `holdout` a test split ("every:8", "blocks:8", "none") where the format has none.
    The rest is what the readers of some formats take; what is not given is taken from the scene's entry of
    `environment.toml`: `allow_outside` lets transforms name images outside the folder, `model` is the number of a
    COLMAP model, `poses` is a file with the trajectory of a folder of images, `intrinsics` and `times` go with it (see
    scenes/formats/trajectory.py), `video` is what `formats.video.read` takes besides.
    Raises UserError for an unknown name, a folder in no known format, an option that the format does not have, and
    whatever is wrong with its contents.
    """
    entry = _entry(name_or_path, settings)
    root = _folder(name_or_path, entry, settings)
    asked = format or (entry.format if entry else "")
    chosen, options = reader_of(root, asked, entry, reading, settings, detect)
    with np.errstate(all="ignore"):  # what a damaged file makes overflow is found afterwards
        scene = plugins.load(FORMATS, chosen).read(root, **options)
    files = (*scene.files, *shipped_features.files(root))  # a choice is made by them
    scene = dataclasses.replace(scene, name=name_or_path if entry else root.resolve().name, files=files)
    scene = _held_out(scene, holdout or "", entry.holdout if entry else "", settings)
    check_scene(scene)
    return scene


def _held_out(scene: Scene, given: str, listed: str, settings: Settings) -> Scene:
    """The scene with its test split: by the rule that was given, that of `environment.toml`, or the format's own habit.

    Raises UserError where the capture has a test split already, which says who asked for another.
    """
    usual = scene.details.get("holdout", "")
    rule = given or listed or usual or "none"
    if rule != "none" and len(scene.test):
        what = "leave --holdout out" if given else f"take `holdout` out of [scenes.{scene.name}] in {settings.source}"
        raise UserError(f"scene '{scene.name}' has {len(scene.test)} test views of its own; {what}")
    if not (given or listed) and usual:
        scene = dataclasses.replace(scene, notes=(*scene.notes, scene.details["holdout_note"]))
    return hold_out(scene, rule)


def is_there(name: str | Path) -> bool:
    """Whether there is a file or folder of this name, which unlike that of Path.exists may be any text."""
    return os.path.exists(name)  # noqa: PTH110


def _entry(name: str, settings: Settings) -> SceneEntry | None:
    """What environment.toml says of the name, or the catalogue unless the name is another folder's than the scene's."""
    if name in settings.scenes or not is_there(name):
        return settings.entry(name)
    entry = settings.entry(name)
    folder = settings.folder_of(entry) if entry else None
    return entry if folder is not None and is_there(folder) and folder.samefile(name) else None


def _folder(name: str, entry: SceneEntry | None, settings: Settings) -> Path:
    if entry is None:
        if is_there(name):
            return Path(name)
        from ..common import catalogue  # no source: names to offer

        known = list(settings.scenes)
        hint = nearest(name, [*known, *catalogue.names()])
        if not hint and (os.sep in name or Path(name).suffix):
            raise UserError(f"there is no file or folder '{name}'")
        raise UserError(
            f"no folder and no scene of {settings.source} is called '{name}'{hint} (scenes: {', '.join(known)})"
        )
    folder = settings.folder_of(entry)
    if folder is None or not is_there(folder) or entry.render:
        from .whereabouts import absence  # no source: it says what is missing

        said = absence([name], settings)
        if said or folder is None or not is_there(folder):
            raise UserError(said or f"scene '{name}' is not in '{folder}'")
    return folder


def detect(root: Path) -> str:
    """Name of the format of the folder, one with poses where there is one. Raises UserError when none knows it."""
    formats = {name: plugins.load(FORMATS, name) for name in plugins.names(FORMATS)}
    later = {name: (not getattr(it, "POSED", True), getattr(it, "LAST", False)) for name, it in formats.items()}
    for name in sorted(formats, key=lambda name: later[name]):
        if formats[name].detect(root):
            return name
    if root.is_file():
        raise UserError(f"'{root}' is a file and no video; name the folder that the capture is in")
    if not any(root.iterdir()):
        raise UserError(f"'{root}' is empty; name the folder that the capture is in")
    if (root / "render_train.json").is_file() or (root / "render_test.json").is_file():
        raise UserError(f"'{root}' is a render of a room that was not finished; run its `viewbench render` again")
    known = ", ".join(plugins.names(FORMATS))
    raise UserError(f"'{root}' is in no known format ({known}); see `viewbench list formats`, or force one by --format")
