"""Pictures of one cell: what they show, the same for the same files, within bounds whatever the files are."""

import contextlib
import copy
import io
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from tests.conftest import known
from tests.fuzz._odd import VALUES
from viewbench.common.errors import UserError
from viewbench.common.files import read_json
from viewbench.reports import _run_pictures as pictures
from viewbench.reports._run_cameras import FRAMES, SHADES, _some, cameras, room_of
from viewbench.scenes.pictures import picture_name, save_png

from .fixtures import make_study

BLUE = "#0072B2"


def saved(path, pixels):
    """Written as the evaluation writes renders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(np.asarray(pixels, dtype=np.uint8), path)
    return path


def noise(height, width, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def panels(image, size, count=3):
    """The pictures of a strip as integers, without the words."""
    step = size[0] + pictures.GAP
    return [np.asarray(image)[: size[1], k * step : k * step + size[0]].astype(int) for k in range(count)]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return make_study(
        tmp_path_factory.mktemp("study"), scenes=("room_human",), selectors=("uniform", "maxmin"), ratios=(0.03, 0.2)
    )


@pytest.fixture(scope="module")
def room(study):
    return read_json(study / "scenes" / "room_human.json", "scene")


def cell_of(study, selector, ratio, seed=0):
    return study / "cells" / "splat" / "room_human" / selector / ratio / str(seed)


@given(st.integers(0, 300), st.integers(0, 40))
@settings(max_examples=200, deadline=None)
def test_views_are_at_equal_steps_from_the_first_to_the_last(total, count):
    views = [{"name": str(i), "file": f"renders/{i}.png", "psnr_db": -float(i % 7)} for i in range(total)]
    places = [int(view["name"]) for view in pictures.views_to_show({"views": views}, count)]
    assert len(places) == min(total, count)
    if len(places) == 1:
        assert abs(places[0] - Fraction(total - 1, 2)) <= Fraction(1, 2)
    for k, place in enumerate(places[: len(places) * (len(places) > 1)]):
        assert abs(place - Fraction(k * (total - 1), len(places) - 1)) <= Fraction(1, 2)
    assert places == sorted(set(places))


def test_every_cell_of_a_scene_shows_the_same_views(study):
    cells = [cell_of(study, *names) for names in (("uniform", "0.03", 0), ("maxmin", "0.2", 2), ("full", "1.0", 0))]
    shown = [pictures.views_to_show(read_json(cell / "metrics.json", "metrics"), 4) for cell in cells]
    assert len({tuple(view["name"] for view in views) for views in shown}) == 1
    assert len(shown[0]) == 4
    for cell, views in zip(cells, shown, strict=True):
        for view in views:
            render, truth = pictures.files_of(view, cell, study / "scenes" / "room_human")
            with Image.open(render) as drawn, Image.open(known(truth)) as compared:
                assert drawn.size == compared.size
            assert f"{view['psnr_db']:.1f} dB" in pictures.words_of(view)


def test_a_damaged_view_is_left_out_and_moves_no_other():
    views = [{"name": str(i), "file": f"renders/{i}.png"} for i in range(9)]
    for damaged in VALUES:
        told = pictures.views_to_show({"views": [*views[:4], damaged, *views[5:]]}, 3)
        assert [view["name"] for view in told] == ["0", "8"]
    for metrics in (*VALUES, {"views": 3}, {}):
        with pytest.raises(UserError):
            pictures.views_to_show(metrics, 3)
    assert pictures.views_to_show({"views": []}, 3) == []
    for odd in VALUES:
        assert pictures.words_of({"name": "a view", "psnr_db": odd, "ssim": odd}).startswith("a view")


@pytest.mark.parametrize("file", ["/etc/hostname", "../x.png", "renders/../../x.png", "a\0b"])
def test_a_view_outside_of_the_cell_is_refused(tmp_path, file):
    with pytest.raises(UserError, match="evaluate the cell again"):
        pictures.files_of({"name": "a", "file": file}, tmp_path, tmp_path)


@pytest.mark.parametrize(("height", "width", "times"), [(64, 64, 4), (30, 100, 2), (128, 128, 2), (200, 400, 1)])
def test_a_strip_shows_the_pixels_that_were_scored_and_how_far_they_are_apart(tmp_path, height, width, times):
    truth, drawn = noise(height, width), noise(height, width, 1) // 8 + noise(height, width) // 8 * 7
    name = picture_name(3, "test/0003.png")
    image = pictures.strip(saved(tmp_path / name, drawn), saved(tmp_path / "truth" / name, truth), "words")
    apart = 4 * np.abs(truth.astype(int) - drawn).mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    shown = panels(image, (times * width, times * height))
    for panel, expected in zip(shown, (truth, drawn, np.minimum(apart, 255)), strict=True):
        np.testing.assert_allclose(panel, expected.repeat(times, axis=0).repeat(times, axis=1), atol=1)


def test_equal_pictures_differ_nowhere(tmp_path):
    same = saved(tmp_path / "a.png", noise(64, 48))
    assert not panels(pictures.strip(same, same, ""), (4 * 48, 4 * 64))[2].any()


def test_a_large_strip_is_bounded_in_pixels_and_bytes_and_keeps_means(tmp_path):
    truth = noise(1500, 1500)
    drawn = truth // 8 * 7
    image = pictures.strip(saved(tmp_path / "a.png", drawn), saved(tmp_path / "b.png", truth), "w" * 10_000)
    assert image.size == (1932, 680)
    shown = panels(image, (640, 640))
    for panel, whole in zip(shown[:2], (truth, drawn), strict=True):
        assert abs(panel.mean() - whole.mean()) < 1
    # Means are rounded to whole levels before they are amplified.
    assert abs(shown[2].mean() - 4 * np.abs(truth.astype(int) - drawn).mean()) < pictures.GAIN
    content = pictures.encoded(image)
    assert len(content) <= pictures.BYTES
    static = Image.fromarray(noise(680, 1932))  # worse than any picture
    assert len(pictures.encoded(static)) <= pictures.BYTES


def test_a_reduced_pixel_is_the_mean_of_what_it_covers(tmp_path):
    squares = np.indices((1280, 1280)).sum(axis=0)[..., None].repeat(3, axis=-1) % 2
    drawn, truth = (saved(tmp_path / f"{level}.png", level * squares) for level in (200, 160))
    for panel, level in zip(panels(pictures.strip(drawn, truth, ""), (640, 640)), (80, 100, 4 * 20), strict=True):
        assert np.abs(panel - level).max() <= 1


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 9000), (9000, 1), (700, 3)])
def test_a_strip_of_any_shape_is_within_its_bounds(tmp_path, width, height):
    path = saved(tmp_path / "a.png", noise(height, width))
    image = pictures.strip(path, path, "a view")
    assert pictures.NARROWEST <= image.width <= 1932
    assert image.height <= 680


def test_without_a_truth_to_compare_with_the_render_stands_alone_and_says_why(tmp_path):
    drawn = noise(64, 96)
    assert pictures.ENLARGED // 96 == 2
    render = saved(tmp_path / "a.png", drawn)
    text, cut = tmp_path / "text.png", tmp_path / "cut.png"
    text.write_text("no picture")
    cut.write_bytes(saved(tmp_path / "b.png", drawn).read_bytes()[:-400])
    huge = tmp_path / "huge.png"
    Image.new("1", (10_000, 10_000)).save(huge)
    other = saved(tmp_path / "c.png", noise(96, 64))
    whys = {}
    for truth in (None, tmp_path / "missing.png", text, cut, tmp_path, huge, other):
        image = pictures.strip(render, truth, "words")
        assert image.width == pictures.NARROWEST
        (panel,) = panels(image, (192, 128), 1)
        np.testing.assert_array_equal(panel, drawn.repeat(2, axis=0).repeat(2, axis=1))
        label = np.asarray(image)[128 : 128 + pictures.LINE]
        assert (label < 200).any(axis=-1).sum() > 100, "there are words below it"
        whys.setdefault(pictures._compared(truth, (96, 64))[1], label)
    assert [re.sub(r"\d+", "N", why) for why in whys] == [
        "there is no ground truth to compare it with",
        "the ground truth cannot be read",
        "the ground truth is N x N and the render N x N",
    ]
    labels = list(whys.values())
    assert not any(np.array_equal(labels[i], labels[j]) for i, j in ((0, 1), (0, 2), (1, 2)))


def test_a_truth_of_another_size_is_brought_to_the_renders(tmp_path):
    ramp = np.linspace(0, 255, 128)[None, :, None].repeat(128, axis=0).repeat(3, axis=-1)
    render = saved(tmp_path / "a.png", ramp)
    for size in (64, 100, 512):
        with Image.open(render) as image:
            image.resize((size, size), Image.Resampling.BOX).save(tmp_path / "b.png")
        image = pictures.strip(render, tmp_path / "b.png", "")
        assert panels(image, (256, 256))[2].mean() < 4 * 2
        assert f"{size} x {size}" in pictures._compared(tmp_path / "b.png", (128, 128))[1]


def test_a_render_that_is_no_picture_or_too_large_is_refused_in_one_line(tmp_path):
    good = saved(tmp_path / "good.png", noise(64, 64))
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "cut.png").write_bytes(good.read_bytes()[:-400])
    Image.new("1", (10_000, 10_000)).save(tmp_path / "huge.png")
    for name in ("missing.png", "text.png", "cut.png", "huge.png", ".", "a" * 5000, "\0"):
        with pytest.raises(UserError) as caught:
            pictures.strip(tmp_path / name, good, "")
        assert len(str(caught.value).splitlines()) == 1


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_a_render_of_damaged_bytes_is_drawn_or_refused(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "damaged"
    content = bytearray(saved(folder / "good.png", noise(24, 32)).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, 80))] = data.draw(st.integers(0, 255))
    (folder / "bad.png").write_bytes(content)
    with contextlib.suppress(UserError):
        assert pictures.strip(folder / "bad.png", folder / "good.png", "").width <= 1932


@given(st.text(st.characters(codec=None), max_size=600))
@settings(max_examples=60, deadline=None)
def test_words_of_any_letters_and_length_fit(tmp_path_factory, words):
    path = tmp_path_factory.getbasetemp() / "words.png"
    if not path.exists():
        saved(path, noise(16, 16))
    plain = np.asarray(pictures.strip(path, None, ""))
    image = np.asarray(pictures.strip(path, None, words))
    assert image.shape == plain.shape
    np.testing.assert_array_equal(image[: 256 + pictures.LINE // 2], plain[: 256 + pictures.LINE // 2])


def test_the_same_files_give_the_same_bytes(study, room, tmp_path):
    cell = cell_of(study, "maxmin", "0.2")
    view = pictures.views_to_show(read_json(cell / "metrics.json", "metrics"), 1)[0]
    paths = pictures.files_of(view, cell, study / "scenes" / "room_human")
    strips = {pictures.encoded(pictures.strip(*paths, pictures.words_of(view))) for _ in range(3)}
    choice = read_json(cell / "selection.json", "selection")
    drawn = {pictures.encoded(cameras(room, choice, BLUE), pictures.PNG) for _ in range(3)}
    assert len(strips) == len(drawn) == 1
    with Image.open(io.BytesIO(strips.pop())) as strip, Image.open(io.BytesIO(drawn.pop())) as figure:
        assert (strip.format, figure.format) == ("JPEG", "PNG")
        np.testing.assert_array_equal(np.asarray(figure), np.asarray(cameras(room, choice, BLUE)))


def test_mlflow_shows_files_of_these_endings_as_pictures():
    mlflow = pytest.importorskip("mlflow")
    scripts = Path(mlflow.__file__).parent / "server" / "js" / "build" / "static" / "js"
    found = [
        set(re.findall(r'"(\w+)"', match))
        for path in scripts.glob("*.js")
        for match in re.findall(r'new Set\(\[((?:"\w+",?)+)\]\)', path.read_text(encoding="utf-8"))
        if '"jpg"' in match and '"svg"' in match
    ]
    if not found:
        pytest.skip("this MLflow has no page, or says otherwise which files are pictures")
    for endings in found:
        assert {pictures.JPEG[1:], pictures.PNG[1:]} <= endings


def test_nothing_slow_is_imported(study):
    code = (
        "import json, sys; from pathlib import Path; from viewbench.reports import _run_pictures, _run_cameras\n"
        f"study = Path({str(study)!r}); description = json.loads((study / 'scenes/room_human.json').read_text())\n"
        f"cell = Path({str(cell_of(study, 'uniform', '0.03'))!r})\n"
        "_run_cameras.cameras(description, json.loads((cell / 'selection.json').read_text()), '#0072B2')\n"
        "view = _run_pictures.views_to_show(json.loads((cell / 'metrics.json').read_text()), 1)[0]\n"
        "_run_pictures.strip(*_run_pictures.files_of(view, cell, study / 'scenes/room_human'), '')\n"
        "print([name for name in ('matplotlib', 'scipy', 'skimage', 'mlflow', 'pandas') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# Cameras from above.


def like(image, colour):
    """(M, 2) x and y of the pixels of the room that have this colour, without the title and the legend."""
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    pixels = np.asarray(image).astype(int)[30:-26]
    return np.argwhere(np.abs(pixels - rgb).max(axis=-1) < 40)[:, ::-1]


def scene(positions, forward, test=(), points=None):
    split = {"positions": np.asarray(positions).tolist(), "forward": np.asarray(forward).tolist()}
    return {"scene": "made", "train": split, "test": {"positions": [list(row) for row in test]}, "points": points}


def walk(n=60):
    """Cameras at one height (z) that look around, level; up is z and the page's axes are x and y."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    level = np.stack([np.cos(5 * angle), np.sin(5 * angle), np.full(n, -0.05)], axis=1)
    return np.stack([3 * np.cos(angle), 2 * np.sin(angle), np.ones(n)], axis=1), level


def chosen(*indices):
    return {"selector": "uniform", "indices": list(indices)}


def test_both_axes_have_one_scale_and_chosen_cameras_are_where_they_stand():
    positions, forward = walk()
    corners = (0, 15, 30, 45)
    forward[list(corners)] = [0, 0, -1]  # they look down, and have no line
    description = scene(positions, forward)
    at = {k: like(cameras(description, chosen(k), BLUE), BLUE).mean(axis=0) for k in corners}
    for a, b in ((0, 30), (15, 45), (0, 15), (30, 45)):
        along = (positions[b] - positions[a])[:2] * [1, -1]
        unit = np.linalg.norm(at[30] - at[0]) / 6
        np.testing.assert_allclose(at[b] - at[a], along * unit, atol=0.75)
    together = like(cameras(description, chosen(*corners), BLUE), BLUE)
    nearest = np.abs(together[:, None] - np.array(list(at.values()))).max(axis=-1).min(axis=1)
    assert (nearest < 6).all()


@pytest.mark.parametrize(("look", "page"), [((1, 0), (1, 0)), ((-1, 0), (-1, 0)), ((0, 1), (0, -1)), ((0, -1), (0, 1))])
def test_the_line_points_where_the_camera_looks(look, page):
    positions, forward = walk()
    forward[7] = [0, 0, -1]
    still = like(cameras(scene(positions, forward), chosen(7), BLUE), BLUE)
    forward[7] = [*look, 0]
    looking = like(cameras(scene(positions, forward), chosen(7), BLUE), BLUE)
    towards = looking.mean(axis=0) - still.mean(axis=0)
    assert towards @ page > 1
    assert abs(towards[::-1] @ np.abs(page)) < 0.5
    assert 8 < np.abs(looking - still.mean(axis=0)).max() < 20


def test_pictures_of_a_scene_can_be_laid_over_one_another(room, study):
    drawn_once = room_of(room)
    few, many = (
        cameras(drawn_once, read_json(cell_of(study, "uniform", ratio) / "selection.json", ""), BLUE)
        for ratio in ("0.03", "0.2")
    )
    assert few.size == many.size
    again = read_json(cell_of(study, "uniform", "0.03") / "selection.json", "")
    assert cameras(drawn_once, again, BLUE).tobytes() == cameras(room, again, BLUE).tobytes() == few.tobytes()
    changed = (np.asarray(few)[30:-26] != np.asarray(many)[30:-26]).any(axis=-1).mean()
    assert 0 < changed < 0.1
    assert len(like(few, BLUE)) < len(like(many, BLUE))


def test_the_chosen_the_path_the_test_views_and_the_points_are_all_there(room):
    bare = room | {"points": []}
    assert len(like(cameras(bare, chosen(5), BLUE), BLUE)) > 20
    assert len(like(cameras(bare, chosen(), BLUE), BLUE)) == 0
    assert len(like(cameras(bare, chosen(), BLUE), "#444444")) > 200, "hollow diamonds"
    no_test = bare | {"test": {"positions": []}}
    assert len(like(cameras(no_test, chosen(), BLUE), "#444444")) == 0
    assert len(like(cameras(no_test, chosen(), BLUE), "#A6A6A6")) > 500, "the path"
    faint = [(np.asarray(cameras(record, chosen(), BLUE)) == SHADES[1]).all(axis=-1).sum() for record in (room, bare)]
    assert faint[0] > faint[1] + 1000, "points"


def test_walls_are_darker_than_floors():
    positions, forward = walk()
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform([-3, -2, 0], [3, 2, 0], (2000, 3)), np.full((2000, 3), 90)])
    wall = np.column_stack([np.full(2000, 3.5), rng.uniform([-2, 0], [2, 2.5], (2000, 2)), np.full((2000, 3), 90)])
    image = cameras(scene(positions, forward, points=np.vstack([floor, wall]).tolist()), chosen(), BLUE)
    pixels = np.asarray(image.convert("L"))[30:-26].astype(int)
    columns = np.sort(pixels.mean(axis=0))
    assert columns[0] < columns[len(columns) // 2] - 10, "the columns of the wall stand out"


def test_points_that_are_no_numbers_are_left_out(room):
    small = room | {"points": room["points"][:50]}
    plain = cameras(small, chosen(3), BLUE)
    damaged = small | {"points": [*small["points"], [float("nan")] * 6, [float("inf")] * 6, [1e300] * 6]}
    assert cameras(damaged, chosen(3), BLUE).tobytes() == plain.tobytes()
    none = cameras(small | {"points": None}, chosen(3), BLUE).tobytes()
    for odd in ([["a"]], [[1.0]], [[]], 7, "x", [[1, 2, 3, 4, 5, 6], [1]], [None]):
        assert cameras(small | {"points": odd}, chosen(3), BLUE).tobytes() == none


@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("extent", [1e-3, 1.0, 1e5])
def test_scenes_of_any_unit_look_alike(extent, offset):
    positions, forward = walk()
    image = cameras(scene(extent * positions + offset, forward, extent * positions[:3] + offset), chosen(4, 9), BLUE)
    usual = cameras(scene(positions, forward, positions[:3]), chosen(4, 9), BLUE)
    assert abs(image.height - usual.height) <= 1
    assert abs(len(like(image, BLUE)) - len(like(usual, BLUE))) < 10


def test_one_camera_and_cameras_at_one_place_are_drawn(room):
    one = scene([[1, 2, 3]], [[0, 1, 0]])
    same = scene([[1, 2, 3]] * 40, walk(40)[1], [[1, 2, 3]] * 4)
    for description in (one, same, scene([[1, 2, 3]], [[0, 0, -1]]), one | {"points": room["points"]}):
        for choice in (chosen(0), chosen()):
            image = cameras(description, choice, BLUE)
            assert image.width == 640
            assert image.height <= 640
            assert bool(len(like(image, BLUE))) == bool(choice["indices"])


def test_the_scale_bar_is_as_long_as_it_says(room):
    positions, forward = walk()
    forward[[0, 30]] = [0, 0, -1]
    first, last = (cameras(scene(positions, forward), chosen(k), BLUE) for k in (0, 30))
    unit = (like(first, BLUE).mean(axis=0) - like(last, BLUE).mean(axis=0))[0] / 6
    dark = (np.asarray(first.convert("L"))[17, 320:] < 60).astype(int)
    edges = np.flatnonzero(np.diff(np.pad(dark, 1)))
    bar = max(edges[1::2] - edges[::2])
    assert min(abs(bar - length * unit) for length in (0.5, 1, 2, 5)) < 2
    still = cameras(scene([[1, 2, 3]] * 40, walk(40)[1]), chosen(0), BLUE)
    assert not (np.asarray(still.convert("L"))[:30, 400:] < 200).any()


def test_a_tripod_shows_the_room_around_it(room):
    look = walk(40)[1]
    description = scene([[2.5, 2, 1.5]] * 40, look, points=[[float("nan")] * 6, *room["points"]])
    image = cameras(description, chosen(0, 11), BLUE)
    assert (np.asarray(image) == SHADES[1]).all(axis=-1).sum() > 1000


def test_a_viewing_direction_of_no_length_is_refused():
    positions, forward = walk(12)
    for bad in (0.0, 1e-200, float("nan"), float("inf"), 1e300):
        forward[5] = bad
        with pytest.raises(UserError, match="description of scene 'made'"):
            cameras(scene(positions, forward), chosen(1), BLUE)


@given(st.integers(0, 5 * FRAMES))
@settings(max_examples=50, deadline=None)
def test_of_many_cameras_some_are_drawn_at_equal_steps(total):
    some = _some(np.arange(total))
    assert min(total, FRAMES // 2) <= len(some) <= FRAMES
    assert len(set(np.diff(some))) <= 1
    assert total > FRAMES or len(some) == total


def test_many_cameras_are_drawn_in_part():
    n = 60_000
    positions, forward = walk(n)
    image = cameras(scene(positions, forward, positions), chosen(*range(n)), "#000000")
    assert image.height <= 640


def test_damaged_records_are_drawn_within_bounds_or_refused_in_one_line():
    positions, forward = walk(12)
    good = scene(positions, forward, positions[:2], [[1.0, 2, 3, 4, 5, 6]])
    places = [(), ("scene",), ("train",), ("test",), ("points",), ("points", 0), ("points", 0, 1)]
    places += [("train", part) for part in ("positions", "forward")] + [("test", "positions")]
    places += [("train", "positions", 3), ("train", "positions", 3, 1), ("train", "forward", 3, 2)]
    refused, drawn = [], 0
    for value in VALUES:
        jobs = [(changed(good, place, value), chosen(1, 2), BLUE) for place in places]
        jobs += [(good, changed(chosen(1, 2), place, value), BLUE) for place in ((), ("indices",), ("indices", 1))]
        jobs += [(good, chosen(1), value), (good, chosen(1) | {"selector": value}, BLUE)]
        for job in jobs:
            try:
                image = cameras(*job)
                assert image.width == 640
                assert image.height <= 640
                drawn += 1
            except UserError as error:
                refused.append(str(error))
    assert all(len(message.splitlines()) == 1 for message in refused)
    assert min(len(refused), drawn) > 100


def changed(record, place, value):
    """A copy with another value there."""
    if not place:
        return value
    record = copy.deepcopy(record)
    at = record
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return record


@pytest.mark.parametrize("index", [-1, 400, 10**30, True, 1.0, "1", None])
def test_a_choice_that_is_not_there_is_refused(room, index):
    with pytest.raises(UserError, match=r"select again|run the study again"):
        cameras(room, chosen(0, index), BLUE)


def test_the_title_has_the_studys_name_of_the_selector(room):
    own, given, same = (np.asarray(cameras(room, chosen(0), BLUE, name)) for name in ("", "pos+ang", "uniform"))
    assert (own[:30] != given[:30]).any()
    np.testing.assert_array_equal(own[30:], given[30:])
    np.testing.assert_array_equal(own, same)
