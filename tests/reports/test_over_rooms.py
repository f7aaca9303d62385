"""Differences with rooms as the sample: equal to the plain definition, and silent where there is one room."""

import json

import numpy as np
import pytest
from scipy import stats

from tests.conftest import known
from tests.reports.fixtures import make_study
from viewbench.reports import over_rooms
from viewbench.reports._statistics import over_samples
from viewbench.reports._study import load

SCENES = ("a", "b", "c", "d")


@pytest.fixture
def study(tmp_path):
    return make_study(tmp_path, scenes=SCENES)


def rename(folder, **rooms):
    """Writes the rooms of scenes into their descriptions."""
    for scene, room in rooms.items():
        path = folder / "scenes" / f"{scene}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"room": room}))


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
    found = known(over_rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", read.ratios))
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
    found = known(over_rooms.over_rooms(read, rooms, "splat", "maxmin", "random", (0.1,)))
    apart = means(read, "maxmin", (0.1,)) - means(read, "random", (0.1,))
    merged = np.array([apart[:2].mean(), apart[2], apart[3]])
    np.testing.assert_allclose(list(found.rooms.values()), merged)
    low, high = stats.ttest_1samp(merged, 0).confidence_interval(0.95)
    np.testing.assert_allclose([known(found.mean.low), known(found.mean.high)], [low, high])


def test_the_table_is_there_for_two_rooms_and_not_for_one(study, tmp_path):
    read = load(study)
    (item,) = over_rooms.build(read, tmp_path)
    table = known(item.table)
    assert [row[0].text for row in table.rows] == ["coverage", "logdet", "maxmin"] * 2
    assert all(row[2].text == "4" for row in table.rows)
    assert "count as one" not in item.caption
    rows = (tmp_path / item.files[0]).read_text().splitlines()
    assert len(rows) == 1 + 2 * 3 * (len(read.ratios) + 1) * (4 + 1)
    rename(study, a="one", b="one", c="one", d="two")
    (item,) = over_rooms.build(load(study), tmp_path)
    assert known(item.table).rows[0][2].text == "2"
    assert "count as one" in item.caption
    rename(study, d="one")
    assert over_rooms.build(load(study), tmp_path) == []


def test_a_room_that_lacks_a_side_is_left_out(tmp_path):
    failed = tuple(("splat", "d", "maxmin", None, seed) for seed in (0, 1, 2))
    read = load(make_study(tmp_path, scenes=SCENES, failed=failed))
    rooms = {scene: scene for scene in SCENES}
    assert set(known(over_rooms.over_rooms(read, rooms, "splat", "maxmin", "uniform", read.ratios)).rooms) == {
        "a",
        "b",
        "c",
    }
    only = {scene: scene for scene in ("a", "d")}
    assert over_rooms.over_rooms(read, only, "splat", "maxmin", "uniform", read.ratios) is None


def test_one_sample_and_equal_samples_have_no_interval():
    assert over_samples([0.3]).verdict == "one sample"
    assert over_samples([0.3, 0.3, 0.3]).verdict == "no spread"
    assert over_samples([0.3, 0.31, 0.29]).verdict == "better"
    assert over_samples([0.3, -2.0, 1.0]).verdict == "not told apart"
