"""Captures without poses: a folder of images, and a video."""

import json
import struct

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.selectors import _run
from viewbench.workflow.commands import _main

SETTINGS = settings_file.load()


@pytest.fixture
def folder(tmp_path):
    """Twelve pictures of four colours, three alike in a row; named so that 10 comes after 9 by number only."""
    root = tmp_path / "my capture"
    root.mkdir()
    rng = np.random.default_rng(0)
    for number in range(12):
        colour = np.eye(3)[number // 3 % 3] * 200 if number < 9 else np.full(3, 128)
        pixels = np.clip(colour + rng.normal(size=(48, 64, 3)), 0, 255).astype(np.uint8)
        Image.fromarray(pixels).save(root / f"shot {number}.png")
    return root


def features():
    """One row per picture: those of one colour are nearly the same."""
    return np.repeat(np.eye(4), 3, axis=0) + 0.01 * np.random.default_rng(1).normal(size=(12, 4))


def test_a_folder_is_read_in_natural_order(folder):
    scene = open_scene(str(folder), SETTINGS)
    assert (scene.format, scene.posed) == ("images", False)
    assert scene.train.names == tuple(f"shot {number}.png" for number in range(12))


def test_content_alone_decides(folder):
    scene = open_scene(str(folder), SETTINGS)
    record = _run.run(scene, "maxmin", 4, 0, {}, features())
    assert sorted(index // 3 for index in record["indices"]) == [0, 1, 2, 3]  # one of each colour
    assert record["parameters"]["factors"] == ["sem"]
    assert len(_run.run(scene, "uniform", 4, 0)["indices"]) == 4


@pytest.mark.parametrize(
    ("selector", "parameters", "words"),
    [("coverage", {}, "needs poses"), ("kcenter", {}, "image content only"), ("maxmin", {}, "image content only")],
)
def test_what_needs_poses_is_refused(folder, selector, parameters, words):
    scene = open_scene(str(folder), SETTINGS)
    with pytest.raises(UserError, match=words):
        _run.run(scene, selector, 3, 0, parameters)


def test_the_command_line_writes_the_chosen_images(folder, tmp_path, capsys):
    np.save(tmp_path / "f.npy", features())
    out = tmp_path / "out"
    arguments = ["select", folder, "--count", 4, "--features", tmp_path / "f.npy", "--out", out]
    assert _main.run([str(argument) for argument in arguments]) == 0
    chosen = json.loads((out / "selection.json").read_text())["names"]
    assert sorted(path.name for path in (out / "images").iterdir()) == sorted(chosen)
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_images_of_two_sizes_are_chosen_from(folder, tmp_path):
    Image.new("RGB", (10, 10)).save(folder / "shot 12.png")
    scene = open_scene(str(folder), SETTINGS)
    assert "1 of 10 x 10" in scene.notes[-1]
    rows = np.concatenate([features(), np.ones((1, features().shape[1]))])
    record = _run.run(scene, "maxmin", len(scene.train), 0, features=rows)
    write_subset(scene, record, tmp_path / "out")
    assert len(list((tmp_path / "out" / "images").iterdir())) == len(scene.train)


def test_a_file_that_is_no_image_is_named(folder):
    (folder / "shot 3.png").write_bytes(b"no picture")
    with pytest.raises(UserError, match=r"shot 3\.png"):
        open_scene(str(folder), SETTINGS)


def test_training_is_refused(folder, tmp_path, capsys):
    np.save(tmp_path / "f.npy", features())
    selection = tmp_path / "s.json"
    base = ["select", folder, "--count", 4, "--features", tmp_path / "f.npy", "--selection", selection]
    assert _main.run([str(argument) for argument in base]) == 0
    capsys.readouterr()
    arguments = ["train", folder, "--selection", selection, "--out", tmp_path / "m", "--iterations", 5]
    assert _main.run([str(argument) for argument in arguments]) == 2
    assert "no poses" in capsys.readouterr().err
    assert not (tmp_path / "m").exists()


@pytest.fixture
def video(tmp_path, monkeypatch):
    """Thirty frames at 10 per second whose brightness says which they are."""
    av = pytest.importorskip("av")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "walk.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(30):
            pixels = np.full((48, 64, 3), 8 * number, np.uint8)
            for packet in stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def test_a_video_is_thinned_to_full_size_frames_with_their_numbers(video, tmp_path):
    scene = open_scene(str(video), SETTINGS)
    assert (scene.format, len(scene.train), scene.posed) == ("video", 30, False)
    np.testing.assert_allclose(np.diff(known(scene.train.times)), 0.1, atol=1e-3)
    out = tmp_path / "out"
    arguments = ["select", video, "--count", 5, "--selector", "uniform", "--out", out]
    assert _main.run([str(argument) for argument in arguments]) == 0
    files = sorted((out / "images").iterdir())
    assert len(files) == 5
    for path in files:
        number = int(path.stem.removeprefix("frame_"))
        with Image.open(path) as image:
            assert image.size == (64, 48)
            assert abs(np.asarray(image).mean() - 8 * number) < 6


def test_frames_of_a_video_that_are_held_out_are_written_apart(video, tmp_path):
    scene = open_scene(str(video), SETTINGS, holdout="every:10")
    write_subset(scene, {"indices": [3]}, tmp_path / "out")
    written = sorted(path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.png"))
    # frame 0 is held out, so that training view 3 is frame 4
    assert written == ["images/frame_000004.png", *(f"test/frame_0000{n}0.png" for n in range(3))]


def test_a_video_filmed_on_its_side_is_turned(tmp_path, monkeypatch):
    """The file says: a quarter turn clockwise. The left of what was stored is then the top of what is seen."""
    av = pytest.importorskip("av")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "upright.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        pixels = np.zeros((48, 64, 3), np.uint8)
        pixels[:, :32] = 240
        for _ in range(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode())
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 4 + 40  # the box's version and flags, times, track, duration, layer, volume
    data[matrix : matrix + 36] = struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, 48 << 16, 0, 1 << 30)
    path.write_bytes(data)
    scene = open_scene(str(path), SETTINGS)
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    for file in (scene.train.paths[1], tmp_path / "out" / "images" / "frame_000001.png"):
        with Image.open(file) as image:
            seen = np.asarray(image.convert("L"))
        assert seen.shape == (64, 48)
        assert seen[:28].mean() > 200
        assert seen[36:].mean() < 40


@pytest.mark.parametrize("form", ["transforms", "colmap"])
def test_poses_are_not_made_up(folder, tmp_path, form):
    with pytest.raises(UserError, match="no poses"):
        write_scene(open_scene(str(folder), SETTINGS), np.arange(3), tmp_path / "out", form)
    assert not (tmp_path / "out").exists()


def test_a_video_becomes_frames_and_nothing_becomes_a_video(video, folder, tmp_path):
    for source, form in ((video, "images"), (folder, "video")):
        with pytest.raises(UserError, match="--to video"):
            write_scene(open_scene(str(source), SETTINGS), np.arange(3), tmp_path / "out", form)


def test_a_broken_video_is_one_sentence(tmp_path, monkeypatch):
    pytest.importorskip("av")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "walk.mp4"
    path.write_bytes(b"no video at all" * 100)
    with pytest.raises(UserError, match=r"walk\.mp4"):
        open_scene(str(path), SETTINGS)
