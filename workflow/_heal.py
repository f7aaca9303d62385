"""Before a run: removes what a study cannot go on from, so that the jobs that made it are run again."""

import contextlib
import csv
import io
import sys
from pathlib import Path
from typing import Any

from ..backends._evaluate import altered_file
from ..common.cells import RECORDS, cell_folder
from ..common.errors import UserError
from ..common.files import read_json, sha256_file, unsealed
from ..common.holding import sweep
from ..reports._tracking_errors import NO_TRACKING
from ..scenes.features import array
from ._collect import COLUMNS, TABLE_SEAL
from ._study import Study


def heal(study: Study, results: Path, verify: bool = False) -> list[Path]:
    """Removes what is damaged, and what killed writers left; returns the files that it removed. `results` is
    results/STUDY.

    Records, choices, scores, descriptions, features and the table go that were edited or cut short, the record of a
    model whose files are not there or not as long as training left them, the score whose renders are not, and the
    stamp of logging that failed. Models and renders are read, and not only measured, with `verify`, since that may be
    gigabytes, and where a model has no score yet: evaluating it has failed, and would again.
    """
    sweep(results)
    broken = [path for path in (results / "selections").rglob("*.json") if not _sound(path)]
    tables = [results / "study.json", *(results / "scenes").glob("*.json"), *(results / "reports").glob("*.json")]
    broken += [path for path in tables if path.is_file() and not _sound(path)]
    broken += [path for path in (results / "features").glob("*.npy") if not _sound_array(path)]
    broken += [] if _sound_table(results) else [results / "results.csv"]
    for cell in study.cells():
        folder = cell_folder(results, cell)
        selection, train, metrics = (folder / file for file in RECORDS)
        broken += [path for path in (selection, train, metrics) if path.is_file() and not _sound(path)]
        if train.is_file() and not _whole_model(folder, verify or not metrics.is_file()):
            broken.append(train)
        if metrics.is_file() and not _whole_renders(folder, verify):
            broken.append(metrics)
    broken += [path for path in (results / "tracked.json", results / "published.json") if _failed(path)]
    for path in broken:
        path.unlink(missing_ok=True)
    return broken


def say(removed: list[Path]) -> None:
    """Tells the user which damaged results are made again, in one line; stamps of logging are none."""
    told = [path for path in removed if path.name not in ("tracked.json", "published.json")]
    # Of a cell it is the record that goes, whichever of its files is damaged.
    names = sorted({str(path.parent if "cells" in path.parts else path) for path in told})
    if names:
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        print(f"viewbench: damaged or altered, so made again: {names[0]}{more}", file=sys.stderr)


def _sound(path: Path) -> bool:
    """Whether a record can be read and is as it was sealed; items of a report are a list, and not sealed."""
    try:
        record = read_json(path)
        if isinstance(record, dict) or path.parent.name != "reports":
            unsealed(record, path.name)
    except (UserError, AttributeError):
        return False
    return True


def _sound_array(path: Path) -> bool:
    with contextlib.suppress(ValueError):
        array(path)
        return True
    return False


def _sound_table(results: Path) -> bool:
    """Whether results.csv is as `collect` wrote it; one without its hash has whole rows of today's columns."""
    table, seal = results / "results.csv", results / TABLE_SEAL
    if not table.is_file():
        return True
    if seal.is_file():
        return seal.read_text(encoding="utf-8").strip() == sha256_file(table)
    rows = list(csv.reader(io.StringIO(table.read_text(encoding="utf-8", errors="replace"))))
    return bool(rows) and all(len(row) == len(COLUMNS) for row in rows)


def _whole_model(folder: Path, read: bool) -> bool:
    """Whether all files of the model are there and as long as `train.json` says; with `read`, and as it says."""
    with contextlib.suppress(UserError, AttributeError, KeyError, TypeError, ValueError, OSError):
        train = read_json(folder / "train.json")
        if read:
            return altered_file(folder, train) is None
        return all(_has(folder / name, train.get("bytes", {}).get(name)) for name in train["files"])
    return False


def _whole_renders(folder: Path, read: bool) -> bool:
    """Whether all renders are there and as long as `metrics.json` says; with `read`, and as it says."""
    with contextlib.suppress(UserError, AttributeError, KeyError, TypeError, ValueError, OSError):
        views: list[dict[str, Any]] = read_json(folder / "metrics.json")["views"]
        whole = all(_has(folder / view["file"], view.get("bytes")) for view in views)
        return whole and (
            not read or all(view.get("sha256") in (None, sha256_file(folder / view["file"])) for view in views)
        )
    return False


def damage(folder: Path) -> str:
    """What is missing of a scored cell's files, or has another length, in words; "" where nothing is."""
    if not _whole_model(folder, read=False):
        return "files of the model are missing or cut short"
    return "" if _whole_renders(folder, read=False) else "renders are missing or cut short"


def _has(path: Path, size: int | None) -> bool:
    return path.stat().st_size == size if size is not None else path.is_file()


def _failed(stamp: Path) -> bool:
    """Whether logging to MLflow did not work then, or what it says of that cannot be read."""
    with contextlib.suppress(UserError, AttributeError):
        return stamp.is_file() and read_json(stamp).get("skipped") not in (None, NO_TRACKING)
    return True
