"""Results recorded on other machines, shown beside fresh ones and named as recorded."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..common.errors import UserError
from ..common.files import read_json
from . import _curves, _figures, _tables
from ._items import Item
from ._statistics import usual_n, with_spread
from ._study import FULL, Cell, Study, and_list, in_order, percent, read_cells
from ._style import styles
from ._tables import Entry, Table

ORDER = 60
FOLDER = Path(__file__).parent / "recorded"


@dataclass(frozen=True)
class Recording:
    """One folder of recorded results."""

    name: str
    title: str
    machine: Mapping[str, str]
    versions: Mapping[str, str]
    commands: tuple[str, ...]
    notes: str
    cells: tuple[Cell, ...]


def build(study: Study, out: Path) -> list[Item]:
    """A figure, a table and a text per recording that has a scene of this study; nothing where there is none."""
    items = []
    for recording in recordings(FOLDER):
        cells = tuple(cell for cell in recording.cells if cell.ok and cell.scene in study.scenes)
        if cells:
            shown = replace(recording, cells=cells)
            items += [_figure(study, shown, out), _table(shown, out), _about(study, shown)]
    return items


def recordings(folder: Path) -> list[Recording]:
    """Everything under `folder`, by name. Raises UserError for an about.json or results.csv that is broken."""
    return [read(path.parent) for path in sorted(folder.glob("*/about.json"))]


def read(folder: Path) -> Recording:
    """The recording in a folder. Raises UserError for an about.json or results.csv that is broken."""
    path = folder / "about.json"
    about = read_json(path, "recording")
    try:
        return Recording(
            name=folder.resolve().name,
            title=about["title"],
            machine=dict(about["machine"]),
            versions=dict(about["versions"]),
            commands=tuple(about["commands"]),
            notes=about.get("notes", ""),
            cells=read_cells(folder / "results.csv", folder / "cells"),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"recording '{path}' lacks or garbles {error}; see the README beside it") from None


def _figure(study: Study, recording: Recording, out: Path) -> Item:
    """Fresh panels and recorded ones of the same scenes, one scene after the other."""
    scenes = [scene for scene in study.scenes if any(cell.scene == scene for cell in recording.cells)]
    panels: list[tuple[str, list[Cell]]] = []
    for scene in scenes:
        for backend in study.backends:
            fresh = study.find(backend, scene)
            if fresh:
                panels.append((f"{scene} · {backend}, fresh", fresh))
        for backend in in_order(cell.backend for cell in recording.cells if cell.scene == scene):
            theirs = [cell for cell in recording.cells if (cell.scene, cell.backend) == (scene, backend)]
            panels.append((f"{scene} · {backend}, recorded", theirs))
    cells = [cell for _, here in panels for cell in here]
    present = {cell.selector for cell in cells}
    others = sorted(present - {*study.selectors, FULL})
    drawn = styles(name for name in (*study.selectors, *others, FULL) if name in present)
    with _figures.look():
        figure, axes = _figures.grid(len(panels), 4.3, 3.4, columns=2)
        for place, (title, here) in zip(axes, panels, strict=True):
            _curves.draw(place, here, drawn)
            place.set_title(title)
            if title.endswith(", recorded"):
                place.set_facecolor("#F3F3F3")
        _figures.legend(figure, drawn)
        fresh_records = _curves.records([cell for title, here in panels if title.endswith("fresh") for cell in here])
        records = [{"origin": "fresh", **record} for record in fresh_records]
        records += [{"origin": "recorded", **record} for record in _curves.records(recording.cells)]
        files = _figures.save(figure, out, f"recorded_{recording.name}", records)
    caption = (
        f"White panels: this run. Grey panels: recorded earlier, “{recording.title}”. Mean test PSNR and one standard "
        "deviation over seeds; hollow markers are one sample; dashed: all training views. Compare the order of the "
        "selectors; trainers, picture sizes and budgets may differ."
    )
    return Item(f"Recorded results beside fresh ones: {recording.title}", "figure", caption, files)


def _table(recording: Recording, out: Path) -> Item:
    selectors = in_order(cell.selector for cell in recording.cells if cell.selector != FULL)
    has_full = any(cell.selector == FULL for cell in recording.cells)
    rows = []
    for backend, scene in in_order((cell.backend, cell.scene) for cell in recording.cells):
        here = [cell for cell in recording.cells if (cell.backend, cell.scene) == (backend, scene)]
        found = _curves.summaries(here)
        expected = usual_n(found.values())
        for ratio in sorted({cell.ratio for cell in here if cell.selector != FULL}):
            items = [found.get((selector, ratio)) for selector in selectors]
            marks = _tables.best([None if item is None else item.mean for item in items], 2)
            row = [Entry(backend), Entry(scene), Entry(percent(ratio), ratio)]
            for item, mark in zip(items, marks, strict=True):
                text = "" if item is None else with_spread(item, 2, expected)
                row.append(Entry(text, None if item is None else item.mean, mark))
            if has_full:
                full = found.get((FULL, 1.0))
                row.append(Entry("" if full is None else with_spread(full, 2, 1), None if full is None else full.mean))
            rows.append(tuple(row))
    table = Table(("backend", "scene", "ratio", *selectors, *([FULL] if has_full else [])), tuple(rows), 3)
    files = _tables.save(table, out, f"table_recorded_{recording.name}", _curves.records(recording.cells))
    caption = "Test PSNR in dB, mean ± sample standard deviation over seeds; a figure without ± is one sample."
    return Item(f"Recorded: {recording.title}", "table", caption, files, table)


def _about(study: Study, recording: Recording) -> Item:
    """What made the recording, and where its scenes are not the files that this run read."""
    fresh = {cell.scene: cell.scene_sha256 for cell in study.done}
    other = in_order(c.scene for c in recording.cells if fresh.get(c.scene, c.scene_sha256) != c.scene_sha256)
    parts = [
        "Machine: " + ", ".join(f"{key} {value}" for key, value in recording.machine.items()) + ".",
        "Versions: " + ", ".join(f"{key} {value}" for key, value in recording.versions.items()) + ".",
        "Commands: " + "; ".join(recording.commands),
    ]
    if other:
        parts.append(f"The files of {and_list(other)} differ from those that this run read.")
    if recording.notes:
        parts.append(recording.notes)
    return Item(f"How “{recording.title}” was recorded", "text", "\n\n".join(parts))
