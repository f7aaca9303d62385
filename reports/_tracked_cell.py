"""What MLflow is told of the cells of a study: times, tags, parameters, metrics with the curve of the training, files.

Cells come from a study's folder (`StudyCells`), or from a table that was recorded (`_tracking_import.py`).
"""

import contextlib
import getpass
import hashlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from ..common.cells import RECORDS, cell_folder, cell_name, figures, read_records
from ..common.errors import UserError
from ..common.files import read_json, sha256_file
from ..common.settings import Tracking
from ..selectors._selection import selection_sha256
from ._about import About
from ._study import machine_words
from ._tracked_run import (
    COLOUR,
    COMMIT,
    DIRTY,
    LONGEST_DIGEST,
    SHARE,
    SOURCE,
    SOURCE_TYPE,
    USER,
    Content,
    DataSet,
    params,
)

MB = 10**6
KEPT = 200  # figures of choices, of some 50 kB each
LATEST_S = 2.0**37  # of a time, since 1970: databases take its milliseconds
Made = tuple[Any, Any]  # the stamp of what it was made of, and what was made
VERSION = 2  # of how a cell is logged: another one replaces the runs that are there


@dataclass(frozen=True)
class Facts:
    """What is known of a cell."""

    cell: Mapping[str, str]
    figures: Mapping[str, float]  # scores, seconds and sizes, by name
    count: int  # views chosen
    n_views: int | None  # of the scene
    named: Mapping[str, Any]  # budget and options, the same for all cells of a summary
    tags: Mapping[str, str]  # of the trainer and its machine
    commit: str
    scene_sha256: str
    began_ms: int  # since 1970
    trained_ms: int  # when the training began
    ended_ms: int


class Cells(Protocol):
    """Where cells come from."""

    def facts(self, cell: Mapping[str, str]) -> Facts:
        """Raises UserError for a cell that cannot be read."""
        ...

    def fingerprint(self, cell: Mapping[str, str]) -> str:
        """What its run carries; raises UserError for a cell that cannot be read."""
        ...

    def content(self, cell: Mapping[str, str], parent: dict[str, str], drawn: Path) -> Content:
        """Its run; `parent` is the tag that names its summary, pictures are drawn into `drawn`. Raises UserError."""
        ...

    def scene(self, name: str) -> dict[str, Any]:
        """The description of a scene; empty where there is none."""
        ...

    def made(self, cell: Mapping[str, str], fingerprint: str) -> bool:
        """Whether a run with this fingerprint was logged from here, as far as can be told."""
        ...


class StudyCells:
    """The cells of results/STUDY."""

    def __init__(self, about: About, results: Path, tracking: Tracking):
        self.about, self.results, self.tracking = about, results, tracking
        # What was made of files, with the stamps that these had (`_made_of`): scenes, what their figures share, cells,
        # and figures of choices.
        self._scenes: dict[str, Made] = {}
        self._rooms: dict[str, Made] = {}
        self._facts: dict[str, Made] = {}
        self._drawn: dict[tuple[str, str, str], Made] = {}

    def facts(self, cell: Mapping[str, str]) -> Facts:
        """From the cell's records, which are read once."""
        folder, name = cell_folder(self.results, cell), cell_name(cell)
        with _explained(cell):
            stamps = [_stamp(folder / file) for file in RECORDS]
            return _made_of(stamps, self._facts, name, lambda: _facts(cell, folder, *read_records(folder)))

    def fingerprint(self, cell: Mapping[str, str]) -> str:
        """The hash of its records, of what the run is called, and of which files it gets."""
        digest, folder = hashlib.sha256(), cell_folder(self.results, cell)
        try:
            for file in RECORDS:
                if (folder / file).is_symlink():  # which is none of viewbench's, and is not followed to be logged
                    raise UserError(f"cell {cell_name(cell)}: '{folder / file}' is a link; put the file there")
                digest.update((folder / file).read_bytes() + b"\0")
        except OSError as error:
            raise UserError(f"cell {cell_name(cell)} cannot be read: {error.strerror}: {error.filename}") from None
        return fingerprint(digest.hexdigest(), cell, self.about, self.tracking.renders, self.tracking.models)

    def content(self, cell: Mapping[str, str], parent: dict[str, str], drawn: Path) -> Content:
        """With its records, pictures and model as files."""
        folder = cell_folder(self.results, cell)
        with _explained(cell):
            selection, train, metrics = read_records(folder)
            facts = _facts(cell, folder, selection, train, metrics)
            return content(
                facts,
                self.about,
                self.scene(cell["scene"]),
                parent,
                curve=_curve(train["curve"], facts.trained_ms),
                files=[(folder / file, None) for file in RECORDS] + self._pictures(cell, selection, metrics, drawn),
                linked=_model(folder, train, self.tracking.models),
            )

    def made(self, cell: Mapping[str, str], fingerprint: str) -> bool:
        """Where the cell has no score any more, but other records, it was here that it was scored."""
        folder = cell_folder(self.results, cell)
        there = [(folder / file).is_file() for file in RECORDS]
        if not all(there):
            return any(there)
        try:
            return self.fingerprint(cell) == fingerprint
        except UserError:
            return True

    def scene(self, name: str) -> dict[str, Any]:
        """As `viewbench describe` wrote it; read again when that has written another one."""
        path = self._described(name)

        def read() -> dict[str, Any]:
            record = read_json(path, "scene description")
            return record if isinstance(record, dict) else {}

        with contextlib.suppress(UserError, RecursionError, OSError):
            return _made_of(_stamp(path), self._scenes, name, read)
        return {}

    def _described(self, scene: str) -> Path:
        return self.results / "scenes" / f"{scene}.json"

    def _cameras(self, cell: Mapping[str, str], selection: dict[str, Any]) -> bytes:
        """The figure of a choice, which is drawn once for all cells that share it. Raises UserError, and OSError where
        the scene is not described."""
        from . import _run_cameras, _run_pictures

        scene, name = cell["scene"], cell["selector"]
        stamp = _stamp(self._described(scene))

        def draw() -> bytes:
            room = _made_of(stamp, self._rooms, scene, lambda: _run_cameras.room_of(self.scene(scene)))
            figure = _run_cameras.cameras(room, selection, self.about.colours[name], name)
            return _run_pictures.encoded(figure, _run_pictures.PNG)

        for old in [*self._drawn][: len(self._drawn) - KEPT]:
            del self._drawn[old]
        return _made_of(stamp, self._drawn, (scene, name, selection_sha256(selection)), draw)

    def coherent(self, cell: Mapping[str, str]) -> bool:
        """Whether the score is of the model, and the model of the choice, that lie beside it: none is made anew."""
        folder = cell_folder(self.results, cell)
        with contextlib.suppress(KeyError, TypeError, AttributeError, UserError, OSError):
            selection, train, metrics = read_records(folder)
            chosen = train["selection_sha256"] == selection_sha256(selection)
            return chosen and metrics["train_sha256"] == sha256_file(folder / "train.json")
        return False

    def _pictures(
        self, cell: Mapping[str, str], selection: dict[str, Any], metrics: dict[str, Any], drawn: Path
    ) -> list[tuple[Path, str | None]]:
        """Strips of truth and render, and where the chosen cameras are; what cannot be drawn is left out."""
        from . import _run_pictures  # PIL

        if not self.tracking.renders:
            return []
        folder, files = cell_folder(self.results, cell), list[tuple[Path, str | None]]()
        for view in _run_pictures.views_to_show(metrics, self.tracking.renders):
            with contextlib.suppress(UserError):
                render, truth = _run_pictures.files_of(view, folder, self.results / "scenes" / cell["scene"])
                strip = _run_pictures.strip(render, truth, _run_pictures.words_of(view))
                path = drawn / f"{render.stem}{_run_pictures.JPEG}"
                path.write_bytes(_run_pictures.encoded(strip))
                files.append((path, "renders"))
        with contextlib.suppress(UserError, FileNotFoundError):
            path = drawn / f"cameras{_run_pictures.PNG}"
            path.write_bytes(self._cameras(cell, selection))
            files.append((path, None))
        return files


def content(
    facts: Facts,
    about: About,
    scene: dict[str, Any],
    parent: dict[str, str],
    curve: list[tuple[str, float, int, int]] = [],  # noqa: B006 - never changed
    files: list[tuple[Path, str | None]] = [],  # noqa: B006
    linked: list[tuple[Path, str | None]] = [],  # noqa: B006
) -> Content:
    """The run of a cell."""
    cell = facts.cell
    final = {**facts.figures, SHARE: 100 * float(cell["ratio"])}
    return Content(
        kind="cell",
        key=cell_name(cell),
        name=about.cell_title(cell),
        tags={**facts.tags, **common_tags(about, cell["selector"], facts.commit)},
        params=params({**cell, "count": facts.count, "n_views": facts.n_views, **facts.named}),
        metrics=[(key, value, facts.ended_ms, 0) for key, value in final.items()] + curve,
        started_ms=facts.began_ms,
        ended_ms=facts.ended_ms,
        files=files,
        linked=linked,
        data=data_set(about, cell["scene"], facts.scene_sha256, scene),
        also=parent,
    )


def fingerprint(of_records: str, cell: Mapping[str, str], about: About, *look: object) -> str:
    """What the run of a cell carries."""
    told = (of_records, about.cell_title(cell), about.colours.get(cell["selector"]), *look, VERSION)
    return hashlib.sha256(repr(told).encode()).hexdigest()


def common_tags(about: About, selector: str, commit: str) -> dict[str, str]:
    """Tags of MLflow's own that a cell and a summary have: who, from what, in which colour."""
    tags = {
        COLOUR: about.colours.get(selector, ""),
        USER: user() if about.ours else "",
        SOURCE: about.source,
        SOURCE_TYPE: "LOCAL",
        COMMIT: commit.removesuffix("-dirty"),
        DIRTY: str(commit.endswith("-dirty")) if commit else "",
    }
    return {key: value for key, value in tags.items() if value}


def user() -> str:
    """Who runs this, by name; empty where nobody knows."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):
        return ""


def data_set(about: About, scene: str, sha256: str, record: dict[str, Any]) -> DataSet:
    """The scene as a data set, from its hash and its description."""
    numbers = {"training views": "n_train", "test views": "n_test", "width": "width", "height": "height"}
    profile = {words: record[key] for words, key in numbers.items() if key in record}
    return DataSet(scene, sha256[:LONGEST_DIGEST], about.places.get(scene, scene), profile)


def is_number(value: Any) -> bool:
    """Whether MLflow takes the value as a metric."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _facts(
    cell: Mapping[str, str],
    folder: Path,
    selection: dict[str, Any],
    train: dict[str, Any],
    metrics: dict[str, Any],
) -> Facts:
    """From the records of a cell.

    The choosing, which several cells may share, counts as done right before the training. Records of earlier versions
    name no times: those of their files stand for them.
    """
    known = {**figures(selection, train, metrics), "n_primitives": train["n_primitives"]}
    named = {"width": train.get("width")}
    named |= {f"budget.{key}": value for key, value in train["budget"].items()}
    named |= {f"option.{key}": value for key, value in train.get("options", {}).items()}
    named |= {f"selector.{key}": value for key, value in selection["parameters"].items()}
    trained = _time(train.get("began")) or (folder / "train.json").stat().st_mtime - float(train["seconds"])
    ended = _time(metrics.get("ended")) or (folder / "metrics.json").stat().st_mtime
    began = trained - float(sum(selection["seconds"].values()))
    if not all(0 <= at < LATEST_S for at in (began, trained, ended)):
        raise ValueError(f"times of {began:g} to {ended:g} s")
    began_ms, trained_ms, ended_ms = (round(1000 * at) for at in (began, trained, ended))
    return Facts(
        cell=cell,
        figures={key: value for key, value in known.items() if is_number(value)},
        count=int(selection["count"]),
        n_views=selection["n_views"],
        named=named,
        tags={
            "backend": str(train.get("backend", cell["backend"])),
            "backend_version": str(train["version"]),
            "device": str(train["device"]),
            "machine": machine_words(train.get("machine")),
            "viewbench": str(train.get("viewbench", "")),
        },
        commit=str(train["commit"] or ""),
        scene_sha256=str(train.get("scene_sha256", "")),
        began_ms=min(began_ms, ended_ms),
        trained_ms=trained_ms,
        ended_ms=ended_ms,
    )


@contextlib.contextmanager
def _explained(cell: Mapping[str, str]) -> Iterator[None]:
    """Records that are not as viewbench writes them become UserError."""
    try:
        yield
    except OSError as error:
        raise UserError(f"cell {cell_name(cell)} cannot be read: {error.strerror}: {error.filename}") from None
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        raise UserError(f"the files of cell {cell_name(cell)} are not as viewbench writes them ({error!r})") from None


def _made_of(stamp: Any, kept: dict[Any, Made], key: Any, make: Callable[[], Any]) -> Any:
    """What `make` returned when the files that it reads had this stamp; it is called where they have another."""
    if key not in kept or kept[key][0] != stamp:
        kept[key] = (stamp, make())
    return kept[key][1]


def _stamp(path: Path) -> tuple[int, int]:
    """Tells a file from another one of its name."""
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def _time(text: Any) -> float | None:
    """Seconds since 1970 of a time in ISO 8601 with its zone."""
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        found = datetime.fromisoformat(text)
        return found.timestamp() if found.tzinfo else None
    return None


def _curve(points: list[dict[str, Any]], began_ms: int) -> list[tuple[str, float, int, int]]:
    """By step, and by when the trainer was there."""
    curve = []
    for point in points:
        seconds, step = point["seconds"] or 0.0, point["step"]
        if not (is_number(seconds) and is_number(step) and 0 <= seconds < LATEST_S and 0 <= step < LATEST_S):
            continue
        stamp = began_ms + round(1000 * seconds)
        for key, metric in (("loss", "train/loss"), ("test_psnr_db", "train/test_psnr_db")):
            if is_number(point.get(key)):
                curve.append((metric, point[key], stamp, int(step)))
    return curve


def _model(folder: Path, train: dict[str, Any], megabytes: int) -> list[tuple[Path, str | None]]:
    """The files of the model, where all of them together are no larger than this."""
    files = [folder / name for name in train.get("files", {}) if Path(name).name == name]
    files = [file for file in files if file.is_file() and not file.is_symlink()]
    if sum(file.stat().st_size for file in files) > megabytes * MB:
        return []
    return [(file, "model") for file in files]
