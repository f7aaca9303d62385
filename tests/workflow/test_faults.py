"""What happens to a study in two days: files are damaged, the disk fills, the clock goes back, two write at once."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests import soak_checks
from tests.conftest import ROOM
from tests.workflow.clones import Clone, take_frames
from viewbench.backends import _evaluate, _train
from viewbench.backends._types import Budget, Job
from viewbench.common import settings as settings_file
from viewbench.common.files import read_json, sealed, write_json
from viewbench.scenes import features
from viewbench.scenes.load import open_scene
from viewbench.selectors import _run
from viewbench.workflow import _clock, _study
from viewbench.workflow._collect import TABLE_SEAL, collect
from viewbench.workflow._heal import heal

STUDY = {
    "scenes": ["walk"],
    "selectors": ["uniform", "maxmin"],
    "ratios": [0.3],
    "seeds": [0],
    "backends": [{"backend": "splat", "options": {"gaussians": 600}}],
    "width": 48,
    "budget": {"iterations": 2},
    "reference": False,
    "reports": ["psnr_over_ratio", "cameras"],
}
SETTINGS = "[scenes.walk]\npath = {walk!r}\nholdout = 'every:4'\n[features]\ncache = 'results/features'\n"
LINUX_ROOT = sys.platform == "linux" and os.geteuid() == 0


# Damage


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a study of one cell, made by the commands' own functions."""
    place = tmp_path_factory.mktemp("made")
    take_frames(ROOM, place / "walk", 12)
    (place / "environment.toml").write_text(SETTINGS.format(walk=str(place / "walk")), encoding="utf-8")
    (place / "mine.yaml").write_text(yaml.safe_dump({**STUDY, "selectors": ["uniform"]}), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        settings = settings_file.load()
        study, results = _study.load("mine.yaml", settings), place / "results" / "mine"
        scene = open_scene("walk", settings)
        folder = results / "cells" / "splat" / "walk" / "uniform" / "0.3" / "0"
        chosen = _run.run(scene, "uniform", 3, 0, {}, None)
        write_json(results / "selections" / "walk" / "uniform" / "0.3" / "0.json", sealed(chosen))
        job = Job("splat", 0, Budget(2), 48, {"gaussians": 600}, curve=False)
        _train.train(scene, chosen, job, folder, settings=settings)
        _evaluate.evaluate(folder, scene, folder, settings=settings)
        features.save(results / "features" / "walk.npy", np.eye(9, 4))
        write_json(results / "scenes" / "walk.json", sealed({"n_train": 9}))
        write_json(results / "study.json", sealed(study.record()))
        write_json(results / "reports" / "cameras.items.json", [{"title": "a figure"}])
        collect(study, results, settings)
    return study, results


@pytest.fixture
def results(made, tmp_path):
    shutil.copytree(made[1], tmp_path / "mine")
    return tmp_path / "mine"


def flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def edited(content: bytes) -> bytes:
    record = json.loads(content)
    return json.dumps({**record, "viewbench": "99"}).encode()


CELL = "cells/splat/walk/uniform/0.3/0"
RENDER = f"{CELL}/renders/0000_train_0000.png"
DAMAGE = {  # file, what is done to it: the file that goes so that it is made again
    ("selections/walk/uniform/0.3/0.json", cut): "selections/walk/uniform/0.3/0.json",
    ("selections/walk/uniform/0.3/0.json", edited): "selections/walk/uniform/0.3/0.json",
    (f"{CELL}/selection.json", cut): f"{CELL}/selection.json",
    (f"{CELL}/selection.json", edited): f"{CELL}/selection.json",
    (f"{CELL}/train.json", cut): f"{CELL}/train.json",
    (f"{CELL}/train.json", edited): f"{CELL}/train.json",
    (f"{CELL}/metrics.json", cut): f"{CELL}/metrics.json",
    (f"{CELL}/metrics.json", edited): f"{CELL}/metrics.json",
    (f"{CELL}/model.ply", cut): f"{CELL}/train.json",
    (f"{CELL}/splat.json", None): f"{CELL}/train.json",
    (RENDER, cut): f"{CELL}/metrics.json",
    (RENDER, None): f"{CELL}/metrics.json",
    ("features/walk.npy", cut): "features/walk.npy",
    ("features/walk.npy", flipped): "features/walk.npy",
    ("scenes/walk.json", cut): "scenes/walk.json",
    ("scenes/walk.json", edited): "scenes/walk.json",
    ("study.json", cut): "study.json",
    ("study.json", edited): "study.json",
    ("reports/cameras.items.json", cut): "reports/cameras.items.json",
    ("results.csv", cut): "results.csv",
    ("results.csv", flipped): "results.csv",
}


def damage(path: Path, how) -> None:
    if how is None:
        path.unlink()
    else:
        path.write_bytes(how(path.read_bytes()))


@pytest.mark.parametrize(("file", "how"), DAMAGE, ids=lambda value: getattr(value, "__name__", value))
def test_damage_is_found_and_what_made_it_is_run_again(made, results, file, how):
    assert heal(made[0], results, verify=True) == []
    damage(results / file, how)
    removed = [path.relative_to(results).as_posix() for path in heal(made[0], results)]
    removed = [name for name in removed if not (name == f"{CELL}/train.json" and file == name)] or removed[:1]
    assert set(removed) == {DAMAGE[file, how]}
    assert not (results / DAMAGE[file, how]).exists()


@pytest.mark.parametrize(("file", "goes"), [(f"{CELL}/model.ply", "train"), (RENDER, "metrics")])
def test_what_is_as_long_as_it_was_is_found_when_it_is_read(made, results, file, goes):
    damage(results / file, flipped)
    assert heal(made[0], results) == [], "gigabytes are not read at every run"
    assert heal(made[0], results, verify=True) == [results / CELL / f"{goes}.json"]


def test_a_table_without_its_hash_has_whole_rows(made, results):
    (results / TABLE_SEAL).unlink()
    assert heal(made[0], results) == []
    damage(results / "results.csv", cut)
    assert heal(made[0], results) == [results / "results.csv"]


def test_a_cell_that_was_not_come_to_has_not_failed(made, results, monkeypatch):
    """Its steps have not begun, or were stopped with the run; one that says why it ended has failed."""
    monkeypatch.chdir(made[1].parents[1])
    settings = settings_file.load()

    def status() -> str:
        (row,) = collect(made[0], results, settings, partial=True)
        return row["status"]

    assert status() == "ok"
    (results / CELL / "metrics.json").unlink()
    assert status() == "not run yet"
    log = results / "logs" / "train" / "splat" / "walk" / "uniform" / "0.3" / "0.log"
    log.parent.mkdir(parents=True)
    for words, expected in {
        "viewbench: stopped": "not run yet",
        "no luck": "train: no luck",
        "": "not run yet",
    }.items():
        log.write_text(f"{words}\n", encoding="utf-8")
        assert status() == expected


def test_a_row_of_the_cache_that_was_altered_is_embedded_again(tmp_path):
    file = tmp_path / "row.npy"
    features.save(file, np.arange(4.0))
    assert np.array_equal(np.load(file), np.arange(4)), "numpy reads it as any other"
    kept = features.cached(file)
    assert kept is not None
    assert kept.tolist() == [0, 1, 2, 3]
    for how in (flipped, cut):
        features.save(file, np.arange(4.0))
        damage(file, how)
        assert features.cached(file) is None
    np.save(file, np.arange(4, dtype=np.float32))  # without a hash, as others write it
    assert features.cached(file) is not None


def test_altered_features_are_refused(tmp_path):
    features.save(tmp_path / "f.npy", np.eye(3))
    damage(tmp_path / "f.npy", flipped)
    with pytest.raises(settings_file.UserError, match="were altered since they were written; delete that file"):
        features.load_user_features(tmp_path / "f.npy", 3)


# The clock


def test_dates_to_come_are_now_and_in_the_order_that_they_had(tmp_path):
    now = time.time_ns()
    dates = {"old": -(10**12), "b": 2 * 10**12, "a": 10**12, "c": 2 * 10**12 + 5000}
    for name, ahead in dates.items():
        (tmp_path / name).touch()
        os.utime(tmp_path / name, ns=(now + ahead, now + ahead))
    assert _clock.settle(tmp_path, now) == 3
    found = sorted(tmp_path.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    assert [path.name for path in found] == ["old", "a", "b", "c"]
    assert (tmp_path / "old").stat().st_mtime_ns == now - 10**12
    assert now - 10**9 < (tmp_path / "a").stat().st_mtime_ns < now
    assert _clock.settle(tmp_path, now) == 0


def test_a_clock_that_goes_back_is_noticed_once():
    wall, steady = iter([100.0, 101.0, 50.0, 51.0, 90.0]), iter([0.0, 1.0, 2.0, 3.0, 4.0])
    watch = _clock.Watch(lambda: next(wall), lambda: next(steady))
    assert [watch.went_back() for _ in range(4)] == [False, True, False, False]


# Through Snakemake


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    parent = tmp_path_factory.mktemp("faults")
    clone = Clone(parent, yaml.safe_dump(STUDY))
    walk = take_frames(ROOM, parent / "walk", 24)
    (clone.folder / "environment.toml").write_text(SETTINGS.format(walk=str(walk)), encoding="utf-8")
    clone.run()
    return clone


def test_the_clock_goes_back_between_two_runs(finished, tmp_path):
    clone = finished.copied(tmp_path)
    for path in clone.results.rglob("*"):
        ahead = path.lstat().st_mtime + 7200
        os.utime(path, (ahead, ahead), follow_symlinks=False)
    assert clone.planned() == {}, "nothing is run again for its date"
    for path in clone.results.rglob("*"):
        ahead = path.lstat().st_mtime + 7200
        os.utime(path, (ahead, ahead), follow_symlinks=False)
    clone.edit("workflow/studies/mini.yaml", "iterations: 2", "iterations: 3")
    planned = clone.planned()
    assert (planned["train"], planned["evaluate"], planned.get("select")) == (2, 2, None), "nothing stale is kept"


def test_what_was_damaged_all_over_is_as_it_was_after_one_run(finished, tmp_path):
    clone = finished.copied(tmp_path)
    before = soak_checks.content(clone.results)
    cells = sorted(clone.results.glob("cells/*/*/*/*/*"))
    damage(cells[0] / "model.ply", cut)
    damage(next(cells[1].glob("renders/*.png")), cut)
    damage(clone.results / "features" / "walk.npy", flipped)
    damage(clone.results / "scenes" / "walk.json", cut)
    said = clone.run()
    assert "viewbench: damaged or altered, so made again: " in said
    assert soak_checks.differences(before, soak_checks.content(clone.results)) == []
    assert clone.planned() == {}


def mount(folder: Path, *options: str) -> None:
    done = subprocess.run(["mount", *options, str(folder)], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")


@pytest.fixture
def small(finished, tmp_path):
    """The study, not begun, with a disk of its own for the results."""
    if not LINUX_ROOT:
        pytest.skip("a small disk is mounted by root on Linux alone")
    clone = finished.copied(tmp_path)
    shutil.rmtree(clone.folder / "results")
    (clone.folder / "results").mkdir()
    mount(clone.folder / "results", "-t", "tmpfs", "-o", "size=200k", "none")
    yield clone
    subprocess.run(["umount", "-l", str(clone.folder / "results")], check=True)


def test_a_full_disk_and_one_that_takes_nothing(small, finished):
    results = small.folder / "results"
    done = small.snakemake()
    said = done.stdout + done.stderr
    assert done.returncode != 0
    assert "No space left on device" in said
    assert "Traceback" not in said
    watcher = soak_checks.Watcher(small.results)
    watcher.look(small.results)
    assert watcher.looked
    assert watcher.wrong == [], "nothing is half-written under its final name"
    assert [path for path in soak_checks.left_over(results) if path.name != ".training"] == []
    mount(results, "-o", "remount,ro")
    done = small.snakemake()
    assert done.returncode == 2
    assert "viewbench: nothing can be written to 'results/mini': Read-only file system" in done.stderr
    assert "Traceback" not in done.stderr
    mount(results, "-o", "remount,rw,size=64m")
    small.run()
    expected = soak_checks.content(finished.results)
    assert soak_checks.differences(expected, soak_checks.content(small.results)) == []


# Two at once

TRAIN = """
import sys
from pathlib import Path
from viewbench.__main__ import main
main(["train", {scene!r}, "--selection", "s.json", "--out", "model", "--width", "64", "--iterations", "150",
      "--seed", sys.argv[1]])
"""


def test_two_trainings_of_one_folder_do_not_mix(small_room, tmp_path):
    """Each waits for the other, and what is there in the end is one of them, as it is when it runs alone."""
    settings = settings_file.load()
    scene = open_scene(str(small_room), settings)
    write_json(tmp_path / "s.json", sealed(_run.run(scene, "uniform", 4, 0, {}, None)))
    command = [sys.executable, "-c", TRAIN.format(scene=str(small_room))]
    both = [subprocess.Popen([*command, seed], cwd=tmp_path) for seed in ("1", "2")]
    assert [process.wait(120) for process in both] == [0, 0]
    record = read_json(tmp_path / "model" / "train.json")
    assert _evaluate.altered_file(tmp_path / "model", record) is None
    assert soak_checks.left_over(tmp_path) == []
    (tmp_path / "alone").mkdir()
    shutil.copy(tmp_path / "s.json", tmp_path / "alone" / "s.json")
    subprocess.run([*command, str(record["seed"])], cwd=tmp_path / "alone", check=True)
    assert read_json(tmp_path / "alone" / "model" / "train.json")["files"] == record["files"]
