"""What to say of scenes that have a name and are not where they should be, with the line that brings them."""

from collections.abc import Iterable
from pathlib import Path

from ..common import catalogue
from ..common.settings import SceneEntry, Settings


def absence(names: Iterable[str], settings: Settings) -> str | None:
    """One sentence about those of the scenes that are not where they should be, or None.

    It has the command that downloads those that the catalogue knows. Names that nobody knows are left to others.
    """
    known = {name: entry for name in names if (entry := settings.entry(name)) is not None}
    folders = {name: settings.folder_of(entry) for name, entry in known.items()}
    unset = [name for name, folder in folders.items() if folder is None]
    absent = unset or [name for name, folder in folders.items() if folder is not None and not folder.exists()]
    if not absent:
        return None
    first, others = absent[0], ", ".join(absent[1:])
    command, them = _command(absent, known), "them" if others else "it"
    if unset:
        also = f", as are {others}" if others else ""
        brings = f"; `{command}` then brings {them}" if command else ""
        return f"scene '{first}' is below data.root, which is not set{also}; set VIEWBENCH_DATA or data.root{brings}"
    also = f", nor are {others}" if others else ""
    how = f"`{command}` brings {them}, or correct" if command else "correct"
    return f"scene '{first}' should be in '{folders[first]}', which is not there{also}; {how} data.root or its path"


def _command(names: list[str], known: dict[str, SceneEntry]) -> str:
    """The line that downloads those that lie where the catalogue has a scene."""
    found = [scene for name in names if (scene := _listed(known[name].path)) is not None]
    return catalogue.command(found) if found else ""


def _listed(path: str) -> catalogue.Listed | None:
    return None if Path(path).is_absolute() else catalogue.at(path)
