"""Opens a scene by name or path: finds its format, reads it, checks it and makes the test split."""

import dataclasses
import os
from pathlib import Path

from ..common import plugins
from ..common.errors import UserError, nearest
from ..common.settings import SceneEntry, Settings
from .splits import hold_out
from .types import Scene
from .validate import check_scene

FORMATS = "scenes.formats"


def open_scene(
    name_or_path: str,
    settings: Settings,
    format: str | None = None,
    holdout: str | None = None,
    allow_outside: bool = False,
) -> Scene:
    """The scene that `environment.toml` calls by this name, or the one in this folder.

    `format` forces a reader, `holdout` a test split ("every:8", "blocks:8", "none") where the format has none.
    `allow_outside` lets transforms name images outside the folder.
    Raises UserError for an unknown name, a folder in no known format, and whatever is wrong with its contents.
    """
    entry = _entry(name_or_path, settings)
    root = _folder(name_or_path, entry, settings)
    chosen = format or (entry.format if entry else "") or detect(root)
    reader = plugins.load(FORMATS, chosen)
    scene = reader.read(root, allow_outside=True) if allow_outside and chosen == "transforms" else reader.read(root)
    scene = dataclasses.replace(scene, name=name_or_path if entry else root.resolve().name)
    scene = hold_out(scene, holdout or (entry.holdout if entry else "") or scene.details.get("holdout", "none"))
    check_scene(scene)
    return scene


def _entry(name: str, settings: Settings) -> SceneEntry | None:
    """What environment.toml says of the name, or the catalogue unless the name is another folder's than the scene's."""
    # os.path.exists, unlike Path.exists, takes any text for a name.
    if name in settings.scenes or not os.path.exists(name):  # noqa: PTH110
        return settings.entry(name)
    entry = settings.entry(name)
    folder = settings.folder_of(entry) if entry else None
    return entry if folder is not None and folder.exists() and folder.samefile(name) else None


def _folder(name: str, entry: SceneEntry | None, settings: Settings) -> Path:
    if entry is None:
        if os.path.exists(name):  # noqa: PTH110
            return Path(name)
        from ..common import catalogue  # no source: names to offer

        known = list(settings.scenes)
        raise UserError(
            f"no folder and no scene of {settings.source} is called '{name}'"
            f"{nearest(name, [*known, *catalogue.names()])} "
            f"(scenes: {', '.join(known)})"
        )
    folder = settings.folder_of(entry)
    if folder is None or not folder.exists():
        from .whereabouts import absence  # no source: it says what is missing

        raise UserError(absence([name], settings) or f"scene '{name}' is not in '{folder}'")
    return folder


def detect(root: Path) -> str:
    """Name of the format of the folder, one with poses where there is one. Raises UserError when none knows it."""
    formats = {name: plugins.load(FORMATS, name) for name in plugins.names(FORMATS)}
    for name in sorted(formats, key=lambda name: not getattr(formats[name], "POSED", True)):
        if formats[name].detect(root):
            return name
    if root.is_file():
        raise UserError(f"'{root}' is a file and no video; name the folder that the capture is in")
    known = ", ".join(plugins.names(FORMATS))
    raise UserError(f"'{root}' is in no known format ({known}); see `viewbench list formats`, or force one by --format")
