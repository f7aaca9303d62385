"""Brings results into MLflow that were made elsewhere: a recording, or the folder results/STUDY of another machine."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..common.cells import AXES, cell_name
from ..common.errors import UserError
from ..common.files import read_json
from ..common.settings import Tracking
from . import _about, _study, _tracked_cell, _tracking, _tracking_page, recorded
from ._study import FULL, Cell, in_order
from ._tracked_cell import Facts
from ._tracked_run import Content

FIGURES = ("psnr_db", "ssim", "lpips", "select_s", "train_s", "evaluate_s", "peak_rss_bytes")


class TableCells:
    """The cells of a results.csv without their files; `when_ms` stands for the times, which it does not have."""

    def __init__(self, about: _about.About, cells: Mapping[str, Cell], when_ms: int):
        self.about, self.cells, self.when_ms = about, cells, when_ms

    def facts(self, cell: Mapping[str, str]) -> Facts:
        """From the row of the table."""
        row = self.cells[cell_name(cell)]
        figures = {key: getattr(row, key) for key in FIGURES}
        seconds = sum(figures[key] or 0.0 for key in ("select_s", "train_s", "evaluate_s"))
        began_ms = self.when_ms - round(1000 * seconds)
        return Facts(
            cell=cell,
            figures={key: value for key, value in figures.items() if value is not None},
            count=row.count or 0,
            n_views=row.n_views,
            named={},
            tags={"viewbench": row.viewbench} if row.viewbench else {},
            commit=row.commit,
            scene_sha256=row.scene_sha256,
            began_ms=began_ms,
            trained_ms=began_ms,
            ended_ms=self.when_ms,
        )

    def fingerprint(self, cell: Mapping[str, str]) -> str:
        """The hash of the row."""
        row = {key: value for key, value in asdict(self.cells[cell_name(cell)]).items() if key != "folder"}
        told = hashlib.sha256(repr(sorted(row.items())).encode()).hexdigest()
        return _tracked_cell.fingerprint(told, cell, self.about)

    def content(self, cell: Mapping[str, str], parent: dict[str, str], drawn: Path) -> Content:
        """Without files and curve, which a recording does not have."""
        return _tracked_cell.content(self.facts(cell), self.about, {}, parent)

    def scene(self, name: str) -> dict[str, Any]:
        """Nothing: the table describes no scenes."""
        return {}


def bring(
    folder: Path,
    name: str | None,
    tracking: Tracking,
    progress: Callable[[int, int | None, str], None],
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Logs the folder into the experiment `name`; returns what `_tracking.track` does.

    A recording (about.json, results.csv) goes into "NAME, recorded" where no name is given, so that it does not meet
    fresh runs; a folder of a study into the experiment of that study, with files, curves and page. Raises UserError for
    a folder that is neither.
    """
    if not tracking.uri:
        raise UserError("tracking.uri is empty: there is nothing to log to")
    if (folder / "study.json").is_file():
        return _study_folder(folder, name, tracking, progress, say)
    if (folder / "about.json").is_file():
        return _recording(folder, name, tracking, progress, say)
    raise UserError(
        f"'{folder}' is no recording and no study: it has neither about.json nor study.json (give "
        "reports/recorded/NAME or results/STUDY)"
    )


def _study_folder(folder: Path, name: str | None, tracking: Tracking, progress: Any, say: Any) -> dict[str, Any]:
    study = _study.load(folder)
    grid = [_axes(cell) for cell in study.cells]
    about = _about.of_study({**study.record, "name": name or study.name}, grid, f"{study.name}.yaml")
    done = _tracking.track(about, [_axes(cell) for cell in study.done], folder, tracking, progress, say)
    if (folder / "reports" / "index.html").is_file():
        done |= _tracking_page.publish(about, folder, tracking)
    return done


def _recording(folder: Path, name: str | None, tracking: Tracking, progress: Any, say: Any) -> dict[str, Any]:
    recording = recorded.read(folder)
    cells = {cell_name(_axes(cell)): cell for cell in recording.cells if cell.ok}
    if not cells:
        raise UserError(f"recording '{folder}' has no cell with a score")
    grid = [_axes(cell) for cell in cells.values()]
    words = [
        f"**{recording.title}**",
        "Machine: " + ", ".join(f"{key} {value}" for key, value in recording.machine.items()) + ".",
        "Versions: " + ", ".join(f"{key} {value}" for key, value in recording.versions.items()) + ".",
        "Commands: " + "; ".join(f"`{command}`" for command in recording.commands),
        recording.notes,
    ]
    about = _about.About(
        name=name or f"{recording.name}, recorded",
        title=f"{recording.name}: results that were recorded",
        description="\n\n".join(word for word in words if word),
        source=f"viewbench track --import {recording.name}",
        selectors=tuple(in_order(cell["selector"] for cell in grid if cell["selector"] != FULL)),
        grid=tuple(grid),
    )
    when_ms = _recorded_ms(folder)
    return _tracking.put(about, grid, TableCells(about, cells, when_ms), tracking, progress, say)


def _axes(cell: Cell) -> dict[str, str]:
    """A cell's names as folders and grids spell them."""
    values = {axis: getattr(cell, axis) for axis in AXES}
    return {axis: repr(float(value)) if axis == "ratio" else str(value) for axis, value in values.items()}


def _recorded_ms(folder: Path) -> int:
    """When the recording was made, where about.json says so ("date"), else when its table was written."""
    from datetime import UTC, datetime

    date = read_json(folder / "about.json", "recording").get("date")
    try:
        return round(1000 * datetime.fromisoformat(str(date)).replace(tzinfo=UTC).timestamp())
    except ValueError:
        return round(1000 * (folder / "results.csv").stat().st_mtime)
