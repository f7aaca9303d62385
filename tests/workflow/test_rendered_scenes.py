"""A study of a room that is not there: its frames are drawn first, once, and again where some went."""

import os
import shutil
import sys

import pytest

from tests.workflow.clones import Clone, take_frames
from viewbench.common import holding
from viewbench.common.settings import PACKAGE
from viewbench.workflow import _alone

STUDY = """
title: A room that is drawn first
scenes: [drawn]
selectors: [uniform]
ratios: [0.2]
seeds: 1
backends: [splat]
points: scene
width: 16
budget: {iterations: 2}
reference: false
reports: [table_psnr, scenes]
"""
ENVIRONMENT = """
[scenes.drawn]
path = "drawn"
room = "kitchen_living"
render = "kitchen_living --path smooth --size 16 --frames 12"

[rooms]
python = {python!r}
shards = 2

[tracking]
uri = ""
"""
# In place of a Python with Blender: `python -m viewbench ARGUMENTS` with pictures of noise.
STAND_IN = """#!{python}
import sys
import numpy as np
from viewbench.scenes.rooms import _points, _rendering, _visibility
from viewbench.__main__ import main

class Renderer:
    def __init__(self, room, size, threads=1):
        self.size = size
    def __enter__(self):
        return self
    def __exit__(self, *error):
        pass
    def render(self, c2w, samples, seed):
        return np.random.default_rng(seed).integers(0, 256, (self.size, self.size, 3), dtype=np.uint8)

_rendering.available = lambda: None
_rendering.Renderer = Renderer
_points.seen = lambda room: (np.random.default_rng(0).uniform(0, 3, (50, 3)), np.zeros((50, 3), np.uint8))
_visibility.seen_shares = lambda room, test, train: np.full(len(test), 0.9)
assert sys.argv[1:3] == ["-m", "viewbench"], sys.argv
sys.prefix = "/elsewhere"  # of an environment of its own, where the study's fork server has no business
del sys.argv[1:3]
main()
"""


@pytest.fixture
def clone(tmp_path):
    made = Clone(tmp_path, STUDY)
    python = tmp_path / "python with bpy"
    python.write_text(STAND_IN.format(python=sys.executable), encoding="utf-8")
    python.chmod(0o755)
    (made.folder / "environment.toml").write_text(ENVIRONMENT.format(python=str(python)), encoding="utf-8")
    return made


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a script with a #! line")
def test_a_scene_that_is_not_there_is_drawn_and_then_chosen_from(clone, tmp_path):
    data = {"VIEWBENCH_DATA": str(tmp_path / "data")}
    clone.run(**data)
    scene = tmp_path / "data" / "drawn"
    assert len(list((scene / "train").iterdir())) == 12
    assert "90.0 %" in (clone.results / "reports" / "table_scenes.md").read_text()
    assert clone.planned(**data) == {}
    before = {file: file.stat().st_mtime_ns for file in (scene / "train").iterdir()}
    old = sorted((clone.results / "results.csv").read_text().splitlines())
    gone = scene / "train" / "0007.jpg"
    for file in (gone, scene / "transforms_train.json"):
        file.unlink()
    assert clone.planned(**data) == {}, "nothing that is there needs the scene"
    clone.edit("workflow/studies/mini.yaml", "ratios: [0.2]", "ratios: [0.2, 0.4]")
    clone.run(**data)
    assert {file for file in before if file.stat().st_mtime_ns != before[file]} == {gone}, "the others were kept"
    new = sorted((clone.results / "results.csv").read_text().splitlines())
    assert len(new) == len(old) + 1
    assert set(old) < set(new), "the same frame, so nothing was trained again"
    assert clone.planned(**data) == {}


def test_a_dry_run_beside_a_run_leaves_its_stamps(clone, tmp_path):
    stamp = clone.results / "rendered" / "drawn" / "1-of-2"
    stamp.parent.mkdir(parents=True)
    stamp.touch()
    with open(clone.results / _alone.FILE, "w+") as held:
        assert holding.lock(held.fileno())
        holding.write(held.fileno(), holding.me())
        clone.snakemake("-n", VIEWBENCH_DATA=str(tmp_path / "data"))
        assert stamp.exists()
        holding.write(held.fileno(), {})
    clone.snakemake("-n", VIEWBENCH_DATA=str(tmp_path / "data"))
    assert not stamp.exists()


def test_a_python_that_is_none_is_named_before_anything_runs(clone, tmp_path):
    done = clone.snakemake(VIEWBENCH_DATA=str(tmp_path / "data"), VIEWBENCH_ROOMS_PYTHON="/no/python")
    assert done.returncode != 0
    assert "'/no/python', which is no program" in done.stdout + done.stderr
    assert not (clone.results / "logs").exists()


def test_a_room_that_cannot_be_drawn_leaves_the_others_reported(clone, tmp_path):
    python = tmp_path / "broken"
    python.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    python.chmod(0o755)
    clone.edit("workflow/studies/mini.yaml", "scenes: [drawn]", "scenes: [drawn, little]")
    little = take_frames(PACKAGE / "scenes" / "generated_room" / "human", tmp_path / "data" / "little", 20)
    with (clone.folder / "environment.toml").open("a", encoding="utf-8") as file:
        file.write(f'\n[scenes.little]\npath = "{little}"\nholdout = "every:5"\n')
    done = clone.snakemake("--keep-going", VIEWBENCH_DATA=str(tmp_path / "data"), VIEWBENCH_ROOMS_PYTHON=str(python))
    assert done.returncode != 0
    assert "little" in (clone.results / "reports" / "table_scenes.md").read_text()
    assert "drawn" not in (clone.results / "reports" / "table_scenes.md").read_text()


def test_without_a_python_to_draw_with_one_line_says_what_brings_the_scene(clone, tmp_path):
    clone.edit("environment.toml", f"python = {str(tmp_path / 'python with bpy')!r}", 'python = ""')
    shutil.rmtree(tmp_path / "data", ignore_errors=True)
    done = clone.snakemake(VIEWBENCH_DATA=str(tmp_path / "data"))
    assert done.returncode != 0
    said = done.stdout + done.stderr
    assert "rendered rooms are not there (drawn)" in said
    assert "viewbench-rooms" in said
    assert "VIEWBENCH_ROOMS_PYTHON" in said
    assert "Traceback" not in said
