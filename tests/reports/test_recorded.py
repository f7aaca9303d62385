"""Recorded results: shown beside fresh ones where a scene is common, named as recorded, and absent otherwise."""

import json
import shutil

import pytest

from tests.conftest import known
from viewbench.common.errors import UserError
from viewbench.reports import recorded
from viewbench.reports._study import load

from .fixtures import make_study

ABOUT = {
    "title": "gsplat on one GPU",
    "machine": {"GPU": "one of 24 GB"},
    "versions": {"gsplat": "1.5.3"},
    "commands": ["snakemake -j4 --resources gpu=1"],
}


@pytest.fixture
def shelf(tmp_path, monkeypatch):
    """A folder of recordings with one in it, made by another backend on one of the scenes."""
    source = make_study(tmp_path / "other", scenes=("room_human",), backends=("gsplat",), seeds=(0, 1))
    folder = tmp_path / "recorded"
    (folder / "gpu").mkdir(parents=True)
    shutil.copy(source / "results.csv", folder / "gpu" / "results.csv")
    (folder / "gpu" / "about.json").write_text(json.dumps(ABOUT))
    monkeypatch.setattr(recorded, "FOLDER", folder)
    return folder


def test_both_are_shown_and_told_apart(shelf, tmp_path):
    study = load(make_study(tmp_path))
    figure, table, about = recorded.build(study, tmp_path)
    assert "gsplat on one GPU" in figure.title
    assert "recorded" in figure.title.lower()
    text = (tmp_path / "recorded_gpu.csv").read_text()
    assert "fresh,splat,room_human" in text
    assert "recorded,gsplat,room_human" in text
    assert "room_smooth" not in text
    assert {row[0].text for row in known(table.table).rows} == {"gsplat"}
    assert "gsplat 1.5.3" in about.caption
    assert "differ" not in about.caption


def test_another_version_of_the_scene_is_said(shelf, tmp_path):
    path = shelf / "gpu" / "results.csv"
    path.write_text(path.read_text().replace("a" * 64, "c" * 64))
    about = recorded.build(load(make_study(tmp_path)), tmp_path)[-1]
    assert "The files of room_human differ" in about.caption


def test_nothing_is_shown_for_other_scenes(shelf, tmp_path):
    assert recorded.build(load(make_study(tmp_path, scenes=("room_smooth",))), tmp_path) == []


def test_a_broken_recording_is_named(shelf, tmp_path):
    (shelf / "gpu" / "about.json").write_text("{}")
    with pytest.raises(UserError, match=r"about\.json.*title"):
        recorded.build(load(make_study(tmp_path)), tmp_path)


def test_what_ships_can_be_read():
    for recording in recorded.recordings(recorded.FOLDER):
        assert recording.title
        assert recording.cells
