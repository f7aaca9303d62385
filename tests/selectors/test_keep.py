"""Views that are always chosen, views that never are, and steps by time and by the way."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import known
from tests.selectors import slow
from tests.selectors.test_every_selector import NAMES, SCENE, VIEWS, N, run
from viewbench.common.errors import UserError
from viewbench.scenes.thinning import candidates
from viewbench.selectors import _run
from viewbench.selectors import uniform as uniform_selector


def names_of(n):
    return tuple(f"view {i}" for i in range(n))


CHOOSING = [name for name in NAMES if name != "full"]


@pytest.mark.parametrize("selector", CHOOSING)
@settings(deadline=None, max_examples=15)
@given(data=st.data())
def test_kept_views_are_chosen_and_others_never_are(selector, data):
    views = st.integers(0, N - 1)
    keep = data.draw(st.lists(views, max_size=4, unique=True))
    gone = data.draw(st.sets(views.filter(lambda i: i not in keep), max_size=12))
    mask = np.ones(N, dtype=bool)
    mask[list(gone)] = False
    record = run(selector, 8, candidates=mask, keep=keep)
    assert set(keep) <= set(record["indices"])
    assert not gone & set(record["indices"])
    assert len(set(record["indices"])) == 8
    if selector != "uniform":
        assert record["indices"][: len(keep)] == keep, "the order serves smaller counts too"
    assert (record["candidates"], record["kept"]) == (N - len(gone), len(keep))


@pytest.mark.parametrize("selector", CHOOSING)
def test_excluded_views_are_as_if_they_were_not_there(selector):
    """The choice is that of the capture without them, whose generator has the same seed."""
    left = [i for i in range(N) if i % 5]
    mask = np.zeros(N, dtype=bool)
    mask[left] = True
    smaller = dataclasses.replace(SCENE, train=SCENE.train.subset(left))
    alone = run(selector, 6, scene=smaller, features=known(VIEWS.features)[left])
    assert run(selector, 6, candidates=mask)["names"] == alone["names"]


@pytest.mark.parametrize("selector", ["maxmin", "kcenter", "facility"])
def test_what_is_chosen_beside_kept_views_takes_them_into_account(selector):
    """Keeping the first views of a choice gives the rest of it."""
    whole = run(selector, 9)
    assert run(selector, 9, keep=whole["indices"][:4])["indices"] == whole["indices"]


def test_what_cannot_be_kept_is_said():
    with pytest.raises(UserError, match="less than the 3 views to keep"):
        run("maxmin", 2, keep=[1, 2, 3])
    with pytest.raises(UserError, match="more than the 4 of 30"):
        run("maxmin", 5, candidates=np.arange(N) < 4)
    with pytest.raises(UserError, match="keeps no views when it samples"):
        run("logdet", 5, keep=[1], parameters={"sample": True})
    with pytest.raises(UserError, match="'full' takes all 29 views"):
        _run.run(SCENE, "full", 28, 0, candidates=np.arange(N) > 0)


def with_times(times):
    return dataclasses.replace(VIEWS, times=None if times is None else np.asarray(times, dtype=float))


def choose(count, times, seed=0, **parameters):
    choice = uniform_selector.select(with_times(times), count, np.random.default_rng(seed), **parameters)
    return choice.indices.tolist()


@settings(deadline=None, max_examples=60)
@given(count=st.integers(1, N), seed=st.integers(0, 99), rate=st.floats(0.1, 240), first=st.floats(0, 1e6))
def test_at_a_constant_rate_time_is_index(count, seed, rate, first):
    times = first + np.arange(N) / rate
    assert choose(count, times, seed, by="time") == choose(count, None, seed) == choose(count, times, seed)


@settings(deadline=None, max_examples=80)
@given(data=st.data(), count=st.integers(1, N), seed=st.integers(0, 99))
def test_steps_by_time_are_distinct_and_near_their_places(data, count, seed):
    gaps = data.draw(st.lists(st.floats(0, 10), min_size=N - 1, max_size=N - 1))
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    chosen = choose(count, times, seed, by="time")
    assert len(set(chosen)) == count
    if count == N:
        assert sorted(chosen) == list(range(N))


def test_dropped_frames_and_a_varying_rate_are_seen():
    """Ten frames a second for two seconds, then one a second for ten: most of the steps belong to the slow part."""
    times = np.concatenate([np.arange(20) / 10, 2 + np.arange(10)])
    by_time, by_index = choose(6, times), choose(6, times, by="index")
    seconds = np.sort(times[by_time])
    assert np.diff(seconds).max() <= 2.5
    assert sum(times[i] >= 2 for i in by_time) >= 4
    assert sum(times[i] >= 2 for i in by_index) == 2


def test_steps_by_the_way_leave_a_dwell_alone():
    """Twenty views in one place and ten on the way: two of a third of the views stand still."""
    positions = np.zeros((N, 3))
    positions[20:, 0] = np.linspace(0.4, 4, 10)
    views = dataclasses.replace(VIEWS, positions=positions, rotations=np.tile(np.eye(3), (N, 1, 1)))
    for seed in range(5):
        chosen = uniform_selector.select(views, 8, np.random.default_rng(seed), by="path").indices
        assert len(set(chosen.tolist())) == 8
        assert (chosen >= 19).sum() >= 7
    turning = dataclasses.replace(views, positions=np.zeros((N, 3)))
    angle = np.concatenate([np.zeros(20), np.linspace(0.1, 3.0, 10)])
    turning.rotations[:, 0, 0] = turning.rotations[:, 1, 1] = np.cos(angle)
    turning.rotations[:, 0, 1], turning.rotations[:, 1, 0] = -np.sin(angle), np.sin(angle)
    chosen = uniform_selector.select(turning, 8, np.random.default_rng(0), by="path").indices
    assert (chosen >= 19).sum() >= 7


@pytest.mark.parametrize("count", [6, 20, 60])
def test_a_gap_counts_as_one_step_at_most(count):
    """20 s at 30 frames a second with 5 s lost amid them, and two walks ten minutes apart: nothing piles up there."""
    lost = np.concatenate([np.arange(300) / 30, 15 + np.arange(300) / 30])
    apart = np.concatenate([np.arange(300) / 30, 600 + np.arange(300) / 30])
    for times in (lost, apart):
        views = dataclasses.replace(slow.random_views(np.random.default_rng(0), n=600), times=times)
        for seed in range(5):
            chosen = np.sort(uniform_selector.select(views, count, np.random.default_rng(seed)).indices)
            assert np.diff(times[chosen]).min() > 0.5 * 20 / count
            assert abs((chosen < 300).sum() - count / 2) <= 1


def test_times_that_fall_are_no_order(tmp_path):
    times = np.concatenate([np.arange(15.0), np.arange(15.0)])
    assert choose(6, times) == choose(6, None)
    with pytest.raises(UserError, match="times that fall, as at view 15"):
        choose(6, times, by="time")
    with pytest.raises(UserError, match="fall at frame 'frame 015'"):
        candidates(dataclasses.replace(SCENE.train, times=times), fps=0.5)


def test_both_eyes_of_a_moment_are_looked_at_and_lost_moments_seen():
    moments = np.repeat(np.concatenate([np.arange(10.0), 20 + np.arange(5.0)]), 2)
    assert uniform_selector.uneven(moments)
    assert not uniform_selector.uneven(np.repeat(np.arange(15.0), 2))
    mask = candidates(dataclasses.replace(SCENE.train, times=np.repeat(np.arange(15.0), 2)), fps=0.5)
    assert mask[0::2].tolist() == mask[1::2].tolist()
    assert mask.sum() == 16


def test_a_kept_view_takes_the_place_of_the_nearest():
    kept = np.array([10, 29])
    assert uniform_selector._with_kept(np.array([0, 10, 20, 30]), kept).tolist() == [10, 29, 0, 20]
    assert uniform_selector._with_kept(np.array([0, 10, 20, 30]), np.array([11, 12])).tolist() == [11, 12, 0, 30]


def test_a_kept_view_like_another_changes_nothing_but_its_place():
    """Two equal frames of a video: log det knows nothing more of the second, and goes on with the others."""
    same = [0, *range(N)]
    twice = dataclasses.replace(SCENE, train=dataclasses.replace(SCENE.train.subset(same), names=names_of(N + 1)))
    features = known(VIEWS.features)[same]
    record = run("logdet", 9, scene=twice, features=features, keep=[0, 1])
    alone = run("logdet", 8, keep=[0])
    assert record["indices"][:2] == [0, 1]
    assert [i - 1 for i in record["indices"][2:]] == alone["indices"][1:]


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "facility"])
def test_enough_includes_all_kept_views(selector):
    keep = list(range(0, N, 2))
    record = run(selector, None, within=0.95, keep=keep)
    assert record["indices"] == keep


def test_words_that_mean_nothing_are_named():
    with pytest.raises(UserError, match="unknown by 'tiem'; did you mean 'time'"):
        choose(3, None, by="tiem")
    with pytest.raises(UserError, match="no times to go by"):
        choose(3, None, by="time")
