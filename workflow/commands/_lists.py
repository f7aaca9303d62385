"""Options that say which views must, and which may not, be among the chosen."""

import fnmatch
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from ...common.errors import UserError, nearest

LISTS = (
    click.option(
        "--keep",
        multiple=True,
        metavar="LIST",
        help="Choose these first: names or patterns, or a file with one a line.",
    ),
    click.option("--exclude", multiple=True, metavar="LIST", help="Never choose these; a list as of --keep."),
)


def list_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of LISTS, handed to the command under their own names."""
    for option in reversed(LISTS):
        command = option(command)
    return command


def kept(scene: Any, given: dict[str, Any]) -> list[int]:
    """Indices of the training views that --keep names, in the order named."""
    return _named(scene, "--keep", given["keep"])


def allowed(scene: Any, given: dict[str, Any], keep: Sequence[int]) -> np.ndarray | None:
    """(N,) bool, the training views that --exclude leaves; None where it is not given.

    Raises UserError where a view of `keep` is excluded, and where nothing is left.
    """
    if not given["exclude"]:
        return None
    mask = np.ones(len(scene.train), dtype=bool)
    mask[_named(scene, "--exclude", given["exclude"])] = False
    both = next((i for i in keep if not mask[i]), None)
    if both is not None:
        raise UserError(f"view '{scene.train.names[both]}' is to be kept and excluded; take it out of one list")
    if not mask.any():
        raise UserError(f"--exclude leaves none of the {len(mask)} training views to choose from; name fewer")
    return mask


def _named(scene: Any, option: str, lists: Sequence[str]) -> list[int]:
    """Indices of the training views that the lists name. Raises UserError for a name or pattern that fits none."""
    index = {name: i for i, name in enumerate(scene.train.names)}
    short: dict[str, list[int]] = {}  # by the file's name without its folder, which is how people know a frame
    for name, i in index.items():
        for known in {_short(name), _short(name).rsplit(".", 1)[0]}:
            short.setdefault(known, []).append(i)
    found: dict[int, None] = {}
    for text in lists:
        for name in _lines(option, text):
            fitting = [index[name]] if name in index else short.get(name, [])
            if not fitting and any(letter in name for letter in "*?["):
                fitting = [i for other, i in index.items() if fnmatch.fnmatchcase(other, name)]
                fitting = fitting or [i for other, i in index.items() if fnmatch.fnmatchcase(_short(other), name)]
            if not fitting:
                held = any(
                    name in (other, _short(other), _short(other).rsplit(".", 1)[0]) for other in scene.test.names
                )
                why = "is a test view, which is never chosen" if held else f"is no training view{nearest(name, index)}"
                raise UserError(f"{option}: '{name}' {why}; `viewbench select --dry-run` prints names as they are")
            if len(set(fitting)) > 1 and name in short and name not in index:
                two = ", ".join(f"'{scene.train.names[i]}'" for i in sorted(set(fitting))[:2])
                raise UserError(f"{option}: '{name}' may be {two}; give the name with its folder")
            found.update(dict.fromkeys(fitting))
    return list(found)


def _short(name: str) -> str:
    """The file's name without its folder."""
    return name.rsplit("/", 1)[-1]


def _lines(option: str, text: str) -> list[str]:
    """Names in a text file, one a line (# begins a comment line), or those with commas between them in the text."""
    path = Path(text)
    try:
        if path.is_file():
            lines = path.read_text(encoding="utf-8-sig").splitlines()
            return [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    except UnicodeDecodeError:
        raise UserError(f"{option}: '{text}' is no text file of names") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{option}: '{text}' cannot be read: {error}") from None
    if path.suffix.lower() in (".txt", ".lst", ".list", ".csv"):
        raise UserError(f"{option}: there is no file '{text}'")
    return [part.strip() for part in text.split(",") if part.strip()]
