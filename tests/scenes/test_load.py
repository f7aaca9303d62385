import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes import images
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.splits import held_out, hold_out

SETTINGS = settings_file.load(settings_file.PACKAGE / settings_file.FILE)


@given(st.integers(2, 12), st.integers(20, 800))
def test_every_and_blocks_hold_out_about_their_share(step, n):
    every, blocks = held_out(f"every:{step}", n), held_out(f"blocks:{step}", n)
    assert every.tolist() == list(range(0, n, step))
    assert abs(len(blocks) - n / step) <= max(6, n / step)
    assert len(set(blocks.tolist())) == len(blocks)
    runs = np.split(blocks, np.flatnonzero(np.diff(blocks) > 1) + 1)
    assert len(runs) <= 6
    if n >= 4 * step:
        assert min(map(len, runs)) >= 2  # neighbours in time are held out together


@pytest.mark.parametrize("rule", ["every", "every:1", "blocks:x", "all", "every:-2", "none:2"])
def test_an_unknown_rule_is_named(rule):
    with pytest.raises(UserError, match="every:K or blocks:K"):
        held_out(rule, 100)


def test_holding_out_moves_frames_and_nothing_else(small_room):
    scene = open_scene(str(small_room), SETTINGS)
    with pytest.raises(UserError, match="test views of its own"):
        hold_out(scene, "every:4")
    from dataclasses import replace

    bare = replace(scene, test=scene.train.subset([]))
    held = hold_out(bare, "every:4")
    assert held.test.names == scene.train.names[::4]
    assert sorted(held.train.names + held.test.names) == sorted(scene.train.names)
    assert held.holdout == "every:4"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("room_humna", "did you mean 'room_human'"),
        ("hololens_space", "set VIEWBENCH_DATA"),
        ("/nowhere", "no file or folder"),
        ("nowhere", "no folder"),
    ],
)
def test_an_unknown_scene_is_one_sentence(name, words, monkeypatch):
    monkeypatch.delenv("VIEWBENCH_DATA", raising=False)
    with pytest.raises(UserError, match=words):
        open_scene(name, settings_file.load(settings_file.PACKAGE / settings_file.FILE))


def test_a_folder_without_a_format_says_so(tmp_path):
    with pytest.raises(UserError, match="is empty"):
        open_scene(str(tmp_path), SETTINGS)
    (tmp_path / "notes.txt").write_text("none")
    with pytest.raises(UserError, match="no known format"):
        open_scene(str(tmp_path), SETTINGS)


def test_pictures_are_averaged_over_areas(small_room):
    scene = open_scene(str(small_room), SETTINGS)
    full, cameras = load_images(scene.train, np.array([4, 1]), None)
    half, small = load_images(scene.train, np.array([4, 1]), 128)
    assert full.shape == (2, 256, 256, 3)
    mean = full.reshape(2, 128, 2, 128, 2, 3).mean(axis=(2, 4))
    np.testing.assert_allclose(half, mean, atol=1e-6)
    third, _ = load_images(scene.train, np.array([4, 1]), 100)  # no blocks of whole pixels
    assert third.shape == (2, 100, 100, 3)
    np.testing.assert_allclose(third.mean(axis=(1, 2)), full.mean(axis=(1, 2)), atol=1e-3)
    np.testing.assert_allclose(small.fx, cameras.fx / 2)
    np.testing.assert_array_equal(small.c2w, scene.train.cameras.c2w[[4, 1]])
    # a direction meets the same share of the picture at both sizes
    np.testing.assert_allclose(small.cx / small.width, cameras.cx / cameras.width)


@pytest.mark.parametrize(("across", "down"), [(1, 1), (2, 2), (3, 5), (8, 8), (16, 16), (32, 16)])
def test_means_of_blocks_are_exact(across, down):
    """The nearest float32 of the true mean, whatever the size of the blocks."""
    rgb = np.random.default_rng(across).integers(0, 256, (3 * down, 4 * across, 3), np.uint8)
    rgb[:down, :across] = 255
    picture = images._shrunk(rgb, (4, 3))
    sums = rgb.reshape(3, down, 4, across, 3).sum(axis=(1, 3), dtype=np.int64)
    pixels = picture.pixels()
    np.testing.assert_array_equal(pixels, (sums / (255 * across * down)).astype(np.float32))
    assert pixels[0, 0, 0] == 1
    assert picture.numbers.nbytes <= (36 if across * down == 1 else 72) or across * down > 256


def test_a_frame_is_read_when_its_turn_comes(small_room, tmp_path):
    import shutil

    shutil.copytree(small_room, tmp_path / "copy")
    scene = open_scene(str(tmp_path / "copy"), SETTINGS)
    read, cameras = images.read_images(scene.train, np.array([0, 1]), 64)
    scene.train.paths[1].unlink()
    assert next(read).pixels().shape == (64, 64, 3)
    assert len(cameras) == 2
    with pytest.raises(UserError, match="missing"):
        next(read)


def test_lens_distortion_is_taken_out(tmp_path):
    """A grid of dots drawn through OpenCV's model lands where a pinhole puts it."""

    from PIL import Image

    from tests.scenes.test_transforms import frames, write

    size, focal, k1 = 160, 120.0, -0.2
    folder = write(tmp_path, frames("a.png", "b.png"), size=(size, size), fl_x=focal, k1=k1)
    v, u = np.mgrid[:size, :size] + 0.5
    picture = np.zeros((size, size))
    dots = [(x, y) for x in (-0.3, 0.0, 0.25) for y in (-0.25, 0.1, 0.3)]
    for x, y in dots:
        bend = 1 + k1 * (x * x + y * y)
        picture += np.exp(-((u - focal * x * bend - size / 2) ** 2 + (v - focal * y * bend - size / 2) ** 2) / 8)
    Image.fromarray(np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)).save(folder / "a.png")
    scene = open_scene(str(folder), SETTINGS)
    pictures, cameras = load_images(scene.train, np.array([0]), None)
    assert cameras.distortion is None
    for x, y in dots:
        row, column = focal * y + size / 2, focal * x + size / 2
        near = (np.abs(v - row) < 8) & (np.abs(u - column) < 8)
        weight = pictures[0, ..., 0] * near
        assert abs((weight * u).sum() / weight.sum() - column) < 0.1
        assert abs((weight * v).sum() / weight.sum() - row) < 0.1


def test_broken_pictures_are_one_sentence(small_room, tmp_path):
    import shutil

    folder = tmp_path / "copy"
    shutil.copytree(small_room, folder)
    scene = open_scene(str(folder), SETTINGS)
    cut = scene.train.paths[0]
    cut.write_bytes(cut.read_bytes()[:500])
    with pytest.raises(UserError, match="cannot be read"):
        load_images(scene.train, np.array([0]), None)
    scene.train.paths[1].unlink()
    with pytest.raises(UserError, match="missing"):
        load_images(scene.train, np.array([1]), None)
    shutil.copy(settings_file.PACKAGE / "tests" / "conftest.py", scene.train.paths[2])
    with pytest.raises(UserError, match="cannot be read"):
        load_images(scene.train, np.array([2]), None)


def test_the_hash_follows_the_content(small_room, tmp_path):
    import shutil

    folder = tmp_path / "copy"
    shutil.copytree(small_room, folder)
    first = scene_sha256(open_scene(str(folder), SETTINGS))
    assert first == scene_sha256(open_scene(str(small_room), SETTINGS))
    picture = folder / "train" / sorted(path.name for path in (folder / "train").iterdir())[0]
    picture.write_bytes(picture.read_bytes() + b"x")
    assert scene_sha256(open_scene(str(folder), SETTINGS)) != first
