"""Features that a capture brings along: taken for the pictures they were made of, and for nothing else."""

import json
import shutil

import numpy as np
import pytest

from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE
from viewbench.scenes import features, shipped_features
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.formats import transforms
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
    before = scene_sha256(transforms.read(capture))
    assert _main.run(["features", str(capture), "--beside"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == str(capture / "features" / f"{ENCODER}.npy")
    assert scene_sha256(transforms.read(capture)) != before, "results know what they were made from"
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


@pytest.mark.parametrize("spoil", ["cut", "fewer", "float32", "nan", "text"])
def test_rows_that_do_not_fit_are_named(capture, tmp_path, spoil):
    assert _main.run(["features", str(capture), "--beside"]) == 0
    file = capture / "features" / f"{ENCODER}.npy"
    good = np.load(file)
    if spoil == "cut":
        file.write_bytes(file.read_bytes()[:-9])
    elif spoil == "text":
        file.write_text("rows")
    else:
        bad = {"fewer": good[1:], "float32": good.astype(np.float32), "nan": good * np.float16(np.nan)}[spoil]
        np.save(file, bad)
    with pytest.raises(UserError, match=r"efficientnet-lite0\.npy"):
        rows(capture, tmp_path / "cache")


def test_a_folder_of_that_name_for_other_ends_is_left_alone(capture, tmp_path):
    (capture / "features").mkdir()
    (capture / "features" / "notes.json").write_text("[1, 2]")
    (capture / "features" / "broken.json").write_text("{")
    assert shipped_features.files(capture) == ()
    assert len(rows(capture, tmp_path / "cache")) == COUNT
