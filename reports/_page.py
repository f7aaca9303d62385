"""Puts everything that was drawn into index.html: one file that needs nothing beside it and no network."""

import base64
import io
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import __version__
from ..common import plugins
from ..common.errors import UserError
from ..common.files import write_text
from ..common.provenance import machine
from . import _findings, _items, _rooms, _study, _tracking_stamp
from ._items import Item
from ._study import OK, Study, and_list, counted, in_order, machine_words, missing_words, percent, selector_words

TEMPLATES = Path(__file__).parent / "templates"
HEAVY_BYTES = 300_000  # a larger PNG goes into the page as WebP; the PNG itself stays beside the page
LAST = 100  # place of a report that names none (ORDER)


@dataclass(frozen=True)
class Section:
    """One item as the template shows it."""

    anchor: str
    item: Item
    image: str = ""  # data URI of a figure
    width: int = 0  # pixels
    height: int = 0


def build(study_dir: Path) -> Path:
    """Writes results/STUDY/reports/index.html from the items of the study's reports; returns its path.

    Raises UserError when none has been drawn yet.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    study = _study.load(study_dir)
    out = study.folder / "reports"
    sections = _sections(study, out)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    html = environment.get_template("page.html").render(
        study=study,
        headline=[_tied(sentence) for sentence in verdict(study)],
        details=[_tied(sentence) for sentence in _findings.details(study)],
        grid=_grid_words(study),
        facts=_facts(study),
        dashboard=_tracking_stamp.newest(study.folder).get("figure", ""),
        sections=sections,
        failures=_failures(study),
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        script=(TEMPLATES / "page.js").read_text(encoding="utf-8"),
    )
    path = out / "index.html"
    write_text(path, html)
    return path


def verdict(study: Study) -> list[str]:
    """What came out of the study, in sentences, each with its interval."""
    return _rooms.headline(study) or _findings.headline(study)


def _sections(study: Study, out: Path) -> list[Section]:
    names = sorted(study.record["reports"], key=lambda name: (plugins.constant("reports", name, "ORDER", LAST), name))
    drawn = [name for name in names if _items.path(out, name).is_file()]
    if not drawn:
        raise UserError(f"no report of '{study.folder}' has been drawn; run `viewbench report {study.folder}`")
    items = [item for name in drawn for item in _items.read(out, name)]
    return [_section(f"item-{number}", item, out) for number, item in enumerate(items, start=1)]


def _section(anchor: str, item: Item, out: Path) -> Section:
    if item.kind != "figure":
        return Section(anchor, item)
    from PIL import Image

    data, kind = (out / item.files[0]).read_bytes(), "png"
    with Image.open(io.BytesIO(data)) as image:
        width, height = image.size
        if len(data) > HEAVY_BYTES:
            buffer = io.BytesIO()
            image.convert("RGB").save(buffer, format="WEBP", quality=90, method=4)
            data, kind = buffer.getvalue(), "webp"
    return Section(anchor, item, f"data:image/{kind};base64,{base64.b64encode(data).decode()}", width, height)


def _failures(study: Study) -> list[tuple[str, list[str]]]:
    """What went wrong, and the cells that it happened to."""
    groups: dict[str, list[str]] = {}
    for cell in study.failed:
        reason = cell.status if cell.status != OK else "the cell has no PSNR"
        words = f"{cell.scene}, {cell.backend}, {cell.selector}, {percent(cell.ratio)}, seed {cell.seed}"
        groups.setdefault(reason, []).append(words)
    return list(groups.items())


def _facts(study: Study) -> list[tuple[str, str]]:
    """What was run, where and when, as (what, value) pairs; what no file says is left out."""
    trains = [cell.read("train") for cell in study.done]
    devices = in_order(f"{train['device']}, {counted(train['threads'], 'thread')} per job" for train in trains)
    facts = [
        ("Scenes", and_list(_scene_words(study, scene) for scene in study.scenes)),
        ("Selectors", and_list(map(selector_words, study.record["selectors"]))),
        ("Ratios", and_list(map(percent, study.ratios))),
        ("Seeds", and_list(map(str, study.seeds))),
        ("Backends", "; ".join(_backend_words(study, entry, trains) for entry in study.record["backends"])),
        (
            "Reference",
            f"models on all views of each scene, {_seed_words(study, study.record['reference'])}, same budget"
            if study.record.get("reference")
            else "none",
        ),
        ("Image encoder", study.record.get("encoder", "")),
        (
            "Cells",
            f"{len(study.done)} of {len(study.cells)} scored" + (f", {missing_words(study)}" if study.failed else ""),
        ),
        ("Trained on", "; ".join(devices)),
        ("Page made on", machine_words(machine())),
        ("viewbench", and_list(in_order(cell.viewbench for cell in study.done)) or __version__),
        ("Commit", and_list(in_order(cell.commit for cell in study.done if cell.commit))),
        ("Tracking", _tracking_words(study.folder)),
        ("Results gathered", _date(study.folder / "results.csv")),
    ]
    return [(what, value) for what, value in facts if value]


def _tracking_words(folder: Path) -> str:
    """Why the cells were not logged, where they were not; the next run tries again."""
    skipped = _tracking_stamp.newest(folder).get("skipped", "")
    return f"not logged: {skipped}" if skipped else ""


def _grid_words(study: Study) -> str:
    """ "2 scenes × 5 selectors × 3 ratios × 3 seeds; 80 of 80 cells scored"."""
    counts = {
        "scene": len(study.scenes),
        "selector": len(study.selectors),
        "ratio": len(study.ratios),
        "seed": len(study.seeds),
        "backend": len(study.backends),
    }
    words = {what: counted(count, what) for what, count in counts.items()}
    seeds: dict[tuple[str, str], set[int]] = {}
    for cell in study.cells:
        seeds.setdefault((cell.backend, cell.selector), set()).add(cell.seed)
    if any(len(found) < len(study.seeds) for found in seeds.values()):
        words["seed"] = f"up to {words['seed']}"
    grid = " × ".join(words.values())
    return f"{grid}: {len(study.done)} of {len(study.cells)} cells scored"


def _seed_words(study: Study, reference: bool | list[int]) -> str:
    """ "3 seeds": of the reference, which may have fewer than the study."""
    return counted(len(study.seeds) if reference is True else len(reference or []), "seed")


def _scene_words(study: Study, scene: str) -> str:
    views = next((cell.n_views for cell in study.done if cell.scene == scene and cell.n_views), None)
    return scene if views is None else f"{scene} ({views} training views)"


def _backend_words(study: Study, entry: dict[str, Any], trains: list[dict[str, Any]]) -> str:
    """ "splat 1.0: 1,500 iterations at width 128"."""
    name = entry["name"]
    own = [train for cell, train in zip(study.done, trains, strict=True) if cell.backend == name]
    version = and_list(in_order(str(train["version"]) for train in own))
    limits = []
    if entry.get("iterations"):
        limits.append(f"{entry['iterations']:,} iterations")
    if entry.get("seconds"):
        limits.append(f"{entry['seconds']:g} s")
    width = f" at width {entry['width']}" if entry.get("width") else " at full width"
    options = "".join(f", {key}={value}" for key, value in (entry.get("options") or {}).items())
    part = ", a part of the grid" if entry.get("grid") else ""
    called = name if entry["backend"] == name else f"{name} ({entry['backend']})"
    return f"{called} {version}".strip() + f": {', '.join(limits)}{width}{options}{part}"


def _tied(text: str) -> str:
    """The text with units kept on the line of their numbers."""
    return text.replace(" dB", "\u00a0dB").replace(" %", "\u00a0%")


def _date(path: Path) -> str:
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(path.stat().st_mtime))
