"""The workflow under the lowest release of Snakemake that is supported and under the one that is pinned.

The progress line uses what Snakemake does not promise: the records of its log and the name of its handler.
"""

import itertools
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.test_recipes import BACKEND
from tests.workflow.clones import ROOT, Clone

STUDY = """
scenes: [room_human]
selectors: [uniform]
ratios: [0.01]
seeds: 2
backends: [grey, command:broken]
budget: {iterations: 1}
width: 16
reference: false
reports: [table_psnr]
"""
SETTINGS = """
[scenes.room_human]
path = "package:scenes/generated_room/human"
[tracking]
uri = ""
[command.broken]
train = ["sh", "-c", "echo no luck; exit 1", "{iterations}"]
render = ["true", "{cameras}"]
"""


def lowest() -> str:
    """The release that pyproject.toml names as the least."""
    requirements = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = itertools.chain(requirements["dependencies"], *requirements["optional-dependencies"].values())
    return next(found[1] for line in lines if (found := re.fullmatch(r"snakemake>=([\d.]+)", line)))


@pytest.fixture(scope="module", params=["lowest", "pinned"])
def release(request, tmp_path_factory) -> Path | None:
    """A folder with another release of Snakemake and what it needs; None for the one that is installed."""
    if request.param == "pinned":
        return None
    folder = tmp_path_factory.mktemp("snakemake")
    command = [sys.executable, "-m", "pip", "install", "-q", "--target", str(folder), f"snakemake=={lowest()}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode and re.search("connection|resolve|No matching distribution", done.stderr, re.IGNORECASE):
        pytest.skip("no package index is in reach")
    assert done.returncode == 0, done.stderr
    return folder


def test_the_least_release_is_said_alike_everywhere():
    assert f'min_version("{lowest()}")' in (ROOT / "workflow" / "Snakefile").read_text()


def test_progress_failures_and_silence(release, tmp_path):
    clone = Clone(tmp_path, STUDY)
    (clone.folder / "backends" / "grey.py").write_text(BACKEND, encoding="utf-8")
    (clone.folder / "environment.toml").write_text(SETTINGS, encoding="utf-8")
    path = clone.environment()["PYTHONPATH"]
    variables = {} if release is None else {"PYTHONPATH": os.pathsep.join([str(release), path])}
    version = clone.call("snakemake", "--version", **variables).stdout.strip()
    if release is not None:
        assert version == lowest() or version.startswith(lowest() + ".")
    done = clone.snakemake(**variables)
    said = done.stdout + done.stderr
    assert done.returncode == 1, said
    assert re.search(r"^reading the study mini, 0:\d\d min so far$", said, re.MULTILINE), said
    assert re.search(r"^0 of 4 cells, 0:\d\d min so far; \w", said, re.MULTILINE), said
    failures = [line for line in said.splitlines() if line.startswith("failed: ")]
    assert len(failures) == 2, said
    assert all("train of results/mini/cells/command-broken/" in line and "no luck" in line for line in failures)
    assert "Reporting the cells that are finished" in said
    # None of what Snakemake prints of jobs by itself.
    noise = ("rule train", "jobid", "Finished job", "Select jobs", "reason:")
    assert not [word for word in noise if word in said], said
    jobs = clone.planned(**variables)
    assert jobs["train"] == 2, "the two that failed"
