"""What is edited is run again, and nothing else: one change at a time, and the jobs that it costs.

A finished study of one scene, two selectors and three backends (ours, a program with a renderer of its own, and one
that leaves Gaussians for us to draw), so that six cells say what a change reaches.
"""

import shutil
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOM
from tests.workflow.clones import Clone, take_frames

STUDY = """
title: Six cells
scenes: [walk]
selectors: [uniform, maxmin]
ratios: [0.2]
seeds: [0]
backends:
  - {backend: splat, budget: {iterations: 4}}
  - command:nearest
  - command:cloud
width: 48
budget: {iterations: 4}
reference: false
reports: [psnr_over_ratio, cameras]
"""
CLOUD = """
import sys
from pathlib import Path
import numpy as np
from plyfile import PlyData, PlyElement
out = Path(sys.argv[1])
names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"]
rows = np.zeros(40, dtype=[(name, "<f4") for name in [*names, "rot_0", "rot_1", "rot_2", "rot_3"]])
rows["x"], rows["rot_0"], rows["opacity"], rows["f_dc_0"] = np.linspace(-2, 2, 40), 1, 2, int(sys.argv[2])
for axis in "012":
    rows[f"scale_{axis}"] = -1
PlyData([PlyElement.describe(rows, "vertex")]).write(out / "cloud.ply")
"""
ENVIRONMENT = """
[scenes.walk]
path = {walk!r}
dataset = "walks"
holdout = "every:4"

[features]
cache = "results/features"

[tracking]
renders = 1

[command.nearest]
train = [{python!r}, {nearest!r}, "train", "--scene", "{{scene}}", "--out", "{{out}}", "--seed", "{{seed}}",
         "--iterations", "{{iterations}}"]
render = [{python!r}, {nearest!r}, "render", "--model", "{{out}}", "--cameras", "{{cameras}}",
          "--images", "{{renders}}"]
version = ["cat", {version!r}]

[command.cloud]
train = [{python!r}, {cloud!r}, "{{out}}", "{{iterations}}"]
output = "cloud.ply"
version = ["cat", {version!r}]
"""
NEAREST = Path(__file__).parents[1] / "backends" / "nearest_view.py"
LOGGED = {"track": 1, "page": 1, "publish": 1, "reports": 1}
TABLES = {"collect": 1, "track": 1, "report": 2, "page": 1, "publish": 1, "reports": 1}
EVERYTHING = {"describe": 1, "features": 1, "select": 2, "train": 6, "evaluate": 6, **TABLES}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    parent = tmp_path_factory.mktemp("mutations")
    clone = Clone(parent, STUDY)
    walk = take_frames(ROOM, parent / "data" / "walk", 24)
    (parent / "cloud.py").write_text(CLOUD, encoding="utf-8")
    (parent / "version.txt").write_text("1.0\n", encoding="utf-8")
    places = {"walk": str(walk), "python": sys.executable, "nearest": str(NEAREST)}
    places |= {"version": str(parent / "version.txt"), "cloud": str(parent / "cloud.py")}
    (clone.folder / "environment.toml").write_text(ENVIRONMENT.format(**places), encoding="utf-8")
    clone.run()
    assert clone.planned() == {}
    return clone


@pytest.fixture
def clone(finished, tmp_path):
    """The finished study in another folder, its capture in another folder too: that alone runs nothing again."""
    shutil.copytree(finished.folder.parent / "data", tmp_path / "data")
    shutil.copy(finished.folder.parent / "version.txt", tmp_path / "version.txt")
    other = finished.copied(tmp_path)
    for name in ("data/walk", "version.txt"):
        text = (other.folder / "environment.toml").read_text(encoding="utf-8")
        (other.folder / "environment.toml").write_text(
            text.replace(str(finished.folder.parent / name), str(tmp_path / name)), encoding="utf-8"
        )
    return other


def data(clone: Clone) -> Path:
    return clone.folder.parent / "data" / "walk"


def touch_everything(clone):
    for path in [*clone.folder.rglob("*.py"), *data(clone).rglob("*"), clone.folder / "environment.toml"]:
        if path.is_file() and not path.is_symlink():
            path.touch()


def another_image(clone, index):
    images = sorted(data(clone).glob("train/*"))
    shutil.copy(images[index + 1], images[index])


def environment(old, new):
    return lambda clone: clone.edit("environment.toml", old, new)


def study(old, new):
    return lambda clone: clone.edit("workflow/studies/mini.yaml", old, new)


def source(name):
    return lambda clone: clone.edit(name)


def other_points(clone):
    text = (data(clone) / "points3d.ply").read_bytes()
    (data(clone) / "points3d.ply").write_bytes(text[:-1] + bytes([text[-1] ^ 1]))


def weights(clone):
    """A file of LPIPS weights, named by the settings."""
    (clone.folder / "alexnet.pth").write_bytes(b"weights")
    clone.edit("environment.toml", "[tracking]", '[metrics]\nlpips_weights = "alexnet.pth"\n[tracking]')


OURS = {"warm": 1, "train": 2, "evaluate": 2, **TABLES}  # the cells of one backend
TRAININGS = {"warm": 3, "train": 6, "evaluate": 6, **TABLES}
OF_ANOTHER = {"study": 1, "select": 1, "train": 3, "evaluate": 3, **TABLES}
OF_MAXMIN = {"select": 1, "train": 3, "evaluate": 3, **TABLES}
MUTATIONS = {
    # nothing that a number depends on
    "the same files in other folders": (lambda clone: None, {}),
    "the times of all files": (touch_everything, {}),
    "a text that no step reads": (lambda clone: (clone.folder / "README.md").write_text("read me"), {}),
    "a format named that was found anyway": (environment("holdout", 'format = "transforms"\nholdout'), {}),
    "a limit on the time of a program": (environment('output = "cloud.ply"', 'output = "cloud.ply"\ntimeout = 99'), {}),
    # settings
    "another test split": (environment("every:4", "every:5"), EVERYTHING),
    "another group in the tables": (environment('"walks"', '"others"'), {"describe": 1, **TABLES}),
    "the command that trains": (environment('"{iterations}"]\nrender', '"3"]\nrender'), OURS),
    "the command that renders": (environment('"{renders}"]', '"{renders}", "--seed", "1"]'), {"evaluate": 2, **TABLES}),
    "weights of LPIPS": (weights, {"evaluate": 6, **TABLES}),
    "renders that are logged": (environment("renders = 1", "renders = 2"), LOGGED),
    # what the machine has
    "a program's version": (
        lambda clone: (clone.folder.parent / "version.txt").write_text("2.0\n"),
        {"warm": 2, "train": 4, "evaluate": 4, **TABLES},
    ),
    "a version that nobody can tell now": (lambda clone: (clone.folder.parent / "version.txt").unlink(), {}),
    "a training image": (lambda clone: another_image(clone, 1), EVERYTHING),
    "a test image": (lambda clone: another_image(clone, 0), EVERYTHING),
    "a point": (other_points, EVERYTHING),
    # the study
    "its title": (study("Six cells", "6 cells"), {"study": 1, **TABLES}),
    "its iterations": (study("width: 48\nbudget: {iterations: 4}", "width: 48\nbudget: {iterations: 3}"), {
        **{"train": 4, "evaluate": 4, "study": 1}, **TABLES
    }),
    "a ratio more": (study("[0.2]", "[0.2, 0.1]"), {"select": 1, "train": 6, "evaluate": 6, "study": 1, **TABLES}),
    "a seed more": (study("seeds: [0]", "seeds: [0, 1]"), {
        **{"select": 2, "train": 6, "evaluate": 6, "study": 1}, **TABLES
    }),
    "a parameter of a selector": (
        study("maxmin]", "{name: maxmin, selector: maxmin, parameters: {sigma: 0.4}}]"),
        {"study": 1, **OF_MAXMIN},
    ),
    "a selector more": (study("maxmin]", "maxmin, kcenter]"), OF_ANOTHER),
    "a selector more that compiles": (study("maxmin]", "maxmin, coverage]"), {"warm_selector": 1, **OF_ANOTHER}),
    "two ways of choosing by one that compiles": (
        study("maxmin]", "maxmin, coverage, {name: coarse, selector: coverage, parameters: {spacing: 1}}]"),
        {"warm_selector": 1, **OF_ANOTHER, "select": 2, "train": 6, "evaluate": 6},
    ),
    # the source code
    "a selector": (source("selectors/maxmin.py"), OF_MAXMIN),
    "another selector": (source("selectors/uniform.py"), OF_MAXMIN),
    "a selector of no cell": (source("selectors/kcenter.py"), {}),
    "the encoder": (source("scenes/encoders/efficientnet_lite0.py"), {"features": 1, **OF_MAXMIN}),
    "the reader": (source("scenes/formats/transforms.py"), EVERYTHING),
    "the reader of another format": (source("scenes/formats/tum_rgbd.py"), {}),
    "our trainer, which draws for one program": (source("backends/splat/raster.py"), {**OURS, "evaluate": 4}),
    "where any trainer may start": (source("backends/_points/swept.py"), TRAININGS),
    "how kernels are compiled, the sweep's among them": (source("common/kernels.py"), TRAININGS),
    "a trainer of no cell, which may draw": (source("backends/gsplat/renderer.py"), {"evaluate": 2, **TABLES}),
    "what draws a PLY": (source("backends/_ply_render.py"), {"evaluate": 2, **TABLES}),
    "what runs programs": (source("backends/_process.py"), {"warm": 2, "train": 4, "evaluate": 4, **TABLES}),
    "the scoring": (source("backends/_metrics.py"), {"evaluate": 6, **TABLES}),
    "the description of scenes": (source("workflow/commands/describe.py"), {"describe": 1, **TABLES}),
    "a report": (source("reports/cameras.py"), {"report": 1, "page": 1, "publish": 1, "reports": 1}),
    "the log": (source("reports/_tracking.py"), LOGGED),
    # results
    "a score that is gone": (
        lambda clone: next(clone.results.rglob("metrics.json")).unlink(),
        {"evaluate": 1, **TABLES},
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", MUTATIONS)
def test_what_is_edited_is_run_again_and_nothing_else(clone, what):
    change, jobs = MUTATIONS[what]
    change(clone)
    assert clone.planned() == jobs


def test_one_choice_serves_every_backend_and_every_ratio_of_its_tier(clone):
    study("[0.2]", "[0.2, 0.1, 0.3]")(clone)
    clone.run()
    folder = clone.results / "selections"
    kept = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.json"))
    greedy = [f"walk/maxmin/{tier}/0.json" for tier in ("0.25", "0.5")]
    assert kept == sorted([*greedy, *(f"walk/uniform/{ratio}/0.json" for ratio in ("0.1", "0.2", "0.3"))])
    assert clone.planned() == {}


def test_one_job_compiles_a_selector_before_it_chooses(clone):
    study("maxmin]", "maxmin, coverage]")(clone)
    clone.run()
    assert clone.planned() == {}
    source("selectors/_coverage_kernels.py")(clone)
    assert clone.planned() == {"warm_selector": 1, "select": 1, "train": 3, "evaluate": 3, **TABLES}
