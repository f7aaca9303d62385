"""Cells that Snakemake believes in and that are not what the study asks for are found when results are gathered."""

import shutil

import numpy as np
import pytest
import yaml

from tests.conftest import ROOM
from tests.workflow.clones import take_frames
from viewbench.backends import _evaluate, _train
from viewbench.backends._types import Budget, Job
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.files import read_json, sealed, write_json
from viewbench.scenes.features import save
from viewbench.scenes.load import open_scene
from viewbench.selectors import _run
from viewbench.workflow import _study
from viewbench.workflow._collect import collect

STUDY = {
    "scenes": ["walk"],
    "selectors": [{"name": "maxmin", "selector": "maxmin", "parameters": {"sigma": 0.4}}],
    "ratios": [0.3],
    "seeds": [4],
    "backends": [{"backend": "splat", "options": {"gaussians": 600}}],
    "width": 48,
    "budget": {"iterations": 2},
    "reference": False,
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder to work in, with one cell that was made by the commands' own functions."""
    take_frames(ROOM, tmp_path / "walk", 12)
    where = str(tmp_path / "walk")
    (tmp_path / "environment.toml").write_text(f"[scenes.walk]\npath = {where!r}\nholdout = 'every:4'\n")
    monkeypatch.chdir(tmp_path)
    settings = settings_file.load()
    scene = open_scene("walk", settings)
    results = tmp_path / "results" / "mine"
    features = np.random.default_rng(0).normal(size=(len(scene.train), 8)).astype(np.float32)
    save(results / "features" / "walk.npy", features)
    chosen = _run.run(scene, "maxmin", 3, 4, {"sigma": 0.4}, features)
    folder = results / "cells" / "splat" / "walk" / "maxmin" / "0.3" / "4"
    job = Job("splat", 4, Budget(2), 48, {"gaussians": 600}, curve=False)
    _train.train(scene, chosen, job, folder, settings=settings)
    _evaluate.evaluate(folder, scene, folder, settings=settings)
    return tmp_path


def gathered(place, **changes):
    """The status of the one cell when the study has these changes."""
    (place / "mine.yaml").write_text(yaml.safe_dump({**STUDY, **changes}))
    settings = settings_file.load()
    study = _study.load("mine.yaml", settings)
    (row,) = collect(study, place / "results" / "mine", settings, partial=True)
    assert (row["psnr_db"] != "") == (row["status"] == "ok")
    if row["status"] != "ok":
        with pytest.raises(UserError):
            collect(study, place / "results" / "mine", settings)
    return row["status"]


def cell(place):
    return next((place / "results").rglob("metrics.json")).parent


def test_what_is_as_asked_counts(place):
    assert gathered(place) == "ok"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width": 64}, "train.json was made with another width"),
        ({"budget": {"iterations": 3}}, "train.json was made with another budget"),
        ({"backends": ["splat"]}, "train.json was made with another options"),
        ({"selectors": ["maxmin"]}, "selection.json was made with another parameters"),
        ({"selectors": [{"name": "maxmin", "selector": "kcenter"}]}, "selection.json was made with another selector"),
        ({"count": "floor", "ratios": [0.3]}, "selection.json was made with another count"),
    ],
)
def test_what_the_study_no_longer_asks_for_does_not_count(place, changes, words):
    assert words in gathered(place, **changes)


def test_features_of_another_encoder_do_not_count(place):
    path = place / "results" / "mine" / "features" / "walk.npy"
    save(path, np.load(path) + 1)
    assert "selection.json was made with another features_sha256" in gathered(place)
    path.unlink()
    assert "selection.json was made with another features_sha256" in gathered(place)


def test_the_data_in_force_count_and_not_those_that_were_described(place):
    images = sorted((place / "walk" / "train").iterdir())
    before = images[0].read_bytes()
    shutil.copy(images[1], images[0])
    assert "selection.json was made with another scene_sha256" in gathered(place)
    images[0].write_bytes(before)
    assert gathered(place) == "ok"
    (place / "walk").rename(place / "gone")
    assert "is not there" in gathered(place)


def test_another_test_split_does_not_count(place):
    settings = place / "environment.toml"
    settings.write_text(settings.read_text().replace("every:4", "every:5"))
    assert "another scene_sha256" in gathered(place)


def test_weights_of_lpips_that_the_score_does_not_know_make_it_stale(place):
    (place / "alexnet.pth").write_bytes(b"weights")
    with open(place / "environment.toml", "a") as file:
        file.write('[metrics]\nlpips_weights = "alexnet.pth"\n')
    assert "metrics.json was made with another lpips_sha256" in gathered(place)


@pytest.mark.parametrize("file", ["selection", "train", "metrics"])
def test_what_was_edited_by_hand_does_not_count(place, file):
    path = cell(place) / f"{file}.json"
    record = read_json(path)
    write_json(path, {**record, "viewbench": "99"})
    assert f"{file}.json was edited since it was made" in gathered(place)


@pytest.mark.parametrize("file", ["selection", "train", "metrics"])
def test_code_that_is_not_todays_does_not_count(place, file):
    """Edited while the job ran, and put back: Snakemake has seen nothing."""
    path = cell(place) / f"{file}.json"
    write_json(path, sealed({**read_json(path), "code_sha256": "0" * 64}))
    assert f"{file}.json was made with another" in gathered(place)


def test_another_version_of_the_backend_does_not_count(place, monkeypatch):
    from viewbench.backends import splat

    monkeypatch.setattr(splat, "version", lambda: "viewbench 99")
    assert "train.json was made with another version" in gathered(place)

    def unknown():
        raise ImportError("no numba here")

    monkeypatch.setattr(splat, "version", unknown)
    assert gathered(place) == "ok", "a trainer that is not installed here is not held against its models"
