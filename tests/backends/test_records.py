"""What a model says it was made from, and what a killed run may be taken up for."""

import dataclasses
import json
import shutil
import sys

import pytest

from tests.backends.conftest import nearest_command, settings_with
from viewbench.backends import _evaluate, _train
from viewbench.backends._types import Budget, Job
from viewbench.common.errors import UserError
from viewbench.common.files import sha256_file, sha256_folder, unsealed
from viewbench.common.settings import load as load_settings
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.load import open_scene
from viewbench.selectors import _run
from viewbench.selectors._selection import selection_sha256

SETTINGS = load_settings()
JOB = Job("splat", 0, Budget(4), 48, curve=False)


def trained(folder, out, **changes):
    scene = open_scene(str(folder), SETTINGS)
    chosen = _run.run(scene, "uniform", 3, 0)
    return scene, chosen, _train.train(scene, chosen, dataclasses.replace(JOB, **changes), out, settings=SETTINGS)


def test_each_file_names_what_was_before_it(small_room, tmp_path):
    scene, chosen, record = trained(small_room, tmp_path)
    metrics = _evaluate.evaluate(tmp_path, scene, tmp_path, settings=SETTINGS)
    stored = {name: json.loads((tmp_path / f"{name}.json").read_text()) for name in ("selection", "train", "metrics")}
    assert {file["scene_sha256"] for file in stored.values()} == {scene_sha256(scene)}
    assert {file["holdout"] for file in stored.values()} == {"given"}
    assert unsealed(stored["selection"], "it") == chosen
    assert stored["train"] == record
    assert stored["metrics"] == metrics
    assert record["selection_sha256"] == selection_sha256(chosen)
    assert metrics["train_sha256"] == sha256_file(tmp_path / "train.json")
    assert record["files"] == {name: sha256_file(tmp_path / name) for name in ("model.ply", "splat.json")}
    assert all(len(file["code_sha256"]) == 64 for file in stored.values())


def test_a_model_is_not_scored_on_another_version_of_its_scene(small_room, tmp_path):
    shutil.copytree(small_room, tmp_path / "room")
    trained(tmp_path / "room", tmp_path / "model")
    images = sorted((tmp_path / "room" / "train").iterdir())
    shutil.copy(images[1], images[0])
    with pytest.raises(UserError, match=r"with holdout 'given' and hash .* but now .*; train again"):
        _evaluate.evaluate(
            tmp_path / "model", open_scene(str(tmp_path / "room"), SETTINGS), tmp_path / "model", settings=SETTINGS
        )
    assert not (tmp_path / "model" / "metrics.json").exists()


@pytest.fixture
def asked(small_room, tmp_path, monkeypatch):
    """What a training is asked, as its working folder remembers it."""
    seen = []
    real = _train._work_folder

    def spy(out, what, resumes):
        seen.append(what)
        return real(out, what, resumes)

    monkeypatch.setattr(_train, "_work_folder", spy)
    trained(small_room, tmp_path / "model")
    monkeypatch.undo()
    return seen[0]


EVERYTHING = ["backend", "scene_sha256", "holdout", "selection_sha256", "code_sha256"]
EVERYTHING += ["seed", "width", "budget", "options", "version"]


def test_everything_that_a_model_depends_on_is_asked(asked):
    assert set(EVERYTHING) <= set(asked)
    assert asked["options"]["gaussians"] == 28000
    assert dataclasses.asdict(Budget(4)) == asked["budget"]


@pytest.mark.parametrize("key", [*EVERYTHING, None])
def test_a_killed_run_is_taken_up_for_the_same_and_nothing_else(asked, tmp_path, key):
    work = _train._work_folder(tmp_path, asked, resumes=True)
    (work / "model" / "snapshot.npz").write_bytes(b"half way")
    other = asked if key is None else {**asked, key: "other"}
    _train._work_folder(tmp_path, other, resumes=True)
    assert (work / "model" / "snapshot.npz").exists() == (key is None)
    _train._work_folder(tmp_path, asked, resumes=False)
    assert not (work / "model" / "snapshot.npz").exists()


def test_a_new_model_has_no_score_of_the_old_one(small_room, tmp_path):
    scene, _, _ = trained(small_room, tmp_path)
    _evaluate.evaluate(tmp_path, scene, tmp_path, settings=SETTINGS)
    assert (tmp_path / "metrics.json").is_file()
    trained(small_room, tmp_path, seed=1)
    assert not (tmp_path / "metrics.json").exists()
    assert not (tmp_path / "renders").exists()


def test_another_choice_of_as_many_views_is_another_run(small_room, tmp_path):
    first = trained(small_room, tmp_path / "a")[2]
    scene = open_scene(str(small_room), SETTINGS)
    other = _run.run(scene, "maxmin", 3, 5, {"factors": ["pos"]})
    second = _train.train(scene, other, JOB, tmp_path / "b", settings=SETTINGS)
    assert first["selection_sha256"] != second["selection_sha256"]


def test_nothing_of_an_older_model_is_left_to_be_drawn(small_room, tmp_path):
    """A program that wrote cloud.ply writes renamed.ply now: the old one goes, whoever removed train.json meanwhile."""
    scene = open_scene(str(small_room), SETTINGS)
    chosen = _run.run(scene, "uniform", 3, 0)

    def train(file):
        code = f"import sys, pathlib; pathlib.Path(sys.argv[1], 'deep').mkdir(); open(sys.argv[1] + '/{file}', 'w')"
        command = nearest_command(train=[sys.executable, "-c", code, "{out}", "{iterations}"])
        job = dataclasses.replace(JOB, backend="command:x")
        return _train.train(scene, chosen, job, tmp_path, settings=settings_with(x=command))

    train("cloud.ply")
    (tmp_path / "mine.txt").write_text("of the user's own")
    (tmp_path / "train.json").unlink()
    assert "renamed.ply" in train("renamed.ply")["files"]
    assert not (tmp_path / "cloud.ply").exists()
    assert (tmp_path / "mine.txt").exists()
    with pytest.raises(UserError, match=r"left a file 'metrics\.json', a name of viewbench's own"):
        train("metrics.json")


def test_a_folder_is_hashed_file_by_file(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "c").write_bytes(b"1")
    (tmp_path / "a").write_bytes(b"2")
    assert sha256_folder(tmp_path) == {"a": sha256_file(tmp_path / "a"), "b/c": sha256_file(tmp_path / "b" / "c")}


def test_more_gaussians_than_room_are_an_error_and_no_crash(small_room):
    import numpy as np

    from viewbench.backends.splat.backward import Moments, Rates
    from viewbench.backends.splat.layout import empty
    from viewbench.backends.splat.options import Rendering
    from viewbench.backends.splat.projection import camera_vectors
    from viewbench.backends.splat.trainer import Trainer, Weights

    camera = camera_vectors(open_scene(str(small_room), SETTINGS).train.cameras[:1].scaled(48))[0]
    trainer = Trainer(10, 48, 48, Rendering())
    renderer = trainer.renderer
    renderer.draw(empty(10, 1), camera)
    with pytest.raises(ValueError, match="11 Gaussians, made for at most 10"):
        renderer.draw(empty(11, 1), camera)
    with pytest.raises(ValueError, match="was not drawn of these 50000"):
        trainer.differentiate(empty(50_000, 1), camera)
    target, rates = trainer.target(np.zeros((48, 48, 3), np.float32)), Rates.of_step(1, np.zeros(23))
    with pytest.raises(ValueError, match="made for at most 10"):
        trainer.step(empty(11, 1), Moments.zeros(empty(11, 1)), camera, target, rates, Weights(0.2))
    renderer.resize(11)
    renderer.draw(empty(11, 1), camera)
    assert trainer.differentiate(empty(11, 1), camera).shape == (23, 11)
