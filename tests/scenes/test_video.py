"""Videos as people have them: which frames are decoded, under which numbers, turned how, in which colours."""

import gc
import json
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.formats import _video_decode, _video_packets
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_subset
from viewbench.scenes.thinning import Thinning
from viewbench.workflow.commands import _main

av = pytest.importorskip("av")
SETTINGS = settings_file.load()
CODECS = {
    "h264": ("libx264", "yuv420p", {"g": "12", "bf": "3"}, "mp4"),
    "h264 open": ("libx264", "yuv420p", {"x264-params": "keyint=10:min-keyint=10:open-gop=1:bframes=3"}, "mp4"),
    "h264 one key": ("libx264", "yuv420p", {"g": "1000", "sc_threshold": "0"}, "mov"),
    "h264 intra refresh": ("libx264", "yuv420p", {"x264-params": "keyint=10:intra-refresh=1:bframes=0"}, "mkv"),
    "h264 ts": ("libx264", "yuv420p", {"g": "10", "bf": "2"}, "m2ts"),
    "h264 mkv": ("libx264", "yuv420p", {"g": "10", "bf": "3"}, "mkv"),
    "hevc": ("libx265", "yuv420p", {"x265-params": "keyint=10:min-keyint=10:open-gop=1:log-level=none"}, "mp4"),
    "hevc layers": ("libx265", "yuv420p", {"x265-params": "keyint=20:temporal-layers=3:log-level=none"}, "mp4"),
    "hevc 10": ("libx265", "yuv420p10le", {"x265-params": "keyint=10:log-level=none"}, "mov"),
    "mpeg4 avi": ("mpeg4", "yuv420p", {"g": "10", "bf": "2"}, "avi"),
    "vp9": ("libvpx-vp9", "yuv420p", {"g": "10", "deadline": "realtime", "cpu-used": "8"}, "webm"),
    "mjpeg": ("mjpeg", "yuvj420p", {}, "avi"),
}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "viewbench" / "video"


def scenery(n, height=64, width=96):
    """(n, H, W, 3) a pattern that moves, brighter with every frame, so that each is told from the others."""
    rng = np.random.default_rng(0)
    coarse = rng.integers(0, 120, (height // 8, width // 8 + n, 3))
    big = np.repeat(np.repeat(coarse, 8, axis=0), 8, axis=1)
    return np.stack([big[:, 2 * i : 2 * i + width] + (3 * i) % 130 for i in range(n)]).astype(np.uint8)


def encode(path, pictures, codec="h264", times=None, audio=False, prepare=lambda stream: None):
    """A video of the pictures by PyAV's own encoder; `times` in milliseconds, else 10 a second."""
    name, pixels, options, _ = CODECS[codec]
    with av.open(str(path), "w") as container:
        stream = container.add_stream(name, rate=10, options=options)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pixels
        base = Fraction(1, 10) if times is None else Fraction(1, 1000)
        stream.codec_context.time_base = base
        prepare(stream)
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = number if times is None else times[number], base
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def full_decode(path):
    """Every frame as a plain decode from the first packet on gives it."""
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def read(path, **options):
    return open_scene(str(path), SETTINGS, video=options)


@pytest.mark.parametrize("codec", CODECS)
def test_frames_found_by_seeking_are_those_of_a_full_decode(tmp_path, codec):
    path = encode(tmp_path / f"walk.{CODECS[codec][3]}", scenery(130), codec)
    everything = full_decode(path)
    packets = _video_packets.read_packets(path)
    assert len(packets.frames) == len(everything) == 130
    rng = np.random.default_rng(1)
    for numbers in ([129], [0, 64], sorted(rng.choice(130, 9, replace=False)), range(0, 130, 7), range(130)):
        found = dict(_video_decode.frames(path, packets, list(numbers)))
        assert sorted(found) == list(numbers)
        for number, frame in found.items():
            np.testing.assert_array_equal(frame.to_ndarray(format="rgb24"), everything[number])


@pytest.mark.parametrize("codec", ["h264", "hevc", "mpeg4 avi"])
def test_written_frames_keep_number_time_and_pixels(tmp_path, codec):
    path = encode(tmp_path / f"walk.{CODECS[codec][3]}", scenery(100), codec)
    whole, thin = read(path), read(path, thinning=Thinning(stride=7))
    assert thin.train.names == whole.train.names[::7]
    np.testing.assert_array_equal(known(thin.train.times), known(whole.train.times)[::7])
    write_subset(whole, {"indices": list(range(100))}, tmp_path / "all")
    write_subset(thin, {"indices": [3, 1, 12]}, tmp_path / "some")
    written = sorted(file.name for file in (tmp_path / "some" / "images").iterdir())
    assert written == ["frame_000007.png", "frame_000021.png", "frame_000084.png"]
    for name in written:
        assert (tmp_path / "some" / "images" / name).read_bytes() == (tmp_path / "all" / "images" / name).read_bytes()


def test_what_is_no_candidate_is_neither_decoded_nor_stored(tmp_path, monkeypatch, cache):
    path = encode(tmp_path / "walk.mp4", scenery(120), "h264")
    fed = []
    decode = _video_decode._decode
    assert _main.run(["info", str(path), "--stride", "60"]) == 0
    assert list(cache.glob("*/frame_*.jpg")) == []
    monkeypatch.setattr(_video_decode, "_decode", lambda s, p, w: (fed.append(p is not None), decode(s, p, w))[1])
    scene = read(path, thinning=Thinning(stride=60))
    assert len(scene.train) == 2
    assert sum(fed) <= 2 * 12  # of 120 packets: at most a group of pictures a frame
    assert len(list(cache.glob("*/frame_*.jpg"))) == 2
    fed.clear()
    assert len(read(path, thinning=Thinning(stride=30)).train) == 4
    assert sum(fed) <= 2 * 12, "thinnings share what was decoded"
    fed.clear()
    read(path, thinning=Thinning(stride=30))
    assert fed == []


def test_frames_that_nothing_needs_are_left_out_of_decoding(tmp_path):
    """Of H.264's B frames those that are no references are skipped on the way to the frame that is wanted."""
    path = encode(tmp_path / "walk.mov", scenery(60), "h264 one key")
    given = []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        for packet in container.demux(stream):
            given += _video_decode._decode(stream, packet if packet.size else None, False)
    assert 10 < len(given) < 50, "frames that others need are still decoded"
    packets = _video_packets.read_packets(path)
    found = [number for number, _ in _video_decode._attempt(path, packets, [50], 0)]
    assert 50 in found
    assert len(found) < 45


def test_what_is_in_memory_does_not_grow_with_the_frames(tmp_path):
    """Nothing but one picture's frames waits for the garbage collector: of a 4K video each is 12 MB."""
    path = encode(tmp_path / "walk.mp4", scenery(60), prepare=lambda s: s.set_display_rotation(90))
    gc.collect()
    gc.disable()
    try:  # the type, and not isinstance, which asks proxies of what is gone
        before = sum(type(thing) is av.VideoFrame for thing in gc.get_objects())
        scene = read(path)
        write_subset(scene, {"indices": list(range(60))}, tmp_path / "out")
        after = sum(type(thing) is av.VideoFrame for thing in gc.get_objects())
    finally:
        gc.enable()
    assert after - before <= 3


def test_a_varying_frame_rate_is_thinned_by_time(tmp_path):
    """Twenty frames in the first second, then four a second: two a second are two of either."""
    times = [*range(0, 1000, 50), *range(1000, 5000, 250)]
    path = encode(tmp_path / "walk.mkv", scenery(len(times)), "h264 mkv", times)
    scene = read(path, thinning=Thinning(fps=2))
    numbers = [int(name[-6:]) for name in scene.train.names]
    assert numbers == [times.index(min(times, key=lambda t: abs(t - tick))) for tick in range(0, 5001, 500)]


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_every_turn_that_a_file_can_ask_for(tmp_path, degrees, flip):
    """The display matrix that libavformat wrote, against PIL's own turning of the picture."""
    corners = np.zeros((64, 96, 3), np.uint8)
    corners[:32, :48], corners[:32, 48:], corners[32:, :48] = (250, 0, 0), (0, 250, 0), (0, 0, 250)
    path = tmp_path / "walk.mp4"
    encode(path, [corners] * 3, prepare=lambda s: s.set_display_rotation(degrees, hflip=flip))
    seen = Image.fromarray(corners).rotate(degrees, expand=True)
    seen = seen.transpose(Image.Transpose.FLIP_LEFT_RIGHT) if flip else seen
    scene = read(path)
    assert (scene.train.cameras.width[0], scene.train.cameras.height[0]) == seen.size
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    for file in (scene.train.paths[1], tmp_path / "out" / "images" / "frame_000001.png"):
        with Image.open(file) as image:
            difference = np.abs(np.asarray(image).astype(int) - np.asarray(seen))
        assert np.median(difference) < 8
        assert difference.mean() < 12


def test_pixels_that_are_not_square_come_out_square(tmp_path):
    """1440 x 1080 shown as 1920 x 1080, in small: structure-from-motion takes pixels to be square."""
    path = tmp_path / "walk.mp4"
    encode(path, scenery(3), prepare=lambda s: setattr(s.codec_context, "sample_aspect_ratio", Fraction(4, 3)))
    scene = read(path)
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    with Image.open(tmp_path / "out" / "images" / "frame_000001.png") as image:
        assert image.size == (128, 64) == (scene.train.cameras.width[0], scene.train.cameras.height[0])


def test_a_cover_is_not_the_film(tmp_path):
    path = tmp_path / "walk.mp4"
    with av.open(str(path), "w") as container:
        cover = container.add_stream("mjpeg", rate=1)
        cover.width, cover.height, cover.pix_fmt = 320, 240, "yuvj420p"
        cover.disposition = av.stream.Disposition.attached_pic
        film = container.add_stream("libx264", rate=10)
        film.width, film.height, film.pix_fmt = 96, 64, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.zeros((240, 320, 3), np.uint8), format="rgb24")
        container.mux(cover.encode(frame))
        container.mux(cover.encode())
        for picture in scenery(5):
            container.mux(film.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(film.encode())
    scene = read(path)
    assert (len(scene.train), int(scene.train.cameras.width[0])) == (5, 96)


def test_a_film_without_a_picture_is_one_sentence(tmp_path):
    path = tmp_path / "talk.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(UserError, match="no video in it"):
        read(path)


def test_a_recording_that_was_cut_off_without_its_index(tmp_path):
    path = encode(tmp_path / "walk.mp4", scenery(60))
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b"moov") - 4])
    with pytest.raises(UserError, match=r"walk\.mp4.*moov.*cut off"):
        read(path)


@pytest.mark.parametrize("codec", ["h264", "h264 mkv", "h264 ts", "mpeg4 avi"])
def test_of_a_cut_file_what_is_there_is_used(tmp_path, codec):
    suffix = CODECS[codec][3]
    path = tmp_path / f"walk.{suffix}"
    encode(path, scenery(100), codec)
    if suffix == "mp4":  # the index first, as a phone's upload has it: the film is cut, the index is whole
        moved = tmp_path / "moved.mp4"
        with av.open(str(path)) as source, av.open(str(moved), "w", options={"movflags": "faststart"}) as target:
            film = source.streams.video[0]
            copy = target.add_stream_from_template(film)
            for packet in source.demux(film):
                if packet.size:
                    packet.stream = copy
                    target.mux(packet)
        path = moved
    write_subset(read(path), {"indices": list(range(100))}, tmp_path / "whole")
    data = path.read_bytes()
    path.write_bytes(data[: 6 * len(data) // 10])
    scene = read(path)
    assert 20 < len(scene.train) < 100
    if suffix == "mp4":
        assert any("of 100 frames" in note for note in scene.notes)
    thin = read(path, thinning=Thinning(stride=9))
    assert set(thin.train.names) <= set(scene.train.names)
    chosen = len(scene.train) // 2
    write_subset(scene, {"indices": [0, chosen]}, tmp_path / "out")
    for number in (0, int(scene.train.names[chosen][-6:])):
        name = f"images/frame_{number:06d}.png"
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_an_edit_list_hides_frames(tmp_path):
    """What an edit list cuts off the start is decoded and not shown: numbers are of what is shown."""
    path = encode(tmp_path / "walk.mp4", scenery(60), "h264 one key")
    data = bytearray(path.read_bytes())
    at = data.index(b"elst") + 4
    assert int.from_bytes(data[at + 4 : at + 8], "big") == 1, "one edit"
    with av.open(str(path)) as container:
        base = container.streams.video[0].time_base
    media = int.from_bytes(data[at + 12 : at + 16], "big")
    data[at + 12 : at + 16] = (media + round(1.0 / base)).to_bytes(4, "big")  # a second, ten frames
    path.write_bytes(data)
    everything = full_decode(path)
    scene = read(path)
    assert len(everything) == len(scene.train) == 50
    packets = scene.details["packets"]
    for number, frame in _video_decode.frames(path, packets, [0, 23, 49]):
        np.testing.assert_array_equal(frame.to_ndarray(format="rgb24"), everything[number])


def test_the_command_line_thins(tmp_path, capsys):
    path = encode(tmp_path / "my walk ż.mp4", scenery(90))
    base = ["select", str(path), "--selector", "uniform", "--count", "4"]
    assert _main.run([*base, "--fps", "1", "--out", str(tmp_path / "out")]) == 0
    captured = capsys.readouterr()
    assert "10 of its 90 frames" in captured.err
    chosen = json.loads((tmp_path / "out" / "selection.json").read_text())
    assert chosen["n_views"] == 10
    assert all(int(name[-6:]) % 10 == 0 or name == "frame_000089" for name in chosen["names"])
    for wrong in (["--fps", "0"], ["--stride", "0"], ["--fps", "1", "--stride", "2"], ["--stride", "1000"]):
        assert _main.run([*base, *wrong, "--out", str(tmp_path / "no")]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert _main.run(["info", str(path), "--stride", "30"]) == 0
    assert "training views      3" in capsys.readouterr().out


def test_two_thinnings_are_two_scenes(tmp_path):
    from viewbench.scenes.digest import scene_sha256

    path = encode(tmp_path / "walk.mp4", scenery(40))
    hashes = {scene_sha256(read(path, thinning=t)) for t in (Thinning(), Thinning(2), Thinning(3), Thinning(fps=5.0))}
    assert len(hashes) == 4
