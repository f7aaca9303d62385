"""How much a choice leaves uncovered, against all pairs, and the count that a distance gives."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import known
from tests.selectors import slow
from tests.selectors.test_every_selector import SCENE, VIEWS, N, run
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.selectors import _covering, _run
from viewbench.selectors._selection import first_views
from viewbench.selectors._similarity import similarity

seeds = st.integers(0, 2**32 - 1)
options_of = st.sampled_from(
    [
        {},
        {"factors": ["pos", "ang"]},
        {"factors": ["sem"]},
        {"alpha": 0.0, "beta": 0.5},
        {"alpha": 1.0, "beta": 0.0, "sigma": 3.0},
    ]
)


def radius(m, chosen):
    """The largest distance of a view to the nearest chosen one, of all pairs."""
    left = [k for k in range(len(m)) if k not in set(chosen)]
    return max((min(1 - m[i, k] for i in chosen) for k in left), default=0.0)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, options=options_of)
def test_the_curve_of_any_order_is_that_of_all_pairs_and_falls(seed, options):
    rng = np.random.default_rng(seed)
    views = slow.random_views(rng, n=25)
    m, order = slow.matrix(views, **options), rng.permutation(25)
    curve = _covering.uncovered(similarity(views, **options), order)
    expected = [radius(m, order[: k + 1]) for k in range(25)]
    np.testing.assert_allclose(curve, np.maximum(expected, 0), atol=1e-12)
    assert (np.diff(curve) <= 0).all()
    assert curve[-1] == 0


@settings(max_examples=40, deadline=None)
@given(seed=seeds, count=st.integers(1, 25), options=options_of)
def test_the_nearest_chosen_view_is_that_of_all_pairs(seed, count, options):
    rng = np.random.default_rng(seed)
    views = slow.random_views(rng, n=25)
    m, chosen = slow.matrix(views, **options), rng.permutation(25)[:count]
    owner, distance = _covering.nearest_chosen(similarity(views, **options), chosen)
    assert owner[chosen].tolist() == chosen.tolist()
    assert set(owner) <= set(chosen.tolist())
    for k in sorted(set(range(25)) - set(chosen.tolist())):
        assert distance[k] == pytest.approx(max(0, min(1 - m[i, k] for i in chosen)), abs=1e-12)
        assert 1 - m[owner[k], k] == pytest.approx(distance[k], abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    selector=st.sampled_from(["maxmin", "logdet", "facility", "kcenter"]),
    within=st.floats(0.02, 0.98),
    blur=st.booleans(),
)
def test_the_count_of_a_distance_is_the_smallest_that_is_enough(seed, selector, within, blur):
    rng = np.random.default_rng(seed)
    views = slow.random_views(rng, n=30)
    plugin = plugins.load("selectors", selector)
    parameters = _run.all_parameters(selector, plugin.PARAMETERS, {"sharpness": 0.5} if blur else {})
    views = type(views)(**{**vars(views), "sharpness": rng.uniform(0.1, 1, 30)})
    again = functools.partial(np.random.default_rng, seed)
    order = plugin.select(views, 30, again(), **parameters)
    named = {key: parameters[key] for key in ("alpha", "beta", "sigma", "factors") if key in parameters}
    m = slow.matrix(views, **named)
    radii = np.array([radius(m, order.indices[: k + 1]) for k in range(30)])
    if (np.abs(radii - within) < 1e-9).any():
        return
    count = int((radii <= within).argmax()) + 1
    if count == 30:
        with pytest.raises(UserError, match="short of all 30"):
            _covering.enough(plugin, views, within, again, parameters)
        return
    choice, reached = _covering.enough(plugin, views, within, again, parameters)
    assert choice.indices.tolist() == order.indices[:count].tolist()
    np.testing.assert_allclose(known(choice.gains), known(order.gains)[:count])
    assert reached == pytest.approx(max(0, radii[count - 1]), abs=1e-12)


@pytest.mark.parametrize("selector", ["maxmin", "logdet"])
def test_the_record_is_that_of_the_count_with_what_was_asked(selector):
    record = _run.run(SCENE, selector, None, 0, {}, VIEWS.features, within=0.8)
    auto = record["notes"].pop("auto")
    assert auto["distance"] == 0.8 >= auto["reached"]
    assert 1 < record["count"] < N
    plain = run(selector, record["count"])
    for key in set(plain) - {"seconds", "notes"}:
        assert record[key] == plain[key], key
    assert record["notes"] == plain.get("notes", {})


def test_the_first_views_of_such_a_choice_are_not_said_to_be_enough():
    record = _run.run(SCENE, "maxmin", None, 0, {}, VIEWS.features, within=0.8)
    assert "auto" in first_views(record, record["count"])["notes"]
    assert "auto" not in first_views(record, 1).get("notes", {})


@pytest.mark.parametrize("within", [0.0, 1.0, -0.1, float("nan"), 7.0])
def test_a_distance_lies_between_0_and_1(within):
    with pytest.raises(UserError, match=r"expected one in \(0, 1\)"):
        _run.run(SCENE, "maxmin", None, 0, {}, VIEWS.features, within=within)


@pytest.mark.parametrize(
    ("selector", "parameters", "words"),
    [
        ("random", {}, "does not compare views"),
        ("coverage", {}, "does not compare views"),
        ("uniform", {}, "does not compare views"),
        ("full", {}, "does not compare views"),
        ("logdet", {"sample": True}, "leave out --sample"),
    ],
)
def test_a_selector_without_an_order_by_similarity_is_refused(selector, parameters, words):
    with pytest.raises(UserError, match=words):
        _run.run(SCENE, selector, None, 0, parameters, VIEWS.features, within=0.5)


def test_a_distance_that_all_views_alone_reach_is_answered_by_one_that_works():
    m = slow.matrix(VIEWS)
    np.fill_diagonal(m, -np.inf)
    with pytest.raises(UserError, match="a view is") as error:
        _run.run(SCENE, "maxmin", None, 0, {}, VIEWS.features, within=1e-6)
    least = float(str(error.value).split("a view is ")[1].split()[0])
    assert least >= (1 - m.max()) * 0.99
    assert _run.run(SCENE, "maxmin", None, 0, {}, VIEWS.features, within=least * 1.01)["count"] < N


@pytest.mark.parametrize("within", [0.9, 0.5, 1e-9])
@pytest.mark.parametrize("sharpness", [0.0, 0.5])
def test_the_order_of_a_distance_comes_with_its_curve(within, sharpness):
    sharp = np.random.default_rng(3).uniform(0.1, 1, N)
    record, curve, similar = _covering.order_within(SCENE, within, 0, {"sharpness": sharpness}, VIEWS.features, sharp)
    order = run("maxmin", N, parameters={"sharpness": sharpness}, sharpness=sharp)["indices"]
    assert record["indices"] == order[: len(curve)]
    np.testing.assert_allclose(curve, _covering.uncovered(similar, record["indices"]), atol=1e-12)
    assert curve[-1] <= within
    assert (curve[:-1] > within).all()
    assert "auto" not in record.get("notes", {})
