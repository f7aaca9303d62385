"""What to say of scenes that have a name and are not where they should be, with the line that brings them."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path

from ..common import catalogue, extras
from ..common.settings import SceneEntry, Settings, at_home


def absence(names: Iterable[str], settings: Settings, study: bool = False) -> str | None:
    """One sentence about those of the scenes that are not where they should be, or None.

    It has the command that downloads those that the catalogue knows. Names that nobody knows are left to others, as are
    in a `study` the scenes that it renders first.
    """
    undrawn = renderable(names := list(names), settings)
    known = {name: entry for name in names if name not in undrawn and (entry := settings.entry(name)) is not None}
    folders = {name: settings.folder_of(entry) for name, entry in known.items()}
    unset = [name for name, folder in folders.items() if folder is None]
    absent = unset or [name for name, folder in folders.items() if folder is not None and not os.path.exists(folder)]  # noqa: PTH110
    sentences = [_absent(absent, folders, bool(unset), known)] if absent else []
    sentences += [_undrawn(undrawn)] if undrawn and not (study and renders(settings)) else []
    return "; ".join(sentences) or None


def _absent(absent: list[str], folders: dict[str, Path | None], unset: bool, known: dict[str, SceneEntry]) -> str:
    first, others = absent[0], ", ".join(absent[1:])
    command, them = _command(absent, known), "them" if others else "it"
    if unset:
        also = f", as are {others}" if others else ""
        brings = f"; `{command}` then brings {them}" if command else ""
        return f"scene '{first}' is below data.root, which is not set{also}; set VIEWBENCH_DATA or data.root{brings}"
    also = f", nor are {others}" if others else ""
    how = f"`{command}` brings {them}, or correct" if command else "correct"
    return f"scene '{first}' should be in '{folders[first]}', which is not there{also}; {how} data.root or its path"


def _undrawn(names: list[str]) -> str:
    """What to say of rendered scenes that are not there, or not all of them."""
    return (
        f"rendered rooms are not there ({', '.join(names)}): the wheel viewbench-rooms brings those that ship (`make "
        "wheels` in a clone builds it), and a study renders them where VIEWBENCH_ROOMS_PYTHON (or rooms.python) names "
        "a Python that has viewbench[render]"
    )


def renderable(names: Iterable[str], settings: Settings) -> list[str]:
    """Those of the scenes that are not there and can be rendered by what their entry says."""
    entries = {name: entry for name in names if (entry := settings.entry(name)) is not None and entry.render}
    folders = {name: settings.folder_of(entry) for name, entry in entries.items()}
    return [name for name, folder in folders.items() if folder is not None and not _rendered(folder)]


def python_of(settings: Settings) -> str:
    """The Python that renders rooms."""
    return str(at_home(settings.rooms.python)) if settings.rooms.python else sys.executable


def renders(settings: Settings) -> bool:
    """Whether there is a Python to render with: another that is named, or this one."""
    return bool(settings.rooms.python) or extras.missing("bpy") is None


def _rendered(folder: Path) -> bool:
    """Whether both splits are there: `viewbench render` writes their transforms last."""
    return all((folder / f"transforms_{split}.json").is_file() for split in ("train", "test"))


def _command(names: list[str], known: dict[str, SceneEntry]) -> str:
    """The line that downloads those that lie where the catalogue has a scene."""
    found = [scene for name in names if (scene := _listed(known[name].path)) is not None]
    return catalogue.command(found) if found else ""


def _listed(path: str) -> catalogue.Listed | None:
    return None if Path(path).is_absolute() else catalogue.at(path)
