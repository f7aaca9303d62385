"""Contact sheets: what is on them, whatever the pictures and their names are."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from tests.conftest import known
from viewbench.common.errors import UserError
from viewbench.reports import _contact_sheet
from viewbench.reports._picked import Picked, _next_to
from viewbench.reports._thumbnails import font, shortened, thumbnail
from viewbench.scenes.features import silent
from viewbench.scenes.formats.images import nominal_cameras
from viewbench.scenes.types import Split


def picked_of(paths, chosen, owner, distance):
    n = len(paths)
    names = tuple(path.name for path in paths)
    frames = Split(names, tuple(paths), nominal_cameras(np.tile([64, 48], (n, 1))))
    return Picked("a capture: some views", frames, False, np.array(chosen), np.array(owner), distance, "image content")


@pytest.fixture
def capture(tmp_path):
    """Pictures of one colour each, of every kind and shape, under names that a page must not take for markup."""
    kinds = [
        ("RGB", (64, 48)),
        ("RGB", (27, 48)),
        ("L", (64, 48)),
        ("RGBA", (40, 40)),
        ("P", (64, 20)),
        ("I;16", (9, 9)),
    ]
    paths = []
    for i in range(12):
        mode, size = kinds[i % len(kinds)]
        value = {"RGB": (200, 20 * i, 0), "RGBA": (200, 20 * i, 0, 0), "I;16": 900 * i}.get(mode, 20 * i)
        path = tmp_path / f"-żółć 部屋 <b>& {'very long ' * 15 * (i == 3)}{i}.png"
        Image.new(mode, size, value).save(path)
        paths.append(path)
    return paths


def choice(paths, every=3):
    n = len(paths)
    owner = np.arange(n) // every * every
    chosen = np.unique(owner)[::-1]
    return picked_of(paths, chosen, owner, np.where(np.arange(n) == owner, 0, 0.01 + np.arange(n) / 100))


def test_frames_are_in_capture_order_with_their_picks_and_followers(capture):
    sheet, notes = _contact_sheet.contents(choice(capture))
    assert notes == []
    cards = sheet.parts[0].cards
    assert [card.index for card in cards] == [0, 3, 6, 9]
    assert [card.words for card in cards] == ["0, pick 4", "3, pick 3", "6, pick 2", "9, pick 1"]
    assert [card.mark for card in cards] == ["+2"] * 4


def test_what_was_left_out_is_beside_the_frame_that_it_repeats(capture):
    picked = choice(capture)
    like, unlike = _contact_sheet.contents(picked)[0].parts[1:]
    pairs = [(a.index, b.index, float(b.mark)) for a, b in zip(like.cards[::2], like.cards[1::2], strict=True)]
    assert [pair[:2] for pair in pairs] == [(1, 0), (4, 3), (7, 6), (10, 9)]  # the nearest of each, nearest first
    for left, _, similarity in pairs:
        assert similarity == pytest.approx(1 - known(picked.distance)[left], abs=5e-4)
    assert [card.index for card in unlike.cards] == [11, 9, 8, 6, 5, 3, 2, 0]  # farthest first, none shown twice


def test_nothing_left_out_and_nothing_to_compare_by(capture):
    n = len(capture)
    everything = picked_of(capture, np.arange(n), np.arange(n), np.zeros(n))
    assert len(_contact_sheet.contents(everything)[0].parts) == 1
    uncompared = picked_of(capture, [2, 8], _next_to(n, np.array([8, 2])), None)
    (part,) = _contact_sheet.contents(uncompared)[0].parts
    assert [card.mark for card in part.cards] == ["+5", "+5"]


@settings(max_examples=100, deadline=None)
@given(n=st.integers(1, 60), data=st.data())
def test_the_chosen_frame_next_to_each(n, data):
    chosen = np.array(data.draw(st.lists(st.integers(0, n - 1), min_size=1, unique=True)))
    owner = _next_to(n, chosen)
    for i in range(n):
        away = np.abs(chosen - i)
        assert abs(owner[i] - i) == away.min()
        assert owner[i] == chosen[away == away.min()].min()


def test_a_large_choice_is_shown_at_equal_steps_and_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(_contact_sheet, "MOST", 10)
    paths = [tmp_path / f"{i}.png" for i in range(95)]
    sheet, notes = _contact_sheet.contents(choice(paths, every=1))
    assert notes == ["the sheet shows 10 of the 95 chosen frames, at equal steps"]
    shown = [card.index for card in sheet.parts[0].cards]
    assert shown[0] == 0
    assert shown[-1] == 94
    assert np.ptp(np.diff(shown)) <= 1


@pytest.mark.parametrize("kind", ["jpg", "png", "webp"])
def test_a_picture_of_pictures(capture, tmp_path, kind):
    capture[4].write_bytes(capture[4].read_bytes()[:40])  # one that cannot be read costs no sheet
    path = tmp_path / f"sheet.{kind}"
    assert _contact_sheet.draw(path, choice(capture), silent) == []
    with Image.open(path) as image:
        assert image.format == {"jpg": "JPEG"}.get(kind, kind.upper())
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
    for i in (0, 6):  # chosen, of one colour
        colour = np.array([200, 20 * i, 0])
        assert (np.abs(pixels - colour).max(axis=1) < 12).mean() > 0.005, f"frame {i}"


def test_the_same_choice_gives_the_same_sheet(capture, tmp_path):
    for name in ("a.png", "b.png", "a.html", "b.html"):
        _contact_sheet.draw(tmp_path / name, choice(capture), silent)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_page_stands_alone_and_takes_no_name_for_markup(capture, tmp_path):
    path = tmp_path / "sheet.html"
    _contact_sheet.draw(path, choice(capture), silent)
    text = path.read_text(encoding="utf-8")
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert len(sources) == 4 + 2 * 4 + 2 * 4
    assert all(source.startswith("data:image/jpeg;base64,") for source in sources)
    assert "url(" not in text
    assert "<script" not in text
    assert "&lt;b&gt;&amp;" in text
    assert "żółć 部屋" in text
    assert text.count("<b>") == text.count("</b>") == len(sources)


def test_another_ending_is_answered(tmp_path, capture):
    with pytest.raises(UserError, match=r"did you mean '\.jpe?g'"):
        _contact_sheet.draw(tmp_path / "sheet.jpgg", choice(capture), silent)


@pytest.mark.parametrize(("size", "expected"), [((640, 480), (100, 75)), ((30, 60), (50, 100)), ((2000, 1), (100, 1))])
def test_a_thumbnail_keeps_its_shape(tmp_path, size, expected):
    Image.new("RGB", size, "red").save(tmp_path / "a.jpg")
    small = thumbnail(tmp_path / "a.jpg", 100)
    assert small.size == expected
    assert small.mode == "RGB"


def test_a_thumbnail_is_turned_as_its_file_says(tmp_path):
    image = Image.new("RGB", (64, 48), "black")
    image.paste("white", (0, 0, 32, 48))
    exif = Image.Exif()
    exif[0x0112] = 6  # a quarter turn clockwise: the left of what is stored is the top of what is seen
    image.save(tmp_path / "a.jpg", exif=exif)
    grey = np.asarray(thumbnail(tmp_path / "a.jpg", 64).convert("L"))
    assert grey.shape == (64, 48)
    assert grey[:28].mean() > 230
    assert grey[36:].mean() < 25


def test_alpha_is_laid_on_white_and_deep_grey_is_stretched(tmp_path):
    Image.new("RGBA", (8, 8), (9, 9, 9, 0)).save(tmp_path / "a.png")
    assert np.asarray(thumbnail(tmp_path / "a.png", 8)).min() == 255
    Image.fromarray(np.linspace(0, 4000, 64).reshape(8, 8).astype(np.uint16)).save(tmp_path / "b.png")
    deep = np.asarray(thumbnail(tmp_path / "b.png", 8).convert("L"))
    assert (deep.min(), deep.max()) == (0, 255)


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=60), room=st.integers(20, 300))
def test_a_name_is_shortened_to_the_room_that_there_is(text, room):
    letters = font(13)
    short = shortened(text, room, letters.getlength)
    assert letters.getlength(short) <= room
    assert "\n" not in short
    if text.isprintable() and letters.getlength(text) <= room:
        assert short == text
