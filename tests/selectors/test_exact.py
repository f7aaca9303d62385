"""Every fast selector equals its plain definition on random scenes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import known
from tests.selectors import slow
from viewbench.selectors import coverage, facility, kcenter, logdet, maxmin, uniform
from viewbench.selectors._normalise import normalise
from viewbench.selectors._similarity import similarity

seeds = st.integers(0, 2**32 - 1)
counts = st.integers(1, 30)
weights = st.sampled_from(
    [
        {},
        {"factors": ["pos", "ang"]},
        {"factors": ["ang"]},
        {"factors": ["sem"]},
        {"factors": ["pos"], "sigma": 2.0},
        {"alpha": 0.1, "beta": 0.1, "sigma": 1.5},
        {"alpha": 0.0, "beta": 0.5},
        {"alpha": 1.0, "beta": 0.0, "sigma": 3.0},
    ]
)


def plain(views, options):
    return slow.matrix(views, **{key: value for key, value in options.items() if key != "regularise"})


@settings(max_examples=20, deadline=None)
@given(seed=seeds, options=weights)
def test_similarity_is_the_matrix_of_the_paper(seed, options):
    views = slow.random_views(np.random.default_rng(seed), n=15)
    expected = slow.matrix(views, **options)
    m = similarity(views, **options)
    some = np.array([3, 0, 14, 3])
    np.testing.assert_allclose(m.columns(some), expected[some], atol=1e-13)
    np.testing.assert_allclose(m.spatial(5) + m.gamma * m.semantic(5), expected[5], atol=1e-13)
    np.testing.assert_allclose(m.diagonal, np.diag(expected), atol=1e-13)
    assert sum(m.weights.values()) == pytest.approx(1, abs=1e-15)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, count=counts, options=weights)
def test_maxmin(seed, count, options):
    views = slow.random_views(np.random.default_rng(seed), n=30)
    choice = maxmin.select(views, count, np.random.default_rng(seed), **options)
    indices, gains = slow.maxmin(plain(views, options), count, choice.indices[0])
    np.testing.assert_allclose(known(choice.gains), gains, atol=1e-12)
    assert choice.indices.tolist() == indices


@settings(max_examples=20, deadline=None)
@given(seed=seeds, count=counts, options=weights)
def test_maxmin_bounds_leave_nothing_out_on_a_path(seed, count, options):
    """Neighbours along a path are alike, which is where most of the work is passed over."""
    rng = np.random.default_rng(seed)
    views = slow.random_views(rng, n=60)
    positions = np.cumsum(rng.normal(size=(60, 3)), axis=0)
    features = known(views.features) + 5 * np.sin(np.arange(60) / 7)[:, None].astype(np.float32)
    rotations = np.repeat(views.rotations[::6], 6, axis=0)
    views = type(views)(normalise(positions), rotations, features, views.intrinsics)
    choice = maxmin.select(views, count, np.random.default_rng(seed), **options)
    m = plain(views, options)
    chosen = list(choice.indices)
    for k in range(1, count):
        distance = 1 - m[chosen[:k]].max(axis=0)
        distance[chosen[:k]] = -np.inf
        assert distance[chosen[k]] >= distance.max() - 1e-12
        assert known(choice.gains)[k] == pytest.approx(distance[chosen[k]], abs=1e-12)


def test_maxmin_from_the_medoid():
    views = slow.random_views(np.random.default_rng(3))
    m = slow.matrix(views)
    first, second = (maxmin.select(views, 9, np.random.default_rng(seed), start="medoid") for seed in (0, 1))
    assert first.indices[0] == m.sum(axis=0).argmax()
    assert first.indices.tolist() == second.indices.tolist() == slow.maxmin(m, 9, first.indices[0])[0]


@settings(max_examples=30, deadline=None)
@given(seed=seeds, count=st.integers(1, 20), regularise=st.sampled_from([0.0, 0.01, 1.0]))
def test_logdet(seed, count, regularise):
    views = slow.random_views(np.random.default_rng(seed), n=20)
    choice = logdet.select(views, count, np.random.default_rng(seed), regularise=regularise)
    indices, gains = slow.logdet(slow.matrix(views), count, choice.indices[0], regularise)
    np.testing.assert_allclose(known(choice.gains), gains, atol=1e-7)
    assert choice.indices.tolist() == indices


@settings(max_examples=20, deadline=None)
@given(seed=seeds, count=counts, options=weights)
def test_facility(seed, count, options):
    views = slow.random_views(np.random.default_rng(seed), n=30)
    choice = facility.select(views, count, np.random.default_rng(seed), **options)
    m = np.maximum(plain(views, options), 0)
    served = np.zeros(30)
    for k, pick in enumerate(choice.indices):  # the last views of a mutual pair tie but for rounding, so no exact list
        gains = np.maximum(m - served, 0).sum(axis=1)
        assert known(choice.gains)[k] == pytest.approx(gains[pick], abs=1e-9)
        assert gains[pick] >= np.delete(gains, choice.indices[:k]).max() - 1e-9
        served = np.maximum(served, m[pick])


@settings(max_examples=30, deadline=None)
@given(seed=seeds, count=counts, factor=st.sampled_from(["pos", "ang", "sem"]))
def test_kcenter(seed, count, factor):
    views = slow.random_views(np.random.default_rng(seed), n=30)
    if factor == "pos":
        distance = np.linalg.norm(views.positions[:, None] - views.positions, axis=2)
    elif factor == "ang":
        traces = np.einsum("iab,jab->ij", views.rotations, views.rotations)
        distance = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    else:
        distance = np.arccos(np.clip(slow.matrix(views, factors=["sem"]), -1, 1))
    choice = kcenter.select(views, count, np.random.default_rng(seed), factors=(factor,))
    indices, gains = slow.farthest(distance, count, choice.indices[0])
    np.testing.assert_allclose(known(choice.gains), gains, atol=1e-7)
    assert choice.indices.tolist() == indices


@pytest.mark.parametrize("seed", range(8))
def test_coverage(seed):
    rng = np.random.default_rng(seed)
    views = slow.random_views(rng, n=12, dims=0)
    options = {"lam": [0.05, 0.5][seed % 2], "spacing": [1.0, 1.7][seed // 2 % 2]}
    choice = coverage.select(views, 12, rng, **options)
    indices, gains = slow.coverage(views, 12, **options)
    np.testing.assert_allclose(known(choice.gains), gains, rtol=1e-10)
    assert choice.indices.tolist() == indices


@settings(max_examples=200, deadline=None)
@given(seed=seeds, n=st.integers(1, 300), data=st.data())
def test_uniform_takes_equal_steps_round_the_capture(seed, n, data):
    count = data.draw(st.integers(1, n))
    views = slow.random_views(np.random.default_rng(0), n=n, dims=0)
    chosen = uniform.select(views, count, np.random.default_rng(seed)).indices
    assert len(set(chosen.tolist())) == count
    steps = np.diff([*chosen, chosen[0] + n]) % n if count > 1 else np.array([n])
    assert set(steps.tolist()) <= {n // count, -(-n // count)}, "the step over the end is one like the others"


@settings(max_examples=200, deadline=None)
@given(seed=seeds, n=st.integers(2, 300), data=st.data())
def test_uniform_of_the_authors_is_linspace_whose_ends_meet(seed, n, data):
    count = data.draw(st.integers(2, n))
    views = slow.random_views(np.random.default_rng(0), n=n, dims=0)
    chosen = uniform.select(views, count, np.random.default_rng(seed), steps="linspace").indices
    steps = (chosen - chosen[0]) % n
    assert len(set(chosen.tolist())) == count
    assert (np.abs(steps - np.linspace(0, n - 1, count)) < 1).all()
    assert (chosen[-1] + 1) % n == chosen[0], "two of its views are neighbours, which is why it is not the default"


@pytest.mark.parametrize("steps", ["equal", "linspace"])
@pytest.mark.parametrize("seed", range(4))
def test_both_forms_of_uniform_start_at_the_same_view(steps, seed):
    views = slow.random_views(np.random.default_rng(0), n=50, dims=0)
    start = int(np.random.default_rng(seed).integers(50))
    assert uniform.select(views, 7, np.random.default_rng(seed), steps=steps).indices[0] == start
