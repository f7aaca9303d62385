"""Where a scene that has a name should lie, and the line that brings those that are not there."""

from collections.abc import Iterable
from pathlib import Path

from ..common import catalogue
from ..common.settings import PACKAGE, SceneEntry, Settings


def folder_of(entry: SceneEntry, settings: Settings) -> Path:
    """The folder of an entry of environment.toml or the catalogue; a relative path where data.root is not set."""
    if entry.path.startswith("package:"):
        return PACKAGE / entry.path.removeprefix("package:")
    return Path(settings.data.root).expanduser() / Path(entry.path).expanduser()


def absence(names: Iterable[str], settings: Settings) -> str | None:
    """One sentence about those of the scenes that are not where they should be, or None.

    It has the command that downloads those that the catalogue knows. Names that nobody knows are left to others.
    """
    known = {name: entry for name in names if (entry := settings.entry(name)) is not None}
    needs_root = {name for name, entry in known.items() if _is_relative(entry)}
    unset = [name for name in known if name in needs_root and not settings.data.root]
    absent = unset or [name for name, entry in known.items() if not folder_of(entry, settings).exists()]
    if not absent:
        return None
    first, others = absent[0], absent[1:]
    also = f", nor are {', '.join(others)}" if others else ""
    command = _command([name for name in absent if name in needs_root], known)
    if unset:
        how = f", and `{command}` brings {'them' if others else 'it'}" if command else ""
        also = f", as are {', '.join(others)}" if others else ""
        return (
            f"scene '{first}' is below data.root, which is not set{also}; set VIEWBENCH_DATA or data.root to the folder "
            f"of your captures{how}"
        )
    how = f"`{command}` brings {'them' if others else 'it'}, or correct" if command else "correct"
    folder = folder_of(known[first], settings)
    return f"scene '{first}' should be in '{folder}', which is not there{also}; {how} data.root or its path"


def _is_relative(entry: SceneEntry) -> bool:
    return not entry.path.startswith("package:") and not Path(entry.path).expanduser().is_absolute()


def _command(names: list[str], known: dict[str, SceneEntry]) -> str:
    found = [scene for name in names if (scene := catalogue.find(name) or catalogue.at(known[name].path))]
    return catalogue.command(found) if found else ""
