"""Features that a capture brings along: taken for the pictures they were made of, and for nothing else."""

import hashlib
import json
import shutil

import numpy as np
import pytest

from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE
from viewbench.scenes import features, shipped_features
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats import transforms
from viewbench.scenes.load import open_scene
from viewbench.workflow.commands import _main

ENCODER = "efficientnet-lite0"
ROOM = PACKAGE / "scenes" / "generated_room" / "human"
COUNT = 3


@pytest.fixture
def capture(tmp_path):
    """Three frames of the room that ships."""
    root = tmp_path / "capture"
    (root / "train").mkdir(parents=True)
    record = json.loads((ROOM / "transforms_train.json").read_text())
    record["frames"] = record["frames"][:COUNT]
    for frame in record["frames"]:
        shutil.copy(ROOM / frame["file_path"], root / frame["file_path"])
    (root / "transforms_train.json").write_text(json.dumps(record))
    return root


def rows(root, cache, **other):
    return features.features(transforms.read(root).train, ENCODER, cache, root=root, **other)


def test_written_by_the_command_and_taken_instead_of_the_encoder(capture, tmp_path, capsys, monkeypatch):
    settings = settings_file.load()
    before = scene_sha256(open_scene(str(capture), settings))
    assert _main.run(["features", str(capture), "--beside"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == str(capture / "features" / f"{ENCODER}.npy")
    assert scene_sha256(open_scene(str(capture), settings_file.load())) != before, (
        "results know what they were made from"
    )
    made = rows(capture, tmp_path / "none", batch=1)
    assert not (tmp_path / "none").exists(), "no picture was embedded"
    fresh = features.features(transforms.read(capture).train, ENCODER, tmp_path / "cache")
    assert np.abs(made - fresh).max() < 1e-3
    assert np.allclose(np.linalg.norm(made, axis=1), 1, atol=1e-6)
    assert not np.array_equal(made, fresh), "float16 has fewer digits, and what is brought goes first"
    assert np.array_equal(made, rows(capture, tmp_path / "cache"))


def test_a_picture_that_changed_is_embedded(capture, tmp_path):
    assert _main.run(["features", str(capture), "--beside"]) == 0
    shutil.copy(ROOM / "train" / "0200.jpg", capture / "train" / "0001.jpg")
    mixed = rows(capture, tmp_path / "cache")
    fresh = features.features(transforms.read(capture).train, ENCODER, tmp_path / "other")
    assert [np.array_equal(mixed[i], fresh[i]) for i in range(COUNT)] == [False, True, False]


@pytest.mark.parametrize("key", ["version", "weights_sha256", "decoding"])
def test_rows_by_another_encoder_are_not_taken(capture, tmp_path, key):
    assert _main.run(["features", str(capture), "--beside"]) == 0
    file = capture / "features" / f"{ENCODER}.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: "another"}))
    fresh = features.features(transforms.read(capture).train, ENCODER, tmp_path / "other")
    assert np.array_equal(rows(capture, tmp_path / "cache"), fresh)


def sums(file):
    """Writes the sums anew, as somebody would who edits the rest."""
    parts = (file.with_suffix(".json"), file)
    text = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in parts)
    file.with_suffix(".sha256").write_text(text)


@pytest.mark.parametrize("spoil", ["cut", "fewer", "float32", "nan", "zero", "text", "archive", "flat"])
def test_rows_that_do_not_fit_are_named(capture, tmp_path, spoil):
    assert _main.run(["features", str(capture), "--beside"]) == 0
    file = capture / "features" / f"{ENCODER}.npy"
    good = np.load(file)
    if spoil == "cut":
        file.write_bytes(file.read_bytes()[:-9])
    elif spoil == "text":
        file.write_text("rows")
    elif spoil == "archive":
        with file.open("wb") as opened:
            np.savez(opened, rows=good)
    else:
        bad = {"fewer": good[1:], "float32": good.astype(np.float32), "flat": good[0]}
        bad |= {"nan": good * np.float16(np.nan), "zero": good * np.float16(0)}
        np.save(file, bad[spoil])
    with pytest.raises(UserError, match=r"efficientnet-lite0\.npy.*not what the \.sha256 says"):
        rows(capture, tmp_path / "cache")
    sums(file)
    with pytest.raises(UserError, match=r"efficientnet-lite0\.npy"):
        rows(capture, tmp_path / "cache")


def test_a_run_that_is_stopped_between_its_files_leaves_nothing_that_is_taken(capture, tmp_path, monkeypatch):
    assert _main.run(["features", str(capture), "--beside"]) == 0
    record = json.loads((capture / "transforms_train.json").read_text())
    record["frames"].reverse()
    (capture / "transforms_train.json").write_text(json.dumps(record))

    def stop(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr(shipped_features, "write_json", stop)
    assert _main.run(["features", str(capture), "--beside"]) == 130
    with pytest.raises(UserError, match="not what the"):
        rows(capture, tmp_path / "cache")


def test_every_format_is_hashed_with_the_features_it_brings(capture, tmp_path):
    colmap = tmp_path / "colmap"
    assert _main.run(["convert", str(capture), "--to", "colmap", "--out", str(colmap)]) == 0
    settings = settings_file.load()
    before = scene_sha256(open_scene(str(colmap), settings))
    assert _main.run(["features", str(colmap), "--beside"]) == 0
    between = scene_sha256(open_scene(str(colmap), settings))
    file = colmap / "features" / f"{ENCODER}.npy"
    np.save(file, np.roll(np.load(file), 1, axis=0))
    sums(file)
    assert len({before, between, scene_sha256(open_scene(str(colmap), settings))}) == 3


def test_beside_is_for_folders_of_images(capture, tmp_path, capsys):
    assert _main.run(["features", str(capture), "--beside", "--encoder", "open_clip:A/b"]) == 2
    assert "by NAME" in capsys.readouterr().err


def test_a_folder_of_that_name_for_other_ends_is_left_alone(capture, tmp_path):
    (capture / "features").mkdir()
    (capture / "features" / "notes.json").write_text("[1, 2]")
    (capture / "features" / "broken.json").write_text("{")
    assert shipped_features.files(capture) == ()
    assert len(rows(capture, tmp_path / "cache")) == COUNT
