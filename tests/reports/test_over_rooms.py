"""Differences with rooms as the sample: equal to the plain definition, and silent where there is one room."""

import json

import numpy as np
import pytest
from scipy import stats

from tests.conftest import known
from tests.reports.fixtures import make_study
from viewbench.reports import _rooms, over_rooms, scenes
from viewbench.reports._statistics import interval, over_samples
from viewbench.reports._study import load

SCENES = ("a", "b", "c", "d")


@pytest.fixture
def study(tmp_path):
    return make_study(tmp_path, scenes=SCENES)


def rename(folder, key="room", **values):
    """Writes the rooms, or something else, of scenes into their descriptions."""
    for scene, value in values.items():
        path = folder / "scenes" / f"{scene}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))


def means(study, selector, ratios):
    """(scenes,) mean over seeds and ratios, the plain way."""
    return np.array(
        [
            np.mean(
                [
                    cell.psnr_db
                    for cell in study.done
                    if (cell.scene, cell.selector) == (scene, selector) and cell.ratio in ratios
                ]
            )
            for scene in SCENES
        ]
    )


def test_rooms_are_the_sample(study):
    read = load(study)
    rooms = {scene: scene for scene in SCENES}
    found = known(_rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", read.ratios))
    apart = means(read, "maxmin", read.ratios) - means(read, "uniform", read.ratios)
    wanted = stats.ttest_1samp(apart, 0).confidence_interval(0.95)
    interval = [found.mean.mean, known(found.mean.low), known(found.mean.high)]
    np.testing.assert_allclose(interval, [apart.mean(), *wanted])
    without = [np.delete(apart, i).mean() for i in range(4)]
    np.testing.assert_allclose(found.left_out, [min(without), max(without)])
    assert sum(found.counts) == 4


def test_two_walks_through_one_room_count_once(study):
    read = load(study)
    rooms = {"a": "one", "b": "one", "c": "c", "d": "d"}
    found = known(_rooms.over_rooms(read, rooms, "splat", "maxmin", "random", (0.1,)))
    apart = means(read, "maxmin", (0.1,)) - means(read, "random", (0.1,))
    merged = np.array([apart[:2].mean(), apart[2], apart[3]])
    np.testing.assert_allclose(list(found.rooms.values()), merged)
    assert found.mean.mean == pytest.approx(merged.mean())
    low, high = stats.ttest_1samp(merged, 0).confidence_interval(0.95)
    assert known(found.mean.low) <= low + 1e-9, "never narrower than the rooms' own"
    assert known(found.mean.high) >= high - 1e-9


def test_the_table_is_there_for_two_rooms_and_not_for_one(study, tmp_path):
    read = load(study)
    figure, item = over_rooms.build(read, tmp_path)
    assert figure.kind == "figure"
    table = known(item.table)
    assert [row[0].text for row in table.rows] == [
        *("random", "coverage", "logdet", "maxmin"),
        *("coverage", "logdet", "maxmin"),
    ]
    assert all(row[2].text == "4" for row in table.rows)
    assert "count as one" not in item.caption
    rows = (tmp_path / item.files[0]).read_text().splitlines()
    assert len(rows) == 1 + (4 + 3) * (len(read.ratios) + 1) * (4 + 1)
    rename(study, a="one", b="one", c="one", d="two")
    _, item = over_rooms.build(load(study), tmp_path)
    assert known(item.table).rows[0][2].text == "2"
    assert "count as one" in item.caption
    rename(study, d="one")
    assert over_rooms.build(load(study), tmp_path) == []


def test_each_way_of_walking_is_shown_by_itself(study, tmp_path):
    rename(study, "walk", a="human", b="by / hand", c="human", d="by / hand")
    rename(study, a="one", b="one", c="two", d="two")
    read = load(study)
    items = over_rooms.build(read, tmp_path)
    assert [item.title for item in items if item.table] == [
        "Differences over rooms",
        "Differences over rooms: human walks",
        "Differences over rooms: by / hand walks",
    ]
    assert all((tmp_path / name).is_file() for item in items for name in item.files)
    found = [
        _rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", (0.1,)) for rooms in _rooms.groups(read).values()
    ]
    both, human, hand = (known(item).mean.mean for item in found)
    assert both == pytest.approx((human + hand) / 2)
    assert human != pytest.approx(hand)
    rename(study, "walk", b="", d="")
    assert len(over_rooms.build(load(study), tmp_path)) == 2, "one way alone is the study itself"


def test_the_figure_shows_what_the_table_says(study, tmp_path):
    read = load(study)
    figure, item = over_rooms.build(read, tmp_path)
    files = [next(name for name in shown.files if name.endswith(".csv")) for shown in (figure, item)]
    drawn, listed = ((tmp_path / name).read_text().splitlines() for name in files)
    assert drawn[0] == listed[0]
    assert set(drawn[1:]) < set(listed[1:]), "against uniform alone, and without the mean over ratios"


def test_scenes_are_listed_with_what_is_seen_of_their_test_views(study, tmp_path):
    (item,) = scenes.build(load(study), tmp_path)
    assert known(item.table).columns == ("scene", "room", "training views", "test views")
    assert "seen" not in item.caption
    rename(study, "seen", a=[0.9, 0.7, 1.0], c=[1.0, 1.0, 1.0])
    (item,) = scenes.build(load(study), tmp_path)
    rows = {row[0].text: [entry.text for entry in row[-3:]] for row in known(item.table).rows}
    assert rows == {"a": ["86.7 %", "70.0 %", "1"], "b": [""] * 3, "c": ["100.0 %", "100.0 %", "0"], "d": [""] * 3}
    assert "0.9000 0.7000 1.0000" in (tmp_path / item.files[0]).read_text()


def test_a_room_that_lacks_a_side_is_left_out(tmp_path):
    failed = tuple(("splat", "d", "maxmin", None, seed) for seed in (0, 1, 2))
    read = load(make_study(tmp_path, scenes=SCENES, failed=failed))
    rooms = {scene: scene for scene in SCENES}
    assert set(known(_rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", read.ratios)).rooms) == {
        "a",
        "b",
        "c",
    }
    only = {scene: scene for scene in ("a", "d")}
    assert _rooms.over_rooms(read, only, "splat", "maxmin", "uniform", read.ratios) is None


def test_rooms_that_lie_closer_than_their_seeds_explain_do_not_make_an_interval(study):
    """Of rooms with the same difference the seeds' own error is what is left to doubt."""
    read = load(study)
    rooms = {scene: scene for scene in SCENES}
    found = known(_rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", (0.1,)))
    variances = [
        sum(
            np.var([known(c.psnr_db) for c in read.find("splat", scene, name, 0.1)], ddof=1) / len(read.seeds)
            for name in ("maxmin", "uniform")
        )
        for scene in SCENES
    ]
    by_seeds = np.sqrt(sum(variances)) / len(SCENES)
    by_rooms = np.std(list(found.rooms.values()), ddof=1) / np.sqrt(len(SCENES))
    half = stats.t.ppf(0.975, len(SCENES) - 1) * max(by_seeds, by_rooms)
    assert known(found.mean.high) - found.mean.mean == pytest.approx(half)
    same = over_samples([0.3, 0.3, 0.3], 0.1)
    assert known(same.high) - 0.3 == pytest.approx(stats.t.ppf(0.975, 2) * 0.1)


def test_one_sample_and_equal_samples_have_no_interval():
    assert over_samples([0.3]).verdict == "one sample"
    assert over_samples([0.3, 0.3, 0.3]).verdict == "no spread"
    assert over_samples([0.3, 0.31, 0.29]).verdict == "better"
    assert over_samples([0.3, -2.0, 1.0]).verdict == "not told apart"


def test_the_headline_of_several_rooms_is_over_rooms(study, tmp_path):
    rename(study, "walk", a="human", b="smooth", c="human", d="smooth")
    rename(study, a="one", b="one", c="two", d="two")
    read = load(study)
    against_uniform, against_random = _rooms.headline(read)
    found = known(_rooms.over_rooms(read, _rooms.groups(read)[""], "splat", "maxmin", "uniform", read.ratios)).mean
    assert against_uniform.startswith("Over 2 rooms maxmin ")
    assert interval(found) in against_uniform
    assert "; human walks " in against_uniform
    assert "random" in against_random
    rename(study, c="one", d="one")
    assert _rooms.headline(load(study)) == []
