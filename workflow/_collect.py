"""Gathers a study's cells into `results.csv`: one row a cell, read from its JSON files.

Each of these files carries the hashes of what it was made from. A cell whose chain is broken, or is not of the scene
and the study as they are, is stale: a job that should have made it anew has failed.
"""

import csv
from pathlib import Path
from typing import Any

from .. import __version__
from ..backends import _evaluate, _registry, _train
from ..common.errors import UserError
from ..common.files import read_json, sha256_file, whole
from ..common.settings import Settings
from ..selectors import _run
from ..selectors._selection import count_of, selection_sha256
from ._study import AXES, Study

COLUMNS = (
    "study",
    "dataset",
    "scene",
    "backend",
    "selector",
    "ratio",
    "seed",
    "n_views",
    "count",
    "psnr_db",
    "ssim",
    "lpips",
    "select_s",
    "train_s",
    "evaluate_s",
    "iterations",
    "peak_rss_bytes",
    "peak_gpu_bytes",
    "commit",
    "scene_sha256",
    "selection_sha256",
    "viewbench",
    "status",
)


def cell_folder(results: Path, row: dict[str, str]) -> Path:
    """results/STUDY/cells/BACKEND/SCENE/SELECTOR/RATIO/SEED."""
    return results.joinpath("cells", *(row[key] for key in AXES))


def collect(study: Study, results: Path, settings: Settings, partial: bool = False) -> list[dict[str, Any]]:
    """Writes and returns the rows, in the order of the grid.

    `results` is results/STUDY. A cell whose files are not all there or do not fit together raises UserError, or with
    `partial` becomes a row with empty figures whose `status` is the last line of its log. `partial` is for what is left
    after a failure: then a cell made by other source code than today's is stale too.
    """
    rows = []
    for cell in study.cells():
        folder = cell_folder(results, cell)
        row: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {"study": study.name, "status": "ok"} | cell
        try:
            row |= _figures(
                study, cell, folder, results / "scenes" / f"{cell['scene']}.json", settings if partial else None
            )
        except UserError as error:
            if not partial:
                raise
            row["status"] = _last_words(results, cell, folder / "metrics.json") or str(error)
        rows.append(row)
    with whole(results / "results.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return rows


def without_stale(cells: list[dict[str, str]], results: Path) -> list[dict[str, str]]:
    """The cells that `results.csv` calls ok; all of them where it has not been written."""
    try:
        with open(results / "results.csv", newline="", encoding="utf-8") as file:
            sound = {tuple(row[axis] for axis in AXES) for row in csv.DictReader(file) if row["status"] == "ok"}
    except (OSError, KeyError):
        return cells
    return [cell for cell in cells if tuple(cell[axis] for axis in AXES) in sound]


def _figures(
    study: Study, cell: dict[str, str], folder: Path, scene_file: Path, code: Settings | None
) -> dict[str, Any]:
    selection = read_json(folder / "selection.json", "selection")
    train = read_json(folder / "train.json", "training record")
    metrics = read_json(folder / "metrics.json", "metrics")
    scene = read_json(scene_file, "scene description")
    _check(study, cell, folder, (scene, selection, train, metrics), code)
    values = {
        "dataset": scene["dataset"],
        "n_views": selection["n_views"],
        "count": selection["count"],
        "psnr_db": metrics["psnr_db"],
        "ssim": metrics["ssim"],
        "lpips": metrics["lpips"],
        "select_s": sum(selection["seconds"].values()),
        "train_s": train["seconds"],
        "evaluate_s": metrics["seconds"],
        "iterations": train["iterations"],
        "peak_rss_bytes": train["peak_rss_bytes"],
        "peak_gpu_bytes": train["peak_gpu_bytes"],
        "commit": train["commit"],
        "scene_sha256": scene["sha256"],
        "selection_sha256": train["selection_sha256"],
        "viewbench": train.get("viewbench", __version__),
    }
    return {key: "" if value is None else value for key, value in values.items()}


def _check(
    study: Study, cell: dict[str, str], folder: Path, records: tuple[dict[str, Any], ...], code: Settings | None
) -> None:
    """Raises UserError where one file of the cell was not made from the one before it, or is not what is asked for.

    With `code`, the settings in force, also where today's source code, or another backend, would make it anew.
    """
    scene, selection, train, metrics = records
    selector, backend = study.selector(cell["selector"]), study.backend(cell["backend"])
    budget = {"iterations": backend.iterations, "seconds": backend.seconds}
    seed = int(cell["seed"])
    asked = {
        "selection.json is of another version of the scene": (selection.get("scene_sha256"), scene["sha256"]),
        "selection.json is by another selector": (selection["selector"], selector.selector),
        "selection.json has another seed": (selection["seed"], seed if selector.seeded else study.seeds[0]),
        "selection.json has another count": (
            selection["count"],
            count_of(float(cell["ratio"]), scene["n_train"], study.count),
        ),
        "train.json is of another version of the scene": (train.get("scene_sha256"), scene["sha256"]),
        "train.json is of another selection": (train.get("selection_sha256"), selection_sha256(selection)),
        "train.json is by another backend": (train["backend"], backend.backend),
        "train.json has another seed": (train["seed"], seed),
        "train.json has another budget": (train["budget"], budget),
        "metrics.json is of another version of the scene": (metrics.get("scene_sha256"), scene["sha256"]),
        "metrics.json is of another training": (metrics.get("train_sha256"), sha256_file(folder / "train.json")),
    }
    for key, value in selector.parameters.items():
        asked[f"selection.json has another {key}"] = (selection["parameters"].get(key), value)
    for key, value in backend.options.items():
        asked[f"train.json has another {key}"] = (train["options"].get(key), value)
    if code is not None:
        of, trainer = scene["format"], _registry.load(backend.backend, code)
        asked |= {
            "selection.json is by other code": (selection.get("code_sha256"), _run.code_of(selector.selector, of)),
            "train.json is by other code": (train.get("code_sha256"), _train.code_of(backend.backend, of)),
            "train.json is by another version of the backend": (train["version"], _version(trainer)),
            "metrics.json is by other code": (
                metrics.get("code_sha256"),
                _evaluate.code_of(backend.backend, trainer, of),
            ),
        }
    for what, (found, expected) in asked.items():
        if found != expected:
            raise UserError(f"cell '{folder}' is stale: {what}; run the study again")


def _version(backend: Any) -> str:
    try:
        return backend.version()
    except UserError as error:  # a version that cannot be found out is none that a model could have
        return str(error)


def _logs(results: Path, cell: dict[str, str]) -> dict[Path, str]:
    """Logs of the steps that the cell needs, with the name of the step."""
    logs = results / "logs"
    in_cell = Path(*(cell[key] for key in AXES[:-1]), f"{cell['seed']}.log")
    found = {logs / step / in_cell: step for step in ("train", "evaluate")}
    found |= dict.fromkeys(logs.glob(f"select/{cell['scene']}/{cell['selector']}/*/*.log"), "select")
    return found | {logs / "features" / f"{cell['scene']}.log": "features"}


def _last_words(results: Path, cell: dict[str, str], score: Path) -> str:
    """Last line of the newest of the cell's logs since it had a score: the step that failed wrote it."""
    scored_at = score.stat().st_mtime_ns if score.is_file() else 0
    logs = {path: step for path, step in _logs(results, cell).items() if path.is_file()}
    logs = {path: step for path, step in logs.items() if path.stat().st_mtime_ns > scored_at}
    for path in sorted(logs, key=lambda path: path.stat().st_mtime_ns, reverse=True):
        lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
        if lines:
            return f"{logs[path]}: {lines[-1]}"
    return ""
