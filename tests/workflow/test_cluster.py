"""The profile for Slurm without Slurm: what is asked for, how cells are grouped, what a second attempt makes.

`make test-slurm` tries the same on a real cluster.
"""

import csv
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import pytest
import yaml

from tests.slurm.compare import differences
from tests.workflow.clones import Clone
from viewbench.common import settings as settings_file
from viewbench.common.settings import PACKAGE
from viewbench.workflow import _cluster, _resources, _study, _wiring
from viewbench.workflow._resources import Needs, Size
from viewbench.workflow._study import BackendEntry

PROFILE = PACKAGE / "workflow" / "profiles" / "slurm"
LOCAL = {"study", "collect", "track", "report", "page", "publish", "reports"}
REST = """
backends: [splat]
width: 32
budget: {iterations: 10}
encoder: none
reference: false
reports: [timing]
"""
SMALL = "scenes: [room_human]\nselectors: [uniform]\nratios: [0.02]\nseeds: 2" + REST
LARGE = (
    "scenes: [room_human, room_smooth]\nselectors: [random, uniform, facility, maxmin, logdet]\n"
    "ratios: [0.03, 0.05, 0.1]\nseeds: 20" + REST
)


@pytest.fixture(scope="module")
def profile() -> dict:
    return yaml.safe_load((PROFILE / "config.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Clone:
    """Two cells, run on one machine."""
    clone = Clone(tmp_path_factory.mktemp("cluster"), SMALL)
    clone.run()
    return clone


def as_a_node(clone: Clone, attempt: int, *rules: str) -> subprocess.CompletedProcess:
    """What Slurm starts for a group: the jobs of both cells."""
    where = "backend=splat,scene=room_human,selector=uniform,ratio=0.02"
    targets = [f"{rule}:{where},seed={seed}" for rule in rules for seed in (0, 1)]
    options = ["--target-jobs", *targets, "--allowed-rules", *rules, "--mode", "remote", "--attempt", str(attempt)]
    options += ["--force", "--cores", "1", "--nolock", "--no-hooks", "--ignore-incomplete", "--keep-incomplete"]
    return clone.call("snakemake", *options, "--executor", "local", "--config", "study=mini")


def cell(clone: Clone, seed: int) -> Path:
    return clone.results / "cells" / "splat" / "room_human" / "uniform" / "0.02" / str(seed)


def test_a_cell_that_fails_costs_its_group_no_other_and_is_all_that_is_made_again(finished, tmp_path):
    clone = finished.copied(tmp_path)
    kept = (cell(clone, 0) / "metrics.json").read_bytes()
    times = [(cell(clone, seed) / "metrics.json").stat().st_mtime_ns for seed in (0, 1)]
    for broken in (0, 1):  # whichever comes first
        model = cell(clone, broken) / "model.ply"
        whole = model.read_bytes()
        model.write_bytes(whole[:-4])
        done = as_a_node(clone, 1, "evaluate")
        model.write_bytes(whole)
        assert done.returncode != 0
        assert not (cell(clone, broken) / "metrics.json").exists()
        other = (cell(clone, 1 - broken) / "metrics.json").stat().st_mtime_ns
        assert other > times[1 - broken]
        done = as_a_node(clone, 2, "evaluate")
        assert done.returncode == 0, done.stderr
        assert (cell(clone, 1 - broken) / "metrics.json").stat().st_mtime_ns == other
        times = [(cell(clone, seed) / "metrics.json").stat().st_mtime_ns for seed in (0, 1)]
    now, before = json.loads((cell(clone, 0) / "metrics.json").read_bytes()), json.loads(kept)
    assert [view["psnr_db"] for view in now["views"]] == [view["psnr_db"] for view in before["views"]]


def test_a_first_attempt_makes_all_that_was_asked_for(finished, tmp_path):
    clone = finished.copied(tmp_path)
    times = [(cell(clone, seed) / "metrics.json").stat().st_mtime_ns for seed in (0, 1)]
    done = as_a_node(clone, 1, "evaluate")
    assert done.returncode == 0, done.stderr
    assert all((cell(clone, seed) / "metrics.json").stat().st_mtime_ns > times[seed] for seed in (0, 1))


def test_six_hundred_cells_are_some_sixty_allocations(tmp_path, profile):
    pytest.importorskip("snakemake_executor_plugin_slurm")
    clone = Clone(tmp_path, LARGE)
    options = ["--workflow-profile", "workflow/profiles/slurm", "-n", "--config", "study=mini", "--", "reports"]
    done = clone.call("snakemake", *options)
    assert done.returncode == 0, done.stdout + done.stderr
    shown = done.stdout + done.stderr
    assert re.search(r"^train +600$", shown, re.MULTILINE)
    groups = Counter(re.findall(r"Group job (\w+)-\S+ \(jobs", shown))
    size = {name.partition("-")[0]: int(count) for name, count in map(_halves, profile["group-components"])}
    assert groups["cells"] == 600 / size["cells"]  # sixty cells of a scene, selector and backend are whole groups
    assert groups["choices"] <= 2 * 5 * (60 // size["choices"] + 1)
    for group in re.split(r"Group job ", shown)[1:]:  # both jobs of a cell are in one group
        members = re.findall(r"^ +Job \d+: (train|evaluate) (\S+: .*, ratio \S+, seed \d+)", group, re.MULTILINE)
        steps = {step: {cell for name, cell in members if name == step} for step in ("train", "evaluate")}
        if group.startswith("cells"):
            assert steps["train"] == steps["evaluate"]
            assert len(steps["train"]) <= size["cells"]


def _halves(text: str) -> tuple[str, str]:
    name, _, value = text.rpartition("=")
    return name, value


def test_every_rule_asks_for_memory_and_time_or_runs_on_the_login_node():
    rules = {}
    for file in (PACKAGE / "workflow" / "rules").glob("*.smk"):
        for block in re.split(r"^(?:rule|checkpoint) ", file.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            rules[block.partition(":")[0]] = block
    assert len(rules) > 10
    for name, block in rules.items():
        asks = "mem_mb=" in block and "runtime=" in block
        assert asks != ("localrule: True" in block), name
        assert (name in LOCAL) == (not asks), name


def test_the_profile_groups_rules_that_there_are_and_gives_an_allocation_one_gpu(profile):
    text = "".join(file.read_text() for file in (PACKAGE / "workflow" / "rules").glob("*.smk"))
    groups = dict(map(_halves, profile["groups"]))
    assert all(re.search(rf"^rule {rule}:", text, re.MULTILINE) for rule in groups)
    assert set(groups.values()) == set(dict(map(_halves, profile["group-components"])))
    assert (profile["resources"], profile["set-resource-scopes"]) == (["gpu=1"], ["gpu=local"])
    assert profile["retries"] >= 1
    assert all(profile[key] for key in ("keep-incomplete", "keep-going", "slurm-requeue"))


@pytest.fixture(scope="module")
def needs() -> Needs:
    settings = settings_file.load()
    return _wiring.Wiring(_study.load("quick", settings), settings).needs


class Wildcards:
    scene, selector, ratio, seed, backend = "room_human", "maxmin", "0.05", "0", "splat"


def test_each_attempt_asks_for_twice_as_much(needs):
    for name in [name for name in dir(needs) if name.endswith(("_mb", "_minutes"))]:
        asked = [getattr(needs, name)(Wildcards, attempt=attempt) for attempt in (1, 2, 3)]
        assert asked[0] > 1, name
        assert asked == [asked[0], 2 * asked[0], 4 * asked[0]], name
    assert [Needs.fixed(7)(Wildcards, attempt=attempt) for attempt in (1, 2, 3)] == [7, 14, 28]


def test_nothing_is_looked_up_in_a_job(needs):
    class Elsewhere(Wildcards):
        scene = "nowhere"

    settings = settings_file.load()
    in_a_job = _wiring.Wiring(_study.load("quick", settings), settings, writes=False).needs
    assert isinstance(in_a_job.train_mb(Elsewhere, attempt=1), int)
    with pytest.raises(Exception, match="nowhere"):
        needs.train_mb(Elsewhere, attempt=1)


@pytest.mark.parametrize("recording", ["quick", "rooms", "real", "walks"])
def test_recorded_trainings_would_have_had_enough_and_not_ten_times_too_much(recording):
    sizes = {"hololens": (540, 360), "real_room": (960, 540), "diorama": (960, 720)}
    widths = {"quick": 128, "rooms": 128, "real": 180, "walks": 180}
    with open(PACKAGE / "reports" / "recorded" / recording / "results.csv", newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["status"] == "ok"]
    assert rows
    for row in rows:
        width, height = sizes.get(row["dataset"], (256, 256))
        size = Size(int(row["n_views"]), 50, width, height)
        entry = BackendEntry("splat", "splat", int(row["iterations"]), None, widths[recording])
        asked = _resources.train_mb(size, entry, int(row["count"]) / size.views, gpu=False)
        assert (
            1.2 * int(row["peak_rss_bytes"]) / _resources.MB < asked < 10 * int(row["peak_rss_bytes"]) / _resources.MB
        )
        assert 60 * _resources.train_minutes(size, entry, gpu=False) > 2 * float(row["train_s"])


def test_more_and_larger_pictures_ask_for_more():
    entry = BackendEntry("other", "command:other", 1000, None, 256)
    base, many = Size(100, 10, 256, 256), Size(1000, 10, 256, 256)
    large = Size(100, 10, 4096, 4096)
    for backend in (entry, BackendEntry("splat", "splat", 1000, None, 256)):
        least = _resources.train_mb(base, backend, 1.0, gpu=False)
        assert _resources.train_mb(many, backend, 1.0, gpu=False) > least
        assert _resources.train_mb(large, backend, 1.0, gpu=False) > least
        assert _resources.train_mb(base, backend, 1.0, gpu=True) >= least
    more = BackendEntry("splat", "splat", 1000, None, 256, {"gaussians": 500_000})
    assert _resources.train_mb(base, more, 1.0, False) > _resources.train_mb(
        base, BackendEntry("splat", "splat", 1000, None, 256), 1.0, False
    )
    timed = BackendEntry("splat", "splat", None, 7200.0, 256)
    assert _resources.train_minutes(base, timed, gpu=False) > 120


def test_what_submits_jobs_names_no_processor():
    """sbatch hands variables on, and a node may have another processor than the login node."""
    code = """
import os
from viewbench.common import settings
from viewbench.workflow import _study, _wiring
found = settings.load()
wiring = _wiring.Wiring(_study.load("quick", found), found)
class Wildcards: scene, selector, ratio, seed, backend = "room_human", "maxmin", "0.05", "0", "splat"
wiring.scene(Wildcards), wiring.training(Wildcards), wiring.scoring(Wildcards), wiring.choosing(Wildcards)
print([name for name in os.environ if name.startswith("NUMBA_CPU")])
"""
    assert run_code(code).strip() == "[]"


def run_code(code: str) -> str:
    variables = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CPU")}
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.check_output([sys.executable, "-c", code], cwd=folder, env=variables, text=True)


def test_kernels_of_one_processor_are_not_those_of_another(tmp_path):
    """Nodes may share the folder of compiled kernels: its index has the processor."""
    code = """
import os
from viewbench.common.kernels import strict
import numba
def double(x): return 2 * x
import sys
sys.path.insert(0, os.environ["PLACE"])
import kernel
kernel.double(3)
print(sum(kernel.double.stats.cache_hits.values()))
"""
    (tmp_path / "kernel.py").write_text(
        "from viewbench.common.kernels import strict\n\n\n@strict\ndef double(x):\n    return 2 * x\n"
    )
    hits = []
    for name in ("x86-64", "x86-64", "nehalem", "x86-64", "nehalem"):
        variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PLACE": str(tmp_path), "NUMBA_CPU_NAME": name}
        variables |= {"NUMBA_CPU_FEATURES": ""}
        done = subprocess.run(
            [sys.executable, "-c", code], env=os.environ | variables, capture_output=True, text=True, check=True
        )
        hits.append(int(done.stdout))
    assert hits == [0, 1, 0, 1, 1]


def test_jobs_of_an_earlier_run_are_asked_for_only_where_there_was_one(tmp_path):
    _cluster.cancel_leftovers(tmp_path / "none")  # there is no squeue to ask


def test_a_changed_bit_is_seen(finished, tmp_path):
    """Of two runs that `make test-slurm` compares."""
    clone = finished.copied(tmp_path)
    assert differences(finished.results, clone.results) == []
    model = cell(clone, 1) / "model.ply"
    content = bytearray(model.read_bytes())
    content[-1] ^= 1
    model.write_bytes(content)
    table = clone.results / "results.csv"
    table.write_text(re.sub(r"(splat,uniform,0.02,0,\d+,\d+,\d)", r"\g<1>1", table.read_text()))
    (cell(clone, 0) / "renders" / "more.png").touch()
    place = "cells/splat/room_human/uniform/0.02"
    assert sorted(differences(finished.results, clone.results)) == [
        f"{place}/0/renders/more.png: only in one",
        f"{place}/1/model.ply: differs",
        "results.csv: differs",
    ]
