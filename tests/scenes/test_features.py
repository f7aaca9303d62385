"""Image features and sharpness: cached by content, resumable, and what a broken picture or encoder is answered with."""

import shutil
import types

import numpy as np
import pytest
from PIL import Image, ImageFilter

from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.scenes import features as module
from viewbench.scenes.features import features, load_user_features, picture
from viewbench.scenes.sharpness import laplacian_variance, sharpness
from viewbench.scenes.types import Cameras, Split


def split_of(paths):
    n = len(paths)
    c2w, one = np.tile(np.eye(4), (n, 1, 1)), np.ones(n)
    cameras = Cameras(c2w, one, one, one, one, one.astype(int), one.astype(int))
    return Split(tuple(path.name for path in paths), tuple(paths), cameras)


@pytest.fixture
def pictures(tmp_path):
    rng = np.random.default_rng(0)
    paths = [tmp_path / f"{i}.png" for i in range(5)]
    for path in paths:
        small = Image.fromarray(rng.integers(0, 256, (6, 8, 3), dtype=np.uint8))
        small.resize((80, 60), Image.Resampling.BICUBIC).save(path)
    return paths


class Encoder:
    """Stands in for a plug-in: mean colours, and how many pictures it was given."""

    def __init__(self, version="1", fails_after=None):
        self.given, self._version, self.fails_after = 0, version, fails_after
        self.plugin = types.SimpleNamespace(
            available=lambda: None, version=lambda argument: self._version + argument, encoder=self.load
        )

    def load(self, argument, device):
        assert device == "cpu"
        return 16, self.encode

    def encode(self, images):
        if self.fails_after is not None and self.given >= self.fails_after:
            raise KeyboardInterrupt
        self.given += len(images)
        assert images.shape[1:] == (16, 16, 3)
        return images.mean(axis=(1, 2)).astype(np.float32)


@pytest.fixture
def use(monkeypatch):
    def use(encoder):
        monkeypatch.setattr(module.plugins, "load", lambda package, name: encoder.plugin)
        return encoder

    return use


def test_each_picture_is_encoded_once(pictures, tmp_path, use):
    cache = tmp_path / "cache"
    encoder = use(Encoder())
    rows = features(split_of(pictures), "any", cache, batch=2)
    expected = np.stack([picture(path, 16).mean(axis=(0, 1)) for path in pictures])
    np.testing.assert_allclose(rows, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-6)
    assert encoder.given == 5
    again = features(split_of(pictures[::-1]), "any", cache, batch=2)
    assert encoder.given == 5
    assert (again == rows[::-1]).all()
    shutil.copy(pictures[0], tmp_path / "renamed.png")
    features(split_of([tmp_path / "renamed.png"]), "any", cache)
    assert encoder.given == 5
    Image.new("RGB", (80, 60), "red").save(pictures[0])
    features(split_of(pictures), "any", cache)
    assert encoder.given == 6


def test_a_run_that_was_stopped_goes_on(pictures, tmp_path, use):
    cache = tmp_path / "cache"
    encoder = use(Encoder(fails_after=4))
    with pytest.raises(KeyboardInterrupt):
        features(split_of(pictures), "any", cache, batch=2)
    encoder.fails_after = None
    seen = []
    features(split_of(pictures), "any", cache, batch=2, progress=lambda *state: seen.append(state[:2]))
    assert encoder.given == 5
    assert seen == [(5, 5)]


def test_another_version_and_a_damaged_row_are_encoded_again(pictures, tmp_path, use):
    cache = tmp_path / "cache"
    rows = features(split_of(pictures), "any", cache) if use(Encoder()) else None
    assert features(split_of(pictures), "any", cache).shape == (5, 3)
    newer = use(Encoder(version="2"))
    features(split_of(pictures), "any", cache)
    features(split_of(pictures), "any:argument", cache)
    assert newer.given == 10
    encoder = use(Encoder())
    for file in cache.rglob("*.npy"):
        file.write_bytes(file.read_bytes()[:40])
    assert (features(split_of(pictures), "any", cache) == rows).all()
    assert encoder.given == 5


@pytest.mark.parametrize("contents", [None, b"", b"not an image", "truncated"])
def test_a_broken_picture_is_named(pictures, tmp_path, use, contents):
    use(Encoder())
    bad = pictures[2]
    whole = bad.read_bytes()
    bad.unlink()
    if contents is not None:
        bad.write_bytes(whole[: len(whole) // 2] if contents == "truncated" else contents)
    for compute in (
        lambda: features(split_of(pictures), "any", tmp_path),
        lambda: sharpness(split_of(pictures), tmp_path),
    ):
        with pytest.raises(UserError, match=r"2\.png"):
            compute()


def test_transparent_pixels_are_white(tmp_path):
    Image.new("RGBA", (20, 10), (255, 0, 0, 0)).save(tmp_path / "clear.png")
    assert (picture(tmp_path / "clear.png", 8) == 1).all()


def test_a_large_jpeg_gives_what_the_whole_one_would(tmp_path, pictures):
    large = Image.open(pictures[0]).resize((1600, 1200), Image.Resampling.BICUBIC)
    large.save(tmp_path / "large.jpg", quality=95)
    large.save(tmp_path / "large.png")
    difference = picture(tmp_path / "large.jpg", 64) - picture(tmp_path / "large.png", 64)
    assert np.abs(difference).mean() < 0.01


def test_efficientnet_sees_that_a_picture_resembles_its_shifted_self(small_room, tmp_path):
    paths = sorted((small_room / "train").iterdir())[:2]
    shifted = tmp_path / "shifted.png"
    with Image.open(paths[0]) as image:
        wide, high = image.size
        image.convert("RGB").crop((wide // 20, 0, wide, high)).save(shifted)
    rows = features(split_of([*paths, shifted]), "efficientnet-lite0", tmp_path / "cache", batch=2)
    assert rows.shape == (3, 1280)
    assert rows.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-6)
    assert rows[0] @ rows[2] > rows[0] @ rows[1]


def test_open_clip_runs_any_of_its_models(pictures, tmp_path):
    """With weights made here, since none can be fetched: the code path from a weights file to rows is the same."""
    from viewbench.common.torchvision_cpu import import_torchvision

    import_torchvision()
    import open_clip
    import torch

    torch.manual_seed(0)
    weights = tmp_path / "weights.pt"
    torch.save(open_clip.create_model("ViT-S-32").state_dict(), weights)
    rows = features(split_of(pictures[:3]), f"open_clip:ViT-S-32/{weights}", tmp_path / "cache", batch=2)
    assert rows.shape == (3, 384)
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize(
    ("encoder", "message"),
    [
        ("efficientnet", "did you mean 'efficientnet-lite0'"),
        ("open_clip:ViT-B-33/openai", "did you mean 'ViT-B-3"),
        ("open_clip:ViT-S-32", "names no weights"),
        ("open_clip:ViT-S-32/no-such-tag", "not in reach"),
        ("none", "leave the semantic factor out"),
    ],
)
def test_encoders_that_cannot_be_had(pictures, tmp_path, encoder, message):
    with pytest.raises(UserError, match=message):
        features(split_of(pictures), encoder, tmp_path)


@pytest.mark.parametrize("name", [name for name in plugins.names("scenes.encoders") if name != "none"])
def test_encoders_say_what_they_are_without_loading(name):
    plugin = plugins.load("scenes.encoders", name)
    assert plugin.available() is None
    assert plugin.version("") == plugin.version("")


def test_user_features(tmp_path):
    file = tmp_path / "f.npy"
    np.save(file, np.arange(12).reshape(4, 3))
    assert load_user_features(file, 4).dtype == np.float32
    wrong = {
        "one row for each of 5": (np.ones((4, 3)), 5),
        "shape \\(4,\\)": (np.ones(4), 4),
        "<U1": (np.full((4, 2), "a"), 4),
        "row 2": (np.where(np.arange(4)[:, None] == 2, np.inf, np.ones((4, 3))), 4),
        "not a .npy file": (np.array([{}, {}], dtype=object), 2),
    }
    for message, (array, n) in wrong.items():
        np.save(file, array)
        with pytest.raises(UserError, match=message):
            load_user_features(file, n)
    np.savez(tmp_path / "f.npz", a=np.ones((4, 3)))
    for path, message in (("f.npz", "not a .npy file"), ("missing.npy", "No such file")):
        with pytest.raises(UserError, match=message):
            load_user_features(tmp_path / path, 4)
    for contents in (b"", b"\x93NUMPY", b"hello"):
        file.write_bytes(contents)
        with pytest.raises(UserError, match=r"not a \.npy file of numbers"):
            load_user_features(file, 4)


def test_blur_lowers_sharpness(tmp_path):
    rng = np.random.default_rng(0)
    image = Image.fromarray(rng.integers(0, 256, (300, 400), dtype=np.uint8)).filter(ImageFilter.GaussianBlur(1))
    paths = [tmp_path / f"{radius}.png" for radius in range(5)]
    for radius, path in enumerate(paths):
        image.filter(ImageFilter.GaussianBlur(radius)).save(path)
    values = sharpness(split_of(paths), tmp_path / "cache")
    assert (np.diff(values) < 0).all()
    assert (sharpness(split_of(paths), tmp_path / "cache") == values).all()


def test_laplacian_of_a_parabola():
    y, x = np.mgrid[:9, :7].astype(float)
    assert laplacian_variance(x * x + 3 * y * y) == pytest.approx(0)  # its Laplacian is 8 everywhere
    checkers = (x + y) % 2
    assert laplacian_variance(checkers) == pytest.approx(16, rel=0.02)  # ±4, as many of both but one
