"""A study through Snakemake in a copy of the package that the test may edit: what runs, and what runs again."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import copy_package, environment_of

STUDY = """
title: A study of two cells
scenes: [room_human]
selectors: [uniform, maxmin]
ratios: [0.02]
seeds: [0]
backends: [splat]
width: 48
budget: {iterations: 20}
encoder: none
reference: false
reports: [psnr_over_ratio, table_psnr]
"""


class Clone:
    """A copy of viewbench in which a study is run."""

    def __init__(self, parent: Path):
        self.folder = copy_package(parent)
        self.cells = self.folder / "results" / "mini" / "cells" / "splat" / "room_human"
        (self.folder / "workflow" / "studies" / "mini.yaml").write_text(STUDY, encoding="utf-8")
        self.environment = environment_of(self.folder)

    def snakemake(self, *arguments: str, study: str = "mini", **variables: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "snakemake", "-j2", *arguments, "--config", f"study={study}", "--", "reports"]
        return subprocess.run(
            command, cwd=self.folder, env={**self.environment, **variables}, capture_output=True, text=True, timeout=300
        )

    def run(self, **variables: str) -> str:
        done = self.snakemake(**variables)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def planned(self) -> dict[str, int]:
        """Jobs by rule that a run would do now."""
        done = self.snakemake("-n")
        assert done.returncode == 0, done.stdout + done.stderr
        table = done.stdout + done.stderr
        jobs = {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)}
        jobs.pop("total", None)
        return jobs

    def edit(self, name: str) -> None:
        path = self.folder / name
        path.write_text(path.read_text(encoding="utf-8") + "\n# edited\n", encoding="utf-8")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    clone = Clone(tmp_path_factory.mktemp("finished"))
    assert clone.planned()["evaluate"] == 2
    shown = clone.run()
    assert "2 of 2 cells" in shown
    return clone


@pytest.fixture
def clone(finished, tmp_path):
    """The finished study in a copy of its own; times of files are kept, so that nothing looks changed."""
    other = Clone.__new__(Clone)
    other.folder = tmp_path / "viewbench"
    subprocess.run(["cp", "-a", str(finished.folder), str(other.folder)], check=True)
    other.cells = other.folder / finished.cells.relative_to(finished.folder)
    other.environment = environment_of(other.folder)
    assert other.planned() == {}
    return other


AFTER = {"collect": 1, "track": 1, "report": 2, "page": 1, "reports": 1}


def test_a_finished_study_is_not_run_again(clone):
    before = {path: path.stat().st_mtime_ns for path in clone.cells.rglob("*.json")}
    clone.run()
    assert {path: path.stat().st_mtime_ns for path in clone.cells.rglob("*.json")} == before


def test_editing_a_selector_reruns_its_cells_only(clone):
    clone.edit("selectors/maxmin.py")
    assert clone.planned() == {"select": 1, "train": 1, "evaluate": 1, **AFTER}


def test_editing_a_report_reruns_that_report_only(clone):
    clone.edit("reports/psnr_over_ratio.py")
    assert clone.planned() == {"report": 1, "page": 1, "reports": 1}


def test_editing_the_trainer_keeps_the_selections(clone):
    clone.edit("backends/splat/__init__.py")
    planned = clone.planned()
    assert "select" not in planned
    assert planned["train"] == 2


def test_editing_the_scoring_keeps_the_models(clone):
    clone.edit("backends/_metrics.py")
    planned = clone.planned()
    assert planned["evaluate"] == 2
    assert "select" not in planned


def test_a_deleted_score_is_the_only_thing_redone(clone):
    (clone.cells / "maxmin" / "0.02" / "0" / "metrics.json").unlink()
    kept = (clone.cells / "uniform" / "0.02" / "0" / "metrics.json").stat().st_mtime_ns
    assert clone.planned() == {"evaluate": 1, **AFTER}
    clone.run()
    assert (clone.cells / "uniform" / "0.02" / "0" / "metrics.json").stat().st_mtime_ns == kept
    code = "from tests.end_to_end import check; from pathlib import Path; print(check(Path('results/mini')))"
    root = Path(__file__).parents[2]
    environment = {**clone.environment, "PYTHONPATH": os.pathsep.join([str(clone.folder.parent), str(root)])}
    subprocess.run([sys.executable, "-c", code], cwd=clone.folder, env=environment, check=True)


def test_a_failed_cell_is_named_and_the_rest_reported(clone):
    broken = clone.folder / "selectors" / "maxmin.py"
    text = broken.read_text(encoding="utf-8")
    broken.write_text(text + "\n\ndef select(views, count, rng, **parameters):\n    raise ValueError('no luck')\n")
    done = clone.snakemake()
    assert done.returncode != 0
    assert "no luck" in done.stderr
    rows = (clone.folder / "results" / "mini" / "results.csv").read_text(encoding="utf-8").splitlines()
    statuses = [row.rsplit(",", 1)[1] for row in rows[1:]]
    assert statuses.count("ok") == 1
    assert len(statuses) == 2
    broken.write_text(text, encoding="utf-8")
    clone.run()
    assert clone.planned() == {}


def test_a_tracking_server_that_is_down_does_not_stop_the_study(clone):
    (clone.cells / "maxmin" / "0.02" / "0" / "metrics.json").unlink()
    done = clone.snakemake(VIEWBENCH_TRACKING_URI="http://127.0.0.1:9", MLFLOW_HTTP_REQUEST_MAX_RETRIES="0")
    assert done.returncode == 0, done.stderr
    assert (clone.cells / "maxmin" / "0.02" / "0" / "metrics.json").is_file()


def test_without_a_target_everything_is_made(clone):
    (clone.cells / "maxmin" / "0.02" / "0" / "metrics.json").unlink()
    command = [sys.executable, "-m", "snakemake", "-n", "--config", "study=mini"]
    done = subprocess.run(command, cwd=clone.folder, env=clone.environment, capture_output=True, text=True)
    assert "evaluate room_human: maxmin" in done.stdout + done.stderr


def test_a_study_can_be_recorded(clone, tmp_path):
    command = [sys.executable, "-m", "viewbench", "record", "results/mini", "--into", str(tmp_path / "kept")]
    subprocess.run([*command, "--note", "by a test"], cwd=clone.folder, env=clone.environment, check=True)
    kept = tmp_path / "kept" / "mini"
    assert sorted(path.name for path in kept.iterdir()) == ["about.json", "psnr_over_ratio.png", "results.csv"]
    about = json.loads((kept / "about.json").read_text(encoding="utf-8"))
    assert about["notes"] == "by a test"
    assert about["machine"]["cpus"] >= 1
    assert about["versions"]["numba"]


def test_a_wrong_study_is_one_sentence(clone):
    done = clone.snakemake(study="mimi")
    assert done.returncode != 0
    assert "did you mean 'mini'" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
