"""What the field's data sets are called, where they are and under what terms: reads `scenes/catalogue.toml`."""

import functools
import os
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from .errors import UserError, nearest

FILE = Path(__file__).resolve().parent.parent / "scenes" / "catalogue.toml"
T = TypeVar("T")
LARGEST = 1e18  # bytes
VARIABLE = "VIEWBENCH_CATALOGUE"  # names another file than the one that ships


@dataclass(frozen=True)
class Licence:
    """The terms of a data set."""

    name: str
    address: str
    says: str  # what it asks for, in a sentence


@dataclass(frozen=True)
class Archive:
    """What is fetched; `bytes` and `about_gb` are 0 where nobody counted."""

    address: str
    bytes: int = 0
    about_gb: float = 0.0


@dataclass(frozen=True)
class Listed:
    """A scene of the catalogue."""

    dataset: str
    scene: str
    folder: str  # its folder below that of the data set
    archive: Archive | None = None  # None where it comes from a Google Drive folder
    prefix: str = ""  # its folder in the archive or the drive, with a slash at its end
    also: tuple[str, ...] = ()  # files from elsewhere in the archive that it needs
    nested: bool = False  # archives in the archive are unpacked too
    bytes: int = 0
    about_gb: float = 0.0
    shared: int = 1  # scenes that come from the same archive

    @property
    def name(self) -> str:
        """DATASET/SCENE."""
        return f"{self.dataset}/{self.scene}"

    @property
    def path(self) -> str:
        """Where it lies below data.root."""
        return f"{self.dataset}/{self.folder}"

    @property
    def size(self) -> str:
        """What there is to fetch, in words for people."""
        archive = self.archive or Archive("")
        for source in (self, archive):
            words = size_in_words(source.bytes, source.about_gb)
            if words:
                return words if source is self or self.shared == 1 else f"a part of {words}"
        return "size not known"


@dataclass(frozen=True)
class DataSet:
    """A data set of the catalogue."""

    name: str
    title: str
    home: str
    citation: str
    source: str  # where the addresses were read
    licence: Licence
    group: str = ""  # of its scenes in tables
    format: str = ""
    holdout: str = ""
    drive: str = ""  # id of a shared Google Drive folder
    by_hand: str = ""  # what to do where nothing can be fetched
    scenes: dict[str, Listed] = field(default_factory=dict)

    @property
    def size(self) -> str:
        """What there is to fetch for all its scenes, in words for people."""
        archives = {scene.archive.address: scene.archive for scene in self.scenes.values() if scene.archive}
        if len(archives) == len(self.scenes):  # each has its own
            parts: list[Any] = [scene if scene.bytes or scene.about_gb else scene.archive for scene in self._each()]
        else:
            parts = list(archives.values())
        known = [part.bytes or part.about_gb * 1e9 for part in parts if part and (part.bytes or part.about_gb)]
        if not known:
            return "size not known"
        exact = all(part.bytes for part in parts if part) and len(known) == len(parts)
        words = size_in_words(int(sum(known)) if exact else 0, 0 if exact else sum(known) / 1e9)
        return words if len(known) == len(parts) else f"more than {words}"

    def _each(self) -> Iterable[Listed]:
        return self.scenes.values()


def size_in_words(count: int, about_gb: float = 0.0) -> str:
    """`0.34 GB`, `about 12 GB` where it is an estimate, nothing for nothing."""
    if count:
        return f"{count / 1e9:.2f} GB" if count >= 1e7 else f"{count / 1e6:.2f} MB"
    return f"about {about_gb:.3g} GB" if about_gb else ""


def read() -> dict[str, DataSet]:
    """The data sets by name, in the order of the file. Raises UserError for a file that is not as described in it."""
    return _read(os.environ.get(VARIABLE) or str(FILE))


@functools.cache
def _read(path: str) -> dict[str, DataSet]:
    try:
        raw = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"catalogue '{path}' cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"catalogue '{path}' is not valid TOML: {error}") from None
    try:
        return {name: _dataset(name, dict(values)) for name, values in raw.items()}
    except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
        raise UserError(f"catalogue '{path}' is not as its head says: {error}") from None


def _dataset(name: str, values: dict[str, Any]) -> DataSet:
    archives = {key: _typed(Archive(**given)) for key, given in values.pop("archives", {}).items()}
    used = [given.get("archive") for given in values.get("scenes", {}).values()]
    scenes = {}
    for scene, given in values.pop("scenes", {}).items():
        given = dict(given)
        key, address = given.pop("archive", None), given.pop("address", "")
        archive = archives[key] if key else _typed(Archive(address)) if address else None
        given |= {"also": tuple(given.get("also", ())), "shared": used.count(key) if key else 1}
        scenes[scene] = _typed(Listed(name, scene, given.pop("folder", scene), archive, **given))
        if any(part in ("", "..") for part in scenes[scene].path.split("/")):
            raise ValueError(f"scene '{scene}' lies outside the folder of its data set")
    licence = _typed(Licence(**values.pop("licence")))
    return _typed(DataSet(name=name, licence=licence, scenes=scenes, **{"group": name, **values}))


def _typed(made: T) -> T:
    """The object, if its texts are texts and its numbers numbers. Raises ValueError that names one which is not."""
    for name, kind in get_type_hints(type(made)).items():
        value = getattr(made, name)
        if kind in (int, float) and not (type(value) in (int, float) and 0 <= value < LARGEST):
            raise ValueError(f"'{name}' of {type(made).__name__} is no number of bytes or GB")
        if kind in (str, bool) and not isinstance(value, kind):
            raise ValueError(f"'{name}' of {type(made).__name__} is no {'text' if kind is str else 'true or false'}")
        if isinstance(value, tuple) and not all(isinstance(one, str) for one in value):
            raise ValueError(f"'{name}' of {type(made).__name__} is no list of texts")
    return made


def names() -> list[str]:
    """DATASET/SCENE of all scenes."""
    return [scene.name for known in read().values() for scene in known.scenes.values()]


def find(name: str) -> Listed | None:
    """The scene that is called DATASET/SCENE, or in a study DATASET.SCENE; None for any other name."""
    for mark in "/.":
        dataset, sign, scene = name.partition(mark)
        known = read().get(dataset) if sign else None
        if known is not None and scene.rstrip("/") in known.scenes:
            return known.scenes[scene.rstrip("/")]
    return None


def at(path: str) -> Listed | None:
    """The scene that lies in this folder below data.root, by whatever name somebody calls it."""
    wanted = Path(path).as_posix()
    return next((scene for known in read().values() for scene in known.scenes.values() if scene.path == wanted), None)


def expand(name: str) -> list[Listed]:
    """The scenes that are meant by DATASET/SCENE, or by DATASET: all of them.

    Raises UserError for a name that the catalogue does not have, with the nearest that it has, and for a data set that
    nobody can download without asking its authors.
    """
    dataset, _, scene = name.strip("/").partition("/")
    known = read().get(dataset)
    if known is None:
        listed = [scene for entry in read().values() for scene in entry.scenes.values()]
        same = [scene.name for scene in listed if scene.scene == name]
        hint = f"; did you mean {' or '.join(same)}?" if same else nearest(name, [*read(), *names()])
        raise UserError(
            f"no data set is called '{dataset}'{hint} (there are: {', '.join(read())}; "
            "`viewbench download --list` says more)"
        )
    if not known.scenes:
        where = f"data.root/{dataset}/{scene or 'SCENE'}"
        raise UserError(f"{known.title} cannot be downloaded from here: {known.by_hand} goes to {where}")
    if not scene:
        return list(known.scenes.values())
    if scene not in known.scenes:
        raise UserError(
            f"{known.title} has no scene '{scene}'{nearest(scene, known.scenes)} (scenes: {', '.join(known.scenes)})"
        )
    return [known.scenes[scene]]


def command(scenes: Iterable[Listed]) -> str:
    """The line that brings these scenes."""
    return f"viewbench download {' '.join(dict.fromkeys(scene.name for scene in scenes))}"
