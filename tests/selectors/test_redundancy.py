"""How much of a capture repeats itself, against all pairs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import known
from tests.selectors import slow
from viewbench.selectors import _covering, _redundancy, maxmin
from viewbench.selectors._normalise import normalise
from viewbench.selectors._similarity import similarity

seeds = st.integers(0, 2**32 - 1)


def walk(rng, rests):
    """Views of a walk that stands still, but for a tremble, for so many frames after each ten steps."""
    steps = []
    for rest in rests:
        steps += [rng.normal(size=3) for _ in range(10)] + [1e-4 * rng.normal(size=3) for _ in range(rest)]
    base = slow.random_views(rng, n=len(steps))
    rotations = np.repeat(base.rotations[:1], len(steps), axis=0)
    features = np.cumsum(np.abs(known(base.features)), axis=0)
    features /= np.linalg.norm(features, axis=1, keepdims=True)
    return type(base)(normalise(np.cumsum(steps, axis=0)), rotations, features.astype(np.float32), base.intrinsics)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, wanted=st.lists(st.floats(0.05, 0.999), min_size=1, max_size=4))
def test_so_many_views_are_enough_and_one_fewer_is_not(seed, wanted):
    views = slow.random_views(np.random.default_rng(seed), n=25)
    m = slow.matrix(views)
    order = maxmin.select(views, 25, np.random.default_rng(seed)).indices
    found = _redundancy.levels(_covering.uncovered(similarity(views), order), 25, wanted)
    assert [level.similarity for level in found] == sorted(wanted, reverse=True)
    for level in found:
        assert m[order[: level.views]].max(axis=0).min() >= level.similarity - 1e-9
        if level.views > 1:
            assert m[order[: level.views - 1]].max(axis=0).min() < level.similarity + 1e-9


def test_a_curve_that_ends_early_says_that_all_views_are_needed():
    assert [level.views for level in _redundancy.levels(np.array([0.5, 0.3]), 9, [0.6, 0.9])] == [9, 2]


@settings(max_examples=40, deadline=None)
@given(seed=seeds, level=st.floats(0.6, 0.995), most=st.integers(1, 6))
def test_runs_are_alike_apart_and_cannot_be_longer(seed, level, most):
    rng = np.random.default_rng(seed)
    views = walk(rng, rng.integers(0, 30, size=3))
    m, similar = slow.matrix(views), similarity(views)
    order = maxmin.select(views, len(views), rng).indices
    enough = _redundancy.levels(_covering.uncovered(similar, order), len(views), [level])[0].views
    runs = _redundancy.runs(similar, order[:enough], level, most)
    assert len(runs) <= most
    taken = [i for run in runs for i in range(run.first, run.last + 1)]
    assert len(taken) == len(set(taken))
    assert [len(run) for run in runs] == sorted((len(run) for run in runs), reverse=True)
    for run in runs:
        inside = m[run.centre, run.first : run.last + 1]
        assert run.first <= run.centre <= run.last
        assert inside.min() == pytest.approx(run.similarity, abs=1e-9) or run.similarity == 1.0
        assert inside.min() >= level - 1e-9
        for beyond in (run.first - 1, run.last + 1):
            if 0 <= beyond < len(views):
                assert m[run.centre, beyond] < level + 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_standing_still_is_found(seed):
    rests = [25, 0, 40, 12]
    views = walk(np.random.default_rng(seed), rests)
    similar = similarity(views, factors=["pos", "ang"])
    order = maxmin.select(views, len(views), np.random.default_rng(seed), factors=("pos", "ang")).indices
    level = 1 - 1e-4
    enough = _redundancy.levels(_covering.uncovered(similar, order), len(views), [level])[0].views
    found = [(run.first, run.last) for run in _redundancy.runs(similar, order[:enough], level, 3)]
    ends = np.cumsum([10 + rest for rest in rests])
    # a rest begins at the last step before it
    still = [(int(end) - rest - 1, int(end) - 1) for end, rest in zip(ends, rests, strict=True) if rest]
    assert found == sorted(still, key=lambda run: run[0] - run[1])


def test_what_counts_as_a_run_is_what_half_of_the_views_repeat():
    levels = [_redundancy.Level(s, views) for s, views in ((0.99, 90), (0.95, 50), (0.9, 20))]
    assert _redundancy.level_of_runs(levels, 100) == 0.95
    assert _redundancy.level_of_runs(levels, 30) == 0.9
