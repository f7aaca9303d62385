"""Reads `environment.toml`: what differs from one machine to the next, documented key by key in that file."""

import os
import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from . import bounded, limits
from .errors import UserError, nearest

PACKAGE = Path(__file__).resolve().parent.parent
ROOMS_PACKAGE = "viewbench_rooms"  # the rendered rooms as a package of their own, since they are 60 MB
FILE = "environment.toml"
NAMED = "VIEWBENCH_ENVIRONMENT"  # the variable that names another file


@dataclass(frozen=True)
class Data:
    root: str = ""  # folder of the captures that do not ship with viewbench
    video_cache_gb: int = 10  # of small pictures of videos in the user's cache


@dataclass(frozen=True)
class SceneEntry:
    path: str
    dataset: str = ""
    holdout: str = ""
    format: str = ""
    allow_outside: bool = False
    model: int = -1
    poses: str = ""  # trajectory of a folder of images; relative paths start at the scene's folder
    intrinsics: str = ""  # fx,fy,cx,cy[,k1,k2,p1,p2[,k3]]
    times: str = ""  # times of the images, where their names have none
    room: str = ""  # where it was captured: two walks through one room are one sample of rooms
    render: str = ""  # what `viewbench render` is given to make it where it is not there: "ROOM --path PATH --size PX"
    walk: str = ""  # how the camera went ("human", "smooth"): tables over rooms show each way by itself


@dataclass(frozen=True)
class Rooms:
    python: str = ""  # that renders rooms; empty: the one that runs viewbench
    shards: int = 4  # jobs that a path is rendered by


@dataclass(frozen=True)
class Features:
    encoder: str = "efficientnet-lite0"
    cache: str = "results/features"
    batch: int = 4


@dataclass(frozen=True)
class Compute:
    threads: int = 1
    device: str = "auto"
    retries: int = 2  # of a training or a score that the machine had no memory for
    retry_wait: int = 15  # seconds before the first of them, twice as long before each other


@dataclass(frozen=True)
class Metrics:
    lpips_weights: str = ""


@dataclass(frozen=True)
class Tracking:
    uri: str = "sqlite:///results/mlflow.db"
    artifacts: str = "results/mlartifacts"
    renders: int = 3  # test views of a cell whose strips are logged; 0 for no pictures
    models: int = 10  # megabytes of a model that is logged with its cell; 0 for none
    patience: int = 120  # seconds that the end of a study waits for a store that does not answer


@dataclass(frozen=True)
class InstantNgp:
    path: str = ""
    python: str = ""


@dataclass(frozen=True)
class Command:
    train: list
    render: list = field(default_factory=list)
    format: str = "transforms"
    output: str = "{name}.png"
    version: list = field(default_factory=list)
    device: str = "cpu"
    timeout: int = 0  # seconds, 0 for none
    needs_points: bool = False
    background: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # red, green, blue in [0, 1]


@dataclass(frozen=True)
class Settings:
    """The whole file; `source` is where it was read."""

    source: Path
    data: Data = Data()
    scenes: dict[str, SceneEntry] = field(default_factory=dict)
    rooms: Rooms = Rooms()
    features: Features = Features()
    compute: Compute = Compute()
    metrics: Metrics = Metrics()
    tracking: Tracking = Tracking()
    instant_ngp: InstantNgp = InstantNgp()
    command: dict[str, Command] = field(default_factory=dict)

    def entry(self, scene: str) -> SceneEntry | None:
        """What the file says of a scene or, where it does not name it, the catalogue (`mipnerf360/room`)."""
        return self.scenes.get(scene) or _of_catalogue(scene)

    def folder_of(self, entry: SceneEntry) -> Path | None:
        """Where a scene should lie; None where that is below data.root, which is not set."""
        if entry.path.startswith("package:"):
            return _shipped(entry.path.removeprefix("package:"))
        path = at_home(entry.path)
        if path.is_absolute():
            return path
        return at_home(self.data.root) / path if self.data.root else None

    def place_of(self, scene: str) -> str:
        """Where a scene lies, as the file writes it; its name where the file does not know it."""
        entry = self.entry(scene)
        return entry.path if entry else scene

    def dataset_of(self, scene: str, otherwise: str) -> str:
        """The group that tables put a scene in; `otherwise` where the file names none."""
        entry = self.entry(scene)
        return (entry.dataset if entry else "") or otherwise

    def room_of(self, scene: str) -> str:
        """The room that a scene was captured in: the scene itself where nothing names one."""
        entry = self.entry(scene)
        return (entry.room if entry else "") or scene

    def walk_of(self, scene: str) -> str:
        """How the camera went in a scene; empty where nothing says so."""
        entry = self.entry(scene)
        return entry.walk if entry else ""


def _shipped(path: str) -> Path:
    """Where data lies that is not in every wheel: with the code, in the package of the rendered rooms, or where it is
    rendered to, which for installed code is the user's cache."""
    import importlib.util

    places = [PACKAGE]
    found = importlib.util.find_spec(ROOMS_PACKAGE)
    places += [Path(place) for place in (found.submodule_search_locations or ())] if found else []
    for place in places:
        if os.path.exists(place / path):  # noqa: PTH110
            return place / path
    if (PACKAGE / "pyproject.toml").is_file():
        return PACKAGE / path
    from .files import user_cache

    try:
        return user_cache("rooms") / path
    except RuntimeError:  # nobody's home
        return PACKAGE / path


def _of_catalogue(scene: str) -> SceneEntry | None:
    from . import catalogue  # no source: where a scene lies and how it is split, which its results record

    found = catalogue.find(scene)
    if found is None:
        return None
    data = catalogue.read()[found.dataset]
    return SceneEntry(found.path, data.group, data.holdout, data.format)


SECTIONS: dict[str, type] = {
    "data": Data,
    "rooms": Rooms,
    "features": Features,
    "compute": Compute,
    "metrics": Metrics,
    "tracking": Tracking,
    "instant_ngp": InstantNgp,
}
# No renders, no waiting, no limit, the first model, no other attempt.
MAY_BE_ZERO = ("renders", "models", "patience", "timeout", "model", "retries", "retry_wait")
TABLES: dict[str, type] = {"scenes": SceneEntry, "command": Command}


def at_home(path: str) -> Path:
    """The path, with `~` and `~name` as the home they stand for. Raises UserError where nobody has that home."""
    try:
        return Path(path).expanduser()
    except (RuntimeError, ValueError):
        raise UserError(f"'{path}' begins with a home that is nobody's here; write the whole path") from None


def find() -> Path:
    """The file in force: VIEWBENCH_ENVIRONMENT, `environment.toml` here, or the one that viewbench ships."""
    named = os.environ.get(NAMED)
    if named:
        return Path(named)
    return Path(FILE) if Path(FILE).is_file() else PACKAGE / FILE


def load(path: str | os.PathLike | None = None) -> Settings:
    """Reads and checks the settings, environment variables last.

    Raises UserError for an unreadable file, an unknown key (with the nearest right one) and a value of a wrong type.
    """
    source = Path(path) if path else find()
    try:
        raw = tomllib.loads(bounded.data(source, "settings", limits.SETTINGS_BYTES).decode("utf-8"))
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a ValueError of its own
        raise UserError(f"settings '{source}' is not valid TOML: {error}") from None
    _known(raw, [*SECTIONS, *TABLES], str(source), "section")
    for section in raw:
        if not isinstance(raw[section], dict):
            raise UserError(f"{source}: '{section}' is a section; write [{section}] and its keys below")
    values: dict[str, Any] = {}
    for section, kind in SECTIONS.items():
        values[section] = _section(kind, _override(section, kind, raw.get(section, {})), f"{source} [{section}]")
    for section, kind in TABLES.items():
        table = raw.get(section, {})
        values[section] = {name: _section(kind, entry, f"{source} [{section}.{name}]") for name, entry in table.items()}
    return Settings(source=source, **values)


def _override(section: str, kind: type, values: dict) -> dict:
    values = dict(values)
    for item in fields(kind):
        variable = f"VIEWBENCH_{section}_{item.name}".upper()
        text = os.environ.get(variable)
        if section == "data" and item.name == "root":
            text = os.environ.get("VIEWBENCH_DATA", text)
        if text is not None:
            wanted = get_type_hints(kind)[item.name]
            try:
                values[item.name] = wanted(text)
            except ValueError:
                raise UserError(f"{variable} is '{text}', expected {_called(wanted)}") from None
    return values


def _section(kind: type, values: Any, where: str) -> Any:
    if not isinstance(values, dict):
        raise UserError(f"{where}: expected a section with keys, got {values!r}")
    hints = get_type_hints(kind)
    _known(values, list(hints), where, "key")
    for name, value in values.items():
        wanted, items = get_origin(hints[name]) or hints[name], get_args(hints[name])
        if not isinstance(value, wanted) or isinstance(value, bool) != (wanted is bool):
            raise UserError(f"{where}: '{name}' is {value!r}, expected {_called(wanted)}")
        least, words = (0, "0 or more") if name in MAY_BE_ZERO else (1, "a positive number")
        if wanted is int and value < least:
            raise UserError(f"{where}: '{name}' is {value}, expected {words}")
        numbers = items == (float,)
        if wanted is list and not all(isinstance(item, (int, float) if numbers else str) for item in value):
            raise UserError(f"{where}: '{name}' must be a list of {'numbers' if numbers else 'strings'}")
        if numbers:
            try:
                values = {**values, name: [float(item) for item in value]}
            except OverflowError:
                raise UserError(f"{where}: '{name}' has a number that is too large") from None
    try:
        return kind(**values)
    except TypeError:
        missing = [item.name for item in fields(kind) if item.name not in values]
        raise UserError(f"{where}: '{missing[0]}' is missing") from None


def _known(values: dict, known: list[str], where: str, what: str) -> None:
    for name in values:
        if name not in known:
            raise UserError(f"{where}: unknown {what} '{name}'{nearest(name, known)} (known: {', '.join(known)})")


def _called(kind: type) -> str:
    return {str: "a text in quotes", int: "a whole number", bool: "true or false", list: "a list"}.get(
        kind, kind.__name__
    )
