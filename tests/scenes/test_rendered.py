"""The rendered rooms that ship: frames of the rooms as their code builds them, fair test views, within their size."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from viewbench.common import plugins
from viewbench.common import settings as settings_file
from viewbench.common.files import sha256_file
from viewbench.common.settings import PACKAGE
from viewbench.scenes import features
from viewbench.scenes.load import open_scene
from viewbench.scenes.rooms import _rendering
from viewbench.scenes.rooms._capture import Job, digest
from viewbench.scenes.rooms._pace import PERCENTILES, pace

FOLDER = PACKAGE / "scenes" / "rendered"
ROOMS = ("bedroom_study", "glass_living", "open_office")
WALKS = ("human", "smooth")
SCENES = [name for name, entry in settings_file.load(PACKAGE / "environment.toml").scenes.items() if entry.render]
MOST_BYTES = 62e6
# Of the slower and of the faster of freiburg2_desk and freiburg3_long_office (TUM RGB-D): speed, then turn rate, at 50
# and 95 % (`viewbench render ROOM --dry-run --beside FILE`).
HANDS = {"m/s": ((0.21, 0.32), (0.26, 0.39)), "deg/s": ((9.1, 22.1), (11.3, 25.2))}


def files(pattern: str) -> list[Path]:
    return [path for path in FOLDER.glob(pattern) if path.is_file() and not path.is_symlink()]


@pytest.fixture(scope="module", params=ROOMS)
def room(request):
    return request.param, plugins.load("scenes.rooms", request.param).build()


def test_all_are_there_and_small():
    assert sorted(path.name for path in FOLDER.iterdir() if path.is_dir()) == list(ROOMS)
    assert len(SCENES) == len(ROOMS) * len(WALKS)
    assert sum(path.stat().st_size for path in files("**/*")) < MOST_BYTES
    for name in ROOMS:
        assert len(files(f"{name}/test/*.png")) == 40
        assert all(len(files(f"{name}/{walk}/train/*.jpg")) == 400 for walk in WALKS)


def test_frames_are_of_the_room_and_the_paths_as_they_are(room):
    name, made = room
    for walk in WALKS:
        for split, path in (("train", walk), ("test", "test")):
            record = json.loads((FOLDER / name / walk / f"render_{split}.json").read_text())
            assert record["room_sha256"] == digest(made), "the room has changed: render it again"
            way = made.paths[path](record["frames"])
            job = Job(name, path, way.times, way.c2w, record["size"], record["samples"], split, record["quality"])
            assert job.record(made) == record
            written = json.loads((FOLDER / name / walk / f"transforms_{split}.json").read_text())
            assert written == json.loads(json.dumps(job.transforms()))


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_opens_by_name_and_its_test_views_are_fair(name):
    scene = open_scene(name, settings_file.load(PACKAGE / "environment.toml"))
    assert (len(scene.train), len(scene.test)) == (400, 40)
    assert scene.points is not None
    assert len(scene.points) == 20_000
    seen = json.loads((scene.root / "seen_test.json").read_text())["seen"]
    assert list(seen) == list(scene.test.names)
    assert min(seen.values()) >= 0.85
    assert np.mean(list(seen.values())) >= 0.95


@pytest.mark.parametrize("name", ROOMS)
def test_hands_move_as_hands_do(name):
    """Medians and 95 % within a factor of 2 of the range of the recorded ones."""
    record = json.loads((FOLDER / name / "human" / "transforms_train.json").read_text())["frames"]
    times = np.array([frame["time"] for frame in record])
    speed, turn = pace(times, np.array([frame["transform_matrix"] for frame in record]))
    places = [PERCENTILES.index(50), PERCENTILES.index(95)]
    for found, (slow, fast) in ((speed[places], HANDS["m/s"]), (turn[places], HANDS["deg/s"])):
        assert (found >= np.array(slow) / 2).all()
        assert (found <= np.array(fast) * 2).all()


@pytest.mark.parametrize("name", ROOMS)
def test_frames_are_neither_dark_nor_burnt_out_and_no_two_walks_share_them(name):
    images = {path: np.asarray(Image.open(path).convert("RGB")) for path in files(f"{name}/*/train/*.jpg")[::16]}
    for path, pixels in images.items():
        assert pixels.shape == (192, 192, 3)
        assert 0.2 < pixels.mean() / 255 < 0.7, path
        assert (pixels.min(axis=2) == 255).mean() < 0.1, path
        assert (pixels.max(axis=2) < 8).mean() < 0.1, path
    hashes = [sha256_file(path) for path in files(f"{name}/*/train/*.jpg")]
    assert len(set(hashes)) == len(hashes)


@pytest.mark.parametrize("name", SCENES)
def test_the_features_that_ship_are_the_encoders(name, tmp_path):
    scene = open_scene(name, settings_file.load(PACKAGE / "environment.toml"))
    some = scene.train.subset([0, 199, 399])
    shipped = features.features(some, "efficientnet-lite0", tmp_path / "none", root=scene.root)
    assert not (tmp_path / "none").exists()
    fresh = features.features(some, "efficientnet-lite0", tmp_path / "cache")
    assert np.abs(shipped - fresh).max() < 1e-3
    assert (np.einsum("nd,nd->n", shipped, fresh) > 0.9999).all()


@pytest.mark.skipif(_rendering.available() is not None, reason="bpy is not installed")
def test_the_same_frames_are_drawn_again(room):
    """Pixel for pixel on the processor that drew them; others differ in single values."""
    name, made = room
    record = json.loads((FOLDER / name / "smooth" / "render_train.json").read_text())
    poses = made.paths["smooth"](record["frames"]).c2w
    with _rendering.Renderer(made, record["size"], 2) as renderer:
        for i in (3, 250):
            drawn, encoded = renderer.render(poses[i], record["samples"], i), io.BytesIO()
            Image.fromarray(drawn).save(encoded, "JPEG", quality=record["quality"], subsampling=0)
            ours, shipped = (
                np.asarray(Image.open(file)).astype(int)
                for file in (encoded, FOLDER / name / "smooth" / "train" / f"{i:04d}.jpg")
            )
            assert np.abs(ours - shipped).mean() < 0.5
            assert np.percentile(np.abs(ours - shipped), 99.9) <= 8
