"""What must be in MLflow when a study has been logged, asked of the server itself."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from statistics import mean
from typing import Any

from tests.conftest import known
from tests.server.machines import PASSWORD, Study, names
from viewbench.common.cells import RECORDS, cell_folder, cell_name
from viewbench.common.settings import Tracking, load
from viewbench.reports._tracked_run import CELL, KIND, PARENT, REPORT, SUMMARY
from viewbench.reports._tracked_summary import by_group, key_of

NUMBERS = ("psnr_db", "ssim", "train_s", "evaluate_s", "select_s")
PLACES = 9  # of a number that is compared


def runs_of(where: str, study: str, deleted: bool = False) -> tuple[Any, list[Any]]:
    """Client, and the runs of a study, or those that were removed."""
    from mlflow import MlflowClient
    from mlflow.entities import ViewType

    client, found, token = MlflowClient(tracking_uri=where), [], None
    experiment = known(client.get_experiment_by_name(study)).experiment_id
    kind = ViewType.DELETED_ONLY if deleted else ViewType.ACTIVE_ONLY
    while True:
        page = client.search_runs([experiment], run_view_type=kind, max_results=1000, page_token=token)
        found += page
        token = page.token
        if not token:
            return client, found


def check(study: Study, results: Path, where: str, page: bool = False) -> str:
    """Raises AssertionError where something is missing, doubled or not whole; else says what is there, in figures.

    `results` is results/STUDY of one who has all cells; with `page` there is a run that has the page.
    """
    client, runs = runs_of(where, study.name)
    states = Counter(run.info.status for run in runs)
    assert set(states) == {"FINISHED"}, states
    kinds: dict[str, list[Any]] = {"cell": [], "summary": [], "report": []}
    for run in runs:
        kinds[run.data.tags[KIND]].append(run)
    cells, summaries = kinds["cell"], {run.info.run_id: run for run in kinds["summary"]}
    groups = by_group(study.cells)
    assert_one_each([run.data.tags[CELL] for run in cells], names(study))
    assert_one_each([run.data.tags[SUMMARY] for run in summaries.values()], [key_of(group) for group in groups])
    assert_one_each([run.data.tags[REPORT] for run in kinds["report"]], [study.name] * page)
    numbers, files = 0, Counter[int]()
    for run in cells:
        name = run.data.tags[CELL]
        parent = summaries.get(run.data.tags[PARENT])
        assert parent, f"the summary of {name} was removed"
        assert name.startswith(f"{parent.data.tags[SUMMARY]}/")
        folder = results / "cells" / name
        records = figures_of(folder)
        assert {key: run.data.metrics[key] for key in NUMBERS} == records, name
        assert len(known(run.inputs).dataset_inputs) == 1, name
        numbers += assert_curve(client, run.info.run_id, folder)
        files[assert_files(artifacts_of(run, where), folder, load().tracking)] += 1
    points = 0
    by_key = {key_of(group): members for group, members in groups.items()}
    for run in summaries.values():
        points += assert_points(client, run.info.run_id, results, by_key[run.data.tags[SUMMARY]])
    removed = len(runs_of(where, study.name, deleted=True)[1])
    return (
        f"{len(cells)} cells and {len(summaries)} summaries with one finished run each, all children of a living one; "
        f"{points} points, {numbers} numbers of curves, files a cell {dict(files)}; {removed} runs removed on the way"
    )


def assert_one_each(found: list[str], wanted: list[str]) -> None:
    """All of the names, each once."""
    each = Counter(found)
    assert sorted(each) == sorted(wanted), f"{len(each)} of {len(wanted)}: {sorted(set(wanted) ^ set(each))[:3]}"
    assert set(each.values()) <= {1}, each.most_common(3)


def figures_of(folder: Path) -> dict[str, float]:
    """Scores and seconds as the records of a cell have them."""
    selection, train, metrics = (json.loads((folder / name).read_text(encoding="utf-8")) for name in RECORDS)
    return {
        "psnr_db": metrics["psnr_db"],
        "ssim": metrics["ssim"],
        "train_s": train["seconds"],
        "evaluate_s": metrics["seconds"],
        "select_s": sum(selection["seconds"].values()),
    }


def assert_curve(client: Any, run: str, folder: Path) -> int:
    """Each number of the training's curve once; how many there are."""
    curve = json.loads((folder / "train.json").read_text(encoding="utf-8"))["curve"]
    wanted = [(point["step"], point["loss"]) for point in curve if point["loss"] is not None]
    found = [(point.step, point.value) for point in client.get_metric_history(run, "train/loss")]
    assert sorted(found) == sorted(wanted), folder
    return len(found)


def assert_files(artifacts: Any, folder: Path, tracking: Tracking) -> int:
    """Records and models as long as they are here, so many strips, and the figure; how many files there are."""
    found = sizes_of(artifacts)
    train = json.loads((folder / "train.json").read_text(encoding="utf-8"))
    whole = {name: folder / name for name in RECORDS} | {f"model/{name}": folder / name for name in train["files"]}
    assert {name: found.get(name) for name in whole} == {name: path.stat().st_size for name, path in whole.items()}
    strips = [name for name in found if name.startswith("renders/")]
    assert len(strips) == tracking.renders, strips
    assert set(found) == {*whole, *strips, "cameras.png"}, found
    assert all(found.values()), found
    return len(found)


def artifacts_of(run: Any, where: str) -> Any:
    """What the server has of a run's files, with fewer questions than its client asks."""
    from mlflow.store.artifact.artifact_repository_registry import get_artifact_repository

    return get_artifact_repository(run.info.artifact_uri, tracking_uri=where)


def sizes_of(artifacts: Any, below: str | None = None) -> dict[str, int]:
    """Bytes of the files, by path."""
    found: dict[str, int] = {}
    for item in artifacts.list_artifacts(below):
        found |= sizes_of(artifacts, item.path) if item.is_dir else {item.path: item.file_size}
    return found


def assert_points(client: Any, run: str, results: Path, members: list[Mapping[str, str]]) -> int:
    """Each ratio once, with the mean over its seeds; how many points there are."""
    seeds: dict[int, list[dict[str, float]]] = {}
    for cell in members:
        seeds.setdefault(round(100 * float(cell["ratio"])), []).append(figures_of(cell_folder(results, cell)))
    drawn = {f"{key}/{members[0]['scene']}": key for key in ("psnr_db", "ssim", "train_s")}
    for metric, key in {**{key: key for key in NUMBERS}, **drawn}.items():
        found = client.get_metric_history(run, metric)
        wanted = sorted((step, round(mean(one[key] for one in here), PLACES)) for step, here in seeds.items())
        assert sorted((point.step, round(point.value, PLACES)) for point in found) == wanted, (metric, members[0])
    history = client.get_metric_history(run, "n_seeds")
    assert {point.step: point.value for point in history} == {step: len(here) for step, here in seeds.items()}
    return len(history)


def has_password(folder: Path) -> list[Path]:
    """Files in which the password is."""
    return [path for path in folder.rglob("*") if path.is_file() and PASSWORD.encode() in path.read_bytes()]


def missing(where: str, study: Study) -> int:
    """Cells that have no finished run yet."""
    _, runs = runs_of(where, study.name)
    done = {run.data.tags.get(CELL) for run in runs if run.info.status == "FINISHED"}
    return len({cell_name(cell) for cell in study.cells} - done)
