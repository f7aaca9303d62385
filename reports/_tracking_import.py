"""Brings results into MLflow that were made elsewhere: a recording, or the folder results/STUDY of another machine."""

import hashlib
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from ..common.cells import AXES, cell_name
from ..common.errors import UserError
from ..common.files import read_json
from ..common.settings import Tracking
from . import _about, _study, _tracked_cell, _tracked_link, _tracking, _tracking_page, recorded
from . import _tracking_turn as turns
from ._study import FULL, Cell, in_order
from ._tracked_cell import Cells, Facts, StudyCells
from ._tracked_run import Content

NAME = re.compile(r"[\w(][\w ., ()-]{0,99}")  # of an experiment; a folder of artifacts is called so, too
FIGURES = ("psnr_db", "ssim", "lpips", "select_s", "train_s", "evaluate_s", "peak_rss_bytes")


class TableCells:
    """The cells of a results.csv without their files; `when_ms` stands for the times, which it does not have."""

    def __init__(self, about: _about.About, cells: Mapping[str, Cell], when_ms: int, machine: str = ""):
        self.about, self.cells, self.when_ms, self.machine = about, cells, when_ms, machine

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
            tags={
                key: value
                for key, value in {"viewbench": row.viewbench, "machine": self.machine, "backend": row.backend}.items()
                if value
            },
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

    def made(self, cell: Mapping[str, str], fingerprint: str) -> bool:
        """Never: a recording makes no cells."""
        return False

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
    """Logs the folder into the experiment `name`; returns what `_tracking.track` does, and the address of Figure 4.

    Where no name is given, a recording (about.json, results.csv) goes into "NAME, recorded", and a folder of a study,
    with files, curves and page, into "NAME, imported", so that neither meets runs of this machine. Raises UserError for
    a folder that is neither, and for a name that is none.
    """
    if not tracking.uri:
        raise UserError("tracking.uri is empty: there is nothing to log to")
    if (folder / "study.json").is_file():
        about, cells, source = _study_folder(folder, name, tracking)
    elif (folder / "about.json").is_file():
        about, cells, source = _recording(folder, name)
    else:
        raise UserError(
            f"'{folder}' is no recording and no study: it has neither about.json nor study.json (give "
            "reports/recorded/NAME or results/STUDY)"
        )
    if not NAME.fullmatch(about.name):
        raise UserError(f"{about.name[:60]!r} is no name of an experiment: letters, digits, spaces and . , _ - ( )")
    with turns.turn(tracking, about.name, None, f"import {os.getpid()}"):
        done = _tracking.put(about, cells, source, tracking, progress, say, place=turns.place(folder))
        page = folder / "reports" / "index.html"
        if isinstance(source, StudyCells) and page.is_file() and not page.is_symlink():
            done |= _tracking_page.publish(about, folder, tracking)
    return {**done, "figure": _tracked_link.address(tracking.uri, str(done["experiment"]))}


def _study_folder(folder: Path, name: str | None, tracking: Tracking) -> tuple[_about.About, list, Cells]:
    study = _study.load(folder)
    about = _about.of_study(
        {**study.record, "name": name or f"{study.name}, imported"}, map(_axes, study.cells), study.name
    )
    about = replace(about, source=f"viewbench track --import {folder}", ours=False)
    return about, [_axes(cell) for cell in study.done], StudyCells(about, folder, tracking)


def _recording(folder: Path, name: str | None) -> tuple[_about.About, list, Cells]:
    recording = recorded.read(folder)
    cells = {cell_name(_axes(cell)): cell for cell in recording.cells if cell.ok}
    if not cells:
        raise UserError(f"recording '{folder}' has no cell with a score")
    grid = [_axes(cell) for cell in cells.values()]
    machine = ", ".join(f"{key} {value}" for key, value in recording.machine.items())
    words = [
        f"**{recording.title}**",
        f"Machine: {machine}.",
        "Versions: " + ", ".join(f"{key} {value}" for key, value in recording.versions.items()) + ".",
        "Commands: " + "; ".join(f"`{command}`" for command in recording.commands),
        recording.notes,
    ]
    about = _about.About(
        name=name or f"{recording.name}, recorded",
        title=f"{recording.name}: results that were recorded",
        description="\n\n".join(word for word in words if word),
        source=f"viewbench track --import {folder}",
        selectors=tuple(in_order(cell["selector"] for cell in grid if cell["selector"] != FULL)),
        grid=tuple(grid),
        ours=False,
    )
    return about, grid, TableCells(about, cells, _recorded_ms(folder), machine)


def _axes(cell: Cell) -> dict[str, str]:
    """A cell's names as folders and grids spell them."""
    values = {axis: getattr(cell, axis) for axis in AXES}
    return {axis: repr(float(value)) if axis == "ratio" else str(value) for axis, value in values.items()}


def _recorded_ms(folder: Path) -> int:
    """When the recording was made, where about.json says so ("date"), else when its table was written."""
    from datetime import UTC, datetime

    date = read_json(folder / "about.json", "recording").get("date")
    try:
        found = datetime.fromisoformat(str(date))
        return round(1000 * (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp())
    except ValueError:
        return round(1000 * (folder / "results.csv").stat().st_mtime)
