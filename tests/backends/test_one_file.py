"""A backend is one file: dropped into the folder it is listed and joins a study, beside an external program."""

import json
import subprocess
import sys

import pandas as pd
import pytest

from tests.backends.conftest import nearest_command
from tests.conftest import copy_package, environment_of, known

FLAT = '''"""The mean colour of the chosen views, everywhere."""

import json

import numpy as np

from viewbench.backends._types import Capabilities, Trained

CAPABILITIES = Capabilities()


def available():
    return None


def version():
    return "flat 1"


def train(data, out, seed, budget, options, report):
    colour = np.asarray(data.images).mean(axis=(0, 1, 2))
    (out / "colour.json").write_text(json.dumps(colour.tolist()), encoding="utf-8")
    return Trained(iterations=budget.iterations, seconds=0.0)


def render(model, cameras):
    colour = np.array(json.loads((model / "colour.json").read_text(encoding="utf-8")), dtype=np.float32)
    for width, height in zip(cameras.width, cameras.height):
        yield np.broadcast_to(colour, (height, width, 3))
'''

STUDY = """
title: Three backends in one grid
scenes: [room_human]
selectors: [uniform]
ratios: [0.05]
seeds: [0]
backends: [flat, splat, "command:nearest"]
width: 48
budget: {iterations: 60}
encoder: none
reference: false
reports: [psnr_over_ratio, table_psnr]
"""


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A copy of the package with one more file in backends/, and a program in its environment.toml."""
    folder = copy_package(tmp_path_factory.mktemp("clone"))
    (folder / "backends" / "flat.py").write_text(FLAT, encoding="utf-8")
    (folder / "workflow" / "studies" / "mixed.yaml").write_text(STUDY, encoding="utf-8")
    program = nearest_command()
    section = f"\n[command.nearest]\ntrain = {json.dumps(program.train)}\nrender = {json.dumps(program.render)}\n"
    with open(folder / "environment.toml", "a", encoding="utf-8") as file:
        file.write(section)
    return folder


def run(clone, *command: str) -> subprocess.CompletedProcess:
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=clone, env=environment_of(clone), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done


def test_it_is_listed(clone):
    lines = run(clone, "viewbench", "list", "backends").stdout.splitlines()
    assert any(line.startswith("flat ") and "[flat 1, cpu]" in line for line in lines)
    assert any(line.startswith("command:nearest ") and "sha256:" in line for line in lines)


@pytest.mark.slow
def test_all_three_are_in_the_results_the_log_and_the_figures(clone):
    run(clone, "snakemake", "-j1", "--config", "study=mixed", "--", "reports")
    results = clone / "results" / "mixed"
    table = pd.read_csv(results / "results.csv").set_index("backend")
    assert set(table.index) == {"flat", "splat", "command-nearest"}
    assert table["psnr_db"]["splat"] > table["psnr_db"]["flat"]
    assert table["psnr_db"].between(3, 60).all()
    figure = pd.read_csv(results / "reports" / "psnr_over_ratio.csv")
    assert set(figure["backend"]) == set(table.index)
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{clone}/results/mlflow.db")
    runs = client.search_runs([known(client.get_experiment_by_name("mixed")).experiment_id])
    runs = [run for run in runs if run.data.tags["viewbench.kind"] == "cell"]
    assert len(runs) == 3
