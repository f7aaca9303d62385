"""The colours of videos: matrices, ranges, bit depths, and high dynamic range, against what was encoded."""

import numpy as np
import pytest
from PIL import Image

from viewbench.common import settings as settings_file
from viewbench.scenes.formats import _tone
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_subset

av = pytest.importorskip("av")
SETTINGS = settings_file.load()
MATRICES = {"bt709": (0.2126, 0.0722, 1), "bt601": (0.299, 0.114, 6), "bt2020": (0.2627, 0.0593, 9)}  # kr, kb, code
HLG, PQ = 18, 16
GREYS = [(v, v, v) for v in (0, 32, 64, 96, 128, 160, 192, 215)]
PATCHES = np.array(
    [*GREYS, (200, 0, 0), (0, 200, 0), (0, 0, 200), (200, 200, 0), (0, 180, 180), (180, 90, 50), (30, 60, 90)]
    + [(220, 180, 150)]
)  # 16
WHITES = np.array([(255, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)])


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def to_yuv(rgb, matrix, full, bits):
    """R'G'B' in [0, 1] as codes: ITU-R BT.709-6 item 3, BT.601-7 2.5, BT.2020-2 table 4."""
    kr, kb, _ = MATRICES[matrix]
    y = rgb @ np.array([kr, 1 - kr - kb, kb])
    cb, cr = (rgb[:, 2] - y) / (2 * (1 - kb)), (rgb[:, 0] - y) / (2 * (1 - kr))
    step, top = 2 ** (bits - 8), 2**bits - 1
    if full:
        codes = np.stack([y * top, cb * top + 128 * step, cr * top + 128 * step], 1)
    else:
        codes = np.stack([(219 * y + 16) * step, (224 * cb + 128) * step, (224 * cr + 128) * step], 1)
    return np.clip(np.round(codes), 0, top).astype(np.uint16 if bits > 8 else np.uint8)


def encode(path, rgb, codec, pixels, matrix="bt709", full=False, trc=1, primaries=1, tagged=True, cell=64):
    """Three frames of patches (four a row) of the R'G'B' in [0, 1]."""
    bits = 10 if "10" in pixels else 8
    rgb = np.concatenate([rgb, np.zeros((-len(rgb) % 4, 3))])
    codes = to_yuv(rgb, matrix, full, bits).reshape(-1, 4, 3)
    large = np.repeat(np.repeat(codes, cell, axis=0), cell, axis=1)
    height, width = large.shape[:2]
    frame = av.VideoFrame(width, height, pixels)
    for plane, values in zip(frame.planes, (large[..., 0], large[::2, ::2, 1], large[::2, ::2, 2]), strict=True):
        rows = np.ascontiguousarray(values).view(np.uint8)
        np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)[: len(rows), : rows.shape[1]] = rows
    with av.open(str(path), "w") as container:
        quality = {"crf": "2", "x265-params": "log-level=none"}
        stream = container.add_stream(codec, rate=10, options=quality)
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        if tagged:
            context = stream.codec_context
            context.color_range = frame.color_range = 2 if full else 1
            context.colorspace = frame.colorspace = MATRICES[matrix][2]
            context.color_trc, context.color_primaries = trc, primaries
        for number in range(3):
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def patches(path, count, tmp_path, cell=64):
    """(count, 3) colours in the middle of the patches of the frame that is written, and of the small picture."""
    scene = open_scene(str(path), SETTINGS)
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    found = []
    for file in (tmp_path / "out" / "images" / "frame_000001.png", scene.train.paths[1]):
        with Image.open(file) as image:
            seen = np.asarray(image.convert("RGB"))
        step = cell * seen.shape[1] // (4 * cell)
        found.append(seen[step // 2 :: step, step // 2 :: step].reshape(-1, 3)[:count].astype(int))
    return scene, *found


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize(
    ("codec", "pixels"), [("libx264", "yuv420p"), ("libx265", "yuv420p"), ("libx265", "yuv420p10le")]
)
def test_tagged_colours_come_back(tmp_path, codec, pixels, matrix, full):
    encode(tmp_path / "a.mp4", PATCHES / 255, codec, pixels, matrix, full)
    _, large, small = patches(tmp_path / "a.mp4", len(PATCHES), tmp_path)
    assert np.abs(large - PATCHES).max() <= 3
    assert np.abs(small - PATCHES).max() <= 8  # a JPEG


@pytest.mark.parametrize(("matrix", "cell"), [("bt601", 64), ("bt709", 320)])
def test_untagged_colours_are_those_of_their_size(tmp_path, matrix, cell):
    encode(tmp_path / "a.mp4", PATCHES / 255, "libx264", "yuv420p", matrix, tagged=False, cell=cell)
    _, large, _ = patches(tmp_path / "a.mp4", len(PATCHES), tmp_path, cell)
    assert np.abs(large - PATCHES).max() <= 3


def linear(srgb):
    """IEC 61966-2-1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def filmed(srgb, trc):
    """R'G'B' of HDR video of an sRGB picture whose white is HDR Reference White, 203 cd/m².

    ITU-R BT.2087-0 takes BT.709 to BT.2020; BT.2100-2 table 5 (HLG's OETF, and the inverse of the OOTF of a display
    of 1,000 cd/m²) and table 4 (PQ's inverse EOTF).
    """
    light = (
        203 * linear(srgb) @ np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]).T
    )
    if trc == PQ:
        m1, m2, c1, c2, c3 = 0.1593017578125, 78.84375, 0.8359375, 18.8515625, 18.6875
        y = np.maximum(light, 0) / 10000
        return ((c1 + c2 * y**m1) / (1 + c3 * y**m1)) ** m2
    luminance = np.maximum(light @ np.array([0.2627, 0.6780, 0.0593]), 1e-9)
    scene = (luminance / 1000)[:, None] ** ((1 - 1.2) / 1.2) * np.maximum(light, 0) / 1000
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), a * np.log(np.maximum(12 * scene - b, 1e-9)) + c)


@pytest.mark.parametrize("trc", [HLG, PQ])
def test_hdr_gives_the_colours_of_sdr(tmp_path, trc):
    """A ramp of greys and patches up to the knee; above, highlights are bent, in order and with their hue."""
    encode(tmp_path / "a.mp4", filmed(PATCHES / 255, trc), "libx265", "yuv420p10le", "bt2020", False, trc, 9)
    scene, large, small = patches(tmp_path / "a.mp4", len(PATCHES), tmp_path)
    assert any("high dynamic range" in note for note in scene.notes)
    assert np.abs(large - PATCHES)[: len(GREYS)].max() <= 4
    assert np.abs(large - PATCHES).max() <= 10  # saturated blue: a step of chroma in 10 bits
    assert np.abs(small - PATCHES).max() <= 12
    encode(tmp_path / "b.mp4", filmed(WHITES / 255, trc), "libx265", "yuv420p10le", "bt2020", False, trc, 9)
    _, large, _ = patches(tmp_path / "b.mp4", len(WHITES), tmp_path / "b")
    assert (large[WHITES == 255] >= 235).all()
    assert (large[WHITES == 0] <= 12).all()


@pytest.mark.parametrize("trc", [HLG, PQ])
def test_untouched_hdr_would_not_pass(tmp_path, trc):
    """What the test above is for: the codes themselves are another picture."""
    seen = 255 * filmed(PATCHES / 255, trc)
    assert np.abs(seen - PATCHES).max() > 40


def test_highlights_are_bent_in_order_and_keep_their_hue():
    top = np.linspace(0, 12, 2001)[:, None] * np.array([1.0, 0.5, 0.25])
    bent = _tone.bent(top)
    assert (np.diff(bent[:, 0]) >= -1e-12).all()
    assert bent.max() == 1
    low = top[:, 0] <= _tone.KNEE
    np.testing.assert_array_equal(bent[low], top[low])
    np.testing.assert_allclose(bent[1:, 1] / bent[1:, 0], 0.5)
    slope = np.diff(bent[:, 0]) / np.diff(top[:, 0])
    assert np.abs(np.diff(slope)).max() < 0.05, "no edge in the curve"


@pytest.mark.parametrize("hlg", [True, False])
def test_the_curves_are_those_of_the_recommendation(hlg):
    """75 % HLG and 58 % PQ are reference white (BT.2408-7 table 1); what is black stays black."""
    codes = np.array([0.0, 0.75 if hlg else 0.5807])
    light = _tone._light(hlg)[np.round(codes * 65535).astype(int)]
    light = light**1.2 * 1000 / 203 if hlg else light
    np.testing.assert_allclose(light, [0, 1], atol=0.01)
