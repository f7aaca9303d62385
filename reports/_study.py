"""Reads a finished study from its folder: the study file, the table of cells, and each cell's JSON files."""

import csv
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..common.files import read_json
from ._study_kinds import check_kinds, check_record, check_scene

FULL = "full"  # the selector name of the full-data reference
OK = "ok"
LARGEST = 1e100  # of a figure: its square is a number, too
NOT_RUN = "not run yet"  # the study was stopped before it came to the cell


@dataclass(frozen=True)
class Cell:
    """One row of results.csv. Figures are None where the cell failed or the metric was not computed."""

    scene: str
    backend: str
    selector: str
    ratio: float
    seed: int
    n_views: int | None  # training views of the scene
    count: int | None  # views chosen
    psnr_db: float | None
    ssim: float | None
    lpips: float | None
    select_s: float | None
    train_s: float | None
    evaluate_s: float | None
    peak_rss_bytes: int | None
    commit: str
    scene_sha256: str
    viewbench: str
    status: str  # "ok", "not run yet", or what went wrong
    folder: Path  # of selection.json, train.json, metrics.json and renders/

    @property
    def ok(self) -> bool:
        """Whether the cell has a score."""
        return self.status == OK and self.psnr_db is not None

    def read(self, name: str) -> dict[str, Any]:
        """The cell's "selection", "train" or "metrics" file; raises UserError when it is missing or broken."""
        path = self.folder / f"{name}.json"
        record = read_json(path, name)
        try:
            check_record(name, record)
        except KeyError as error:
            raise UserError(f"{name} '{path}' has no {error} as viewbench writes it; run the study again") from None
        return record


@dataclass(frozen=True)
class SceneInfo:
    """Where a scene's cameras are, as `viewbench describe` wrote it."""

    name: str
    room: str
    walk: str  # how the camera went; empty where nothing says so
    n_train: int
    n_test: int
    train_positions: list[list[float]]  # (n_train, 3) scene units
    train_forward: list[list[float]]  # (n_train, 3) unit viewing directions
    test_positions: list[list[float]]  # (n_test, 3)
    points: list[list[float]]  # (P, 6) x, y, z, r, g, b; empty where the scene has none
    seen: tuple[float, ...]  # (n_test,) shares of the pixels that training views see; empty where it is not known
    truth: Path  # folder of the test images as they were compared with; may be absent


@dataclass(frozen=True)
class Study:
    """A study's grid in the order of its file, and its cells."""

    folder: Path
    name: str
    title: str
    description: str
    scenes: tuple[str, ...]
    selectors: tuple[str, ...]  # names that results carry, without the full-data reference
    ratios: tuple[float, ...]  # ascending
    seeds: tuple[int, ...]
    backends: tuple[str, ...]
    record: dict[str, Any]  # all of study.json
    cells: tuple[Cell, ...]

    @cached_property
    def done(self) -> tuple[Cell, ...]:
        """The cells that have a score."""
        return tuple(cell for cell in self.cells if cell.ok)

    @cached_property
    def failed(self) -> tuple[Cell, ...]:
        """The cells that have none."""
        return tuple(cell for cell in self.cells if not cell.ok)

    def middle_ratio(self, backend: str | None = None) -> float:
        """The ratio that figures of a single ratio show: the middle one of those of the backend, or of the study."""
        ratios = self.ratios if backend is None else self.ratios_of(backend)
        return ratios[(len(ratios) - 1) // 2]

    @property
    def first_seed(self) -> int:
        """The seed that figures of a single run show."""
        return self.seeds[0]

    def panels(self) -> list[tuple[str, str]]:
        """(backend, scene) pairs with at least one score, in the order of the study file."""
        present = {(cell.backend, cell.scene) for cell in self.done}
        return [(b, s) for b in self.backends for s in self.scenes if (b, s) in present]

    def label(self, backend: str, scene: str) -> str:
        """Name of a panel; the backend is left out where there is only one."""
        return scene if len(self.backends) == 1 else f"{scene} · {backend}"

    def find(
        self,
        backend: str | None = None,
        scene: str | None = None,
        selector: str | None = None,
        ratio: float | None = None,
        seed: int | None = None,
    ) -> list[Cell]:
        """The cells with a score that match every value given."""
        wanted = {"backend": backend, "scene": scene, "selector": selector, "ratio": ratio, "seed": seed}
        wanted = {key: value for key, value in wanted.items() if value is not None}
        return [cell for cell in self.done if all(getattr(cell, key) == value for key, value in wanted.items())]

    def full(self, backend: str, scene: str) -> Cell | None:
        """The full-data reference of the first seed that has one."""
        return next(iter(self.find(backend, scene, FULL)), None)

    def asks(self, backend: str, selector: str) -> bool:
        """Whether the part of the grid that a backend runs has this selector."""
        return selector in self._grid_of(backend).get("selectors", self.selectors)

    def ratios_of(self, backend: str) -> tuple[float, ...]:
        """The ratios that a backend runs, all of the study's unless the study says otherwise; ascending."""
        return tuple(sorted(self._grid_of(backend).get("ratios", self.ratios)))

    def _grid_of(self, backend: str) -> dict[str, Any]:
        """The part of the grid that a backend runs; empty for all of it."""
        grids: dict[str, dict[str, Any]] = {entry["name"]: entry.get("grid", {}) for entry in self.record["backends"]}
        return grids.get(backend, {})

    def scene(self, name: str) -> SceneInfo:
        """Cameras of a scene; raises UserError when its description is missing or lacks a part."""
        path = self.folder / "scenes" / f"{name}.json"
        record = read_json(path, "scene description")
        try:
            check_scene(record)
            return SceneInfo(
                name=name,
                room=record.get("room") or name,
                walk=record.get("walk") or "",
                n_train=record["n_train"],
                n_test=record["n_test"],
                train_positions=record["train"]["positions"],
                train_forward=record["train"]["forward"],
                test_positions=record["test"]["positions"],
                points=record["points"] or [],
                seen=tuple(record.get("seen") or ()),
                truth=path.with_suffix(""),
            )
        except (KeyError, TypeError) as error:
            raise UserError(f"scene description '{path}' lacks {error}; delete it and run the study again") from None


def load(study_dir: Path) -> Study:
    """Reads results/STUDY.

    Raises UserError when study.json or results.csv is missing, broken, or has no cells.
    """
    folder = Path(study_dir)
    record = read_json(folder / "study.json", "study")
    cells = read_cells(folder / "results.csv", folder / "cells")
    try:
        check_kinds(record)
        return Study(
            folder=folder,
            name=record["name"],
            title=record["title"],
            description=record["description"],
            scenes=tuple(record["scenes"]),
            selectors=tuple(entry["name"] for entry in record["selectors"]),
            ratios=tuple(sorted(record["ratios"])),
            seeds=tuple(record["seeds"]),
            backends=tuple(entry["name"] for entry in record["backends"]),
            record=record,
            cells=cells,
        )
    except (KeyError, TypeError) as error:
        raise UserError(f"study '{folder / 'study.json'}' lacks {error}; delete it and run the study again") from None


def read_cells(path: Path, folder: Path) -> tuple[Cell, ...]:
    """The rows of a results.csv whose cells lie in `folder`; raises UserError when there are none or one is garbled."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise UserError(f"results '{path}' cannot be read: {error.strerror or error}; run the study first") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"results '{path}' is not a CSV file in UTF-8: {error}") from None
    if not rows:
        raise UserError(f"results '{path}' has no cells; run the study first")
    cells = []
    for line, row in enumerate(rows, start=2):
        try:
            cells.append(_cell(row, folder))
        except (KeyError, ValueError, TypeError) as error:
            raise UserError(f"results '{path}', line {line}: {error!r}; write it anew by `viewbench collect`") from None
    return tuple(cells)


def in_order(values: Iterable[Any]) -> list[Any]:
    """The distinct values in order of first appearance."""
    return list(dict.fromkeys(values))


def percent(ratio: float) -> str:
    """A ratio for people: "5 %", "0.5 %"."""
    return f"{ratio * 100:.4g} %"


def and_list(words: Iterable[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    items = list(words)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def counted(count: int, what: str) -> str:
    """ "1 seed", "3 seeds"."""
    return f"{count} {what}{'s' if count != 1 else ''}"


def selector_words(entry: dict[str, Any]) -> str:
    """A selector of study.json for people: "maxmin", "logdet-sample (logdet, sample=True)", "coverage (3 seeds)"."""
    parts = [] if entry["selector"] == entry["name"] else [entry["selector"]]
    for key, value in (entry.get("parameters") or {}).items():
        parts.append(f"{key}={'+'.join(map(str, value)) if isinstance(value, list) else value}")
    if entry.get("seeds"):
        parts.append(counted(len(entry["seeds"]), "seed"))
    return f"{entry['name']} ({', '.join(parts)})" if parts else entry["name"]


def machine_words(record: Any) -> str:
    """A machine as `common.provenance` records it, for people: "AMD EPYC, 2 CPUs, Linux x86_64, Python 3.11.7"; empty
    for what is no record of one."""
    if not isinstance(record, dict):
        return ""
    parts = [record.get("cpu"), f"{record['cpus']} CPUs" if "cpus" in record else None, record.get("system")]
    parts.append(f"Python {record['python']}" if "python" in record else None)
    return ", ".join(str(part) for part in parts if part)


def failures_note(study: Study) -> str:
    """A sentence for captions when cells are missing; empty otherwise."""
    return f" Left out of {len(study.cells)} cells: {missing_words(study)}." if study.failed else ""


def missing_words(study: Study) -> str:
    """How many cells failed and how many were not run yet, without those that are none."""
    unrun = sum(cell.status == NOT_RUN for cell in study.failed)
    words = ((len(study.failed) - unrun, "failed"), (unrun, "not run yet"))
    return " and ".join(f"{count} {what}" for count, what in words if count)


def _cell(row: dict[str, str], folder: Path) -> Cell:
    if not 0 < float(row["ratio"]) <= 1:
        raise ValueError(f"a ratio of {row['ratio'][:40]}")
    return Cell(
        scene=row["scene"],
        backend=row["backend"],
        selector=row["selector"],
        ratio=float(row["ratio"]),
        seed=int(row["seed"]),
        n_views=_whole_number(row["n_views"]),
        count=_whole_number(row["count"]),
        psnr_db=_number(row["psnr_db"]),
        ssim=_number(row["ssim"]),
        lpips=_number(row["lpips"]),
        select_s=_number(row["select_s"]),
        train_s=_number(row["train_s"]),
        evaluate_s=_number(row["evaluate_s"]),
        peak_rss_bytes=_whole_number(row["peak_rss_bytes"]),
        commit=row["commit"],
        scene_sha256=row["scene_sha256"],
        viewbench=row.get("viewbench") or "",
        status=row.get("status") or OK,
        folder=folder.joinpath(*(row[name] for name in ("backend", "scene", "selector", "ratio", "seed"))),
    )


def _number(text: str) -> float | None:
    value = float(text) if text else math.nan
    if LARGEST < abs(value) < math.inf:
        raise ValueError(f"{text[:40]} is no figure")
    return value if math.isfinite(value) else None


def _whole_number(text: str) -> int | None:
    value = _number(text)
    return None if value is None else round(value)
