"""What is fuzzed: readers, the captures that they start from, and the inputs that are made of these by number."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from tests.fuzz._mutate import damaged

PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".bmp", ".gif", ".heic")

Changes = Mapping[str, bytes | None]  # by path in the capture; None for a file that is taken away


class InvalidError(Exception):
    """A reader returned what it must not return; the text says what, without numbers of the input."""


@dataclass(frozen=True)
class Input:
    """One damaged capture, as a reader gets it."""

    root: Path
    changed: tuple[str, ...]  # files that differ from the valid capture
    rng: Random
    spare: Path  # a path where nothing is, beside the capture; what is written there is removed


@dataclass(frozen=True)
class Reader:
    """A reader and how to call it; `use` raises UserError for what it refuses."""

    name: str
    make: Callable[[Path], object]  # fills an empty folder with a valid capture
    use: Callable[[Input], object]
    formats: tuple[str, ...] = ()  # of scenes/formats, that it covers
    package: str = ""  # without which it is left out
    whole: bool = False  # each file is an input of its own: none is taken away, one is damaged
    also: tuple[str, ...] = field(default=())  # suffixes of files that count as much as the text files


def contents(root: Path) -> dict[str, bytes]:
    """All files below the folder by their path, sorted."""
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in files}


def changes(reader: Reader, valid: Mapping[str, bytes], seed: int, number: int) -> Changes:
    """What input `number` of the reader changes in its valid capture: the same on every machine."""
    rng = Random(f"{seed} {reader.name} {number}")
    names = list(valid)
    weights = [1 if name.endswith(PICTURES) and not reader.whole else 12 for name in names]
    pool = list(valid.values())
    first = rng.choices(names, weights)[0]
    if reader.whole:
        return {first: damaged(first, valid[first], rng, pool)}
    way = rng.random()
    if way < 0.02:
        return {first: None}
    if way < 0.03:
        return {first: rng.choice(pool)}
    if way < 0.04:
        return {first: b""}
    made: dict[str, bytes | None] = {first: damaged(first, valid[first], rng, pool)}
    if way < 0.15:
        second = rng.choices(names, weights)[0]
        made.setdefault(second, damaged(second, valid[second], rng, pool))
    return made


def apply(root: Path, change: Changes) -> None:
    """Makes the changes in a copy of the valid capture."""
    for name, content in change.items():
        path = root / name
        if content is None:
            path.unlink()
        else:
            path.write_bytes(content)


def restore(root: Path, valid: Mapping[str, bytes], change: Changes) -> None:
    """Takes the changes back."""
    for name in change:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(valid[name])


def lay_out(root: Path, valid: Mapping[str, bytes]) -> None:
    """Writes the valid capture into a new folder."""
    shutil.rmtree(root, ignore_errors=True)
    for name, content in valid.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(content)
