"""What holds for every selector: run on one scene through the door that the command line uses."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import known
from tests.selectors import slow
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.files import plain
from viewbench.scenes.types import Cameras, Scene, Split
from viewbench.selectors import _run
from viewbench.selectors._selection import check_selection, count_of, first_views, selection_sha256

NAMES = plugins.names("selectors")
GREEDY = ["maxmin", "logdet", "facility", "kcenter", "coverage", "random"]
N = 30
PICTURE = Path(__file__)  # selectors see no picture; the scene's hash reads one


def scene_of(views, shift: float | np.ndarray = 0.0, scale=1.0):
    n = len(views)
    c2w = np.tile(np.eye(4), (n, 1, 1))
    c2w[:, :3, :3], c2w[:, :3, 3] = views.rotations, views.positions * scale + shift
    fx, fy, cx, cy, width, height = views.intrinsics.T
    cameras = Cameras(c2w, fx, fy, cx, cy, width.astype(int), height.astype(int))
    names = tuple(f"frame {i:03d}" for i in range(n))
    split = Split(names, (PICTURE,) * n, cameras)
    return Scene("a scene", PICTURE.parent, "transforms", split, split.subset([]))


VIEWS = slow.random_views(np.random.default_rng(11), n=N)
SCENE = scene_of(VIEWS)


def run(selector, count: int | None = 10, seed=0, scene=SCENE, features=VIEWS.features, **others):
    count = N if selector == "full" else count
    return _run.run(scene, selector, count, seed, features=features, **others)


@pytest.mark.parametrize("selector", NAMES)
@pytest.mark.parametrize("count", [1, 7, N])
def test_a_selection_is_distinct_views_with_all_its_fields(selector, count):
    record = run(selector, count)
    fields = "schema scene scene_sha256 holdout selector parameters seed n_views count indices names gains seconds"
    assert list(record)[:13] == fields.split()
    assert record["n_views"] == N
    assert record["count"] == len(record["indices"]) == len(set(record["indices"]))
    assert set(record["indices"]) <= set(range(N))
    assert record["names"] == [SCENE.train.names[i] for i in record["indices"]]
    assert record["gains"] is None or len(record["gains"]) == record["count"]
    assert set(record["seconds"]) == {"similarity", "select"}
    assert json.loads(json.dumps(plain(record), allow_nan=False)) == record


@pytest.mark.parametrize("selector", NAMES)
def test_the_seed_decides_and_nothing_else_does(selector):
    again = [run(selector, seed=seed)["indices"] for seed in (0, 0, 1, 2, 3)]
    assert again[0] == again[1]
    assert (len({tuple(indices) for indices in again}) > 1) == plugins.constant("selectors", selector, "SEEDED")


@pytest.mark.parametrize("selector", GREEDY)
def test_greedy_orders_are_nested_over_counts(selector):
    assert run(selector, 4)["indices"] == run(selector, 10)["indices"][:4] == run(selector, N)["indices"][:4]


@pytest.mark.parametrize("selector", NAMES)
def test_a_capture_moved_and_scaled_gives_the_same_choice(selector):
    moved = scene_of(VIEWS, shift=np.array([8.0, -16.0, 4.0]), scale=4.0)
    assert run(selector, scene=moved)["indices"] == run(selector)["indices"]


@pytest.mark.parametrize("selector", NAMES)
def test_cameras_in_one_place_and_equal_views_are_answered(selector):
    still = slow.random_views(np.random.default_rng(0), n=1)
    views = type(still)(*(np.repeat(part, N, axis=0) for part in list(vars(still).values())[:4]))
    assert len(set(run(selector, 12, scene=scene_of(views), features=views.features)["indices"])) >= 12


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "facility"])
def test_without_features_the_weights_are_renormalised_and_the_record_says_so(selector):
    record = run(selector, features=None)
    assert record["notes"]["weights"] == {"pos": pytest.approx(7 / 9), "ang": pytest.approx(2 / 9)}
    assert "no image features" in record["notes"]["factors"]
    same = run(selector, parameters={"factors": ["pos", "ang"]})
    assert same["indices"] == record["indices"]
    assert "those in use" in same["notes"]["factors"]
    assert "weights" not in run(selector).get("notes", {})


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "facility", "kcenter"])
def test_blurred_frames_are_not_the_first_choice_of_their_window(selector):
    sharpness = np.random.default_rng(2).uniform(0.5, 1, N)
    sharpness[::3] = 0.01
    chosen = run(selector, 12, parameters={"sharpness": 1.0}, sharpness=sharpness)["indices"]
    for k, i in enumerate(chosen):
        assert i % 3 or any(abs(i - j) <= 7 for j in chosen[:k]), f"pick {k} is frame {i}, blurred"


@pytest.mark.parametrize("seed", range(5))
def test_uniform_takes_the_sharpest_near_each_of_its_steps(seed):
    sharpness = np.random.default_rng(2).uniform(0, 1, N)
    steps = np.array(run("uniform", 6, seed)["indices"])
    chosen = np.array(run("uniform", 6, seed, parameters={"sharpness": 1.0}, sharpness=sharpness)["indices"])
    away = np.abs(chosen[:, None] - steps)  # [k, j] of the k-th view from the j-th step
    assert (np.diag(away) == away.min(axis=1)).all()
    assert len(set(chosen.tolist())) == 6
    assert (sharpness[chosen] >= sharpness[steps]).all()
    assert (sharpness[chosen] > sharpness[steps]).any()


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "kcenter", "facility"])
def test_of_equal_views_the_sharper_is_taken(selector):
    pairs = slow.random_views(np.random.default_rng(4), n=N // 2)
    views = type(pairs)(*(np.repeat(part, 2, axis=0) for part in list(vars(pairs).values())[:4]))
    sharpness = np.tile([1.0, 0.9], N // 2) + np.arange(N) * 1e-4
    options = {"features": views.features, "parameters": {"sharpness": 0.001}, "sharpness": sharpness}
    chosen = run(selector, 10, scene=scene_of(views), **options)["indices"]
    assert all(i % 2 == 0 for i in chosen[1:])


@settings(max_examples=300, deadline=None)
@given(ratio=st.floats(1e-9, 1.0), n=st.integers(1, 100_000))
def test_count_of_a_ratio(ratio, n):
    count = count_of(ratio, n)
    assert 1 <= count <= n
    assert abs(count - ratio * n) <= 0.5 or count == 1


@settings(max_examples=300, deadline=None)
@given(percent=st.integers(1, 100), n=st.integers(1, 100_000))
def test_the_authors_count_is_the_whole_part(percent, n):
    assert count_of(percent / 100, n, "floor") == max(1, percent * n // 100)


def test_an_unknown_rule_of_counting_is_answered():
    with pytest.raises(UserError, match="did you mean 'floor'"):
        count_of(0.1, 10, "flor")


@pytest.mark.parametrize(
    ("default", "good", "bad"),
    [(1, 3, "three"), (0.5, 2, "half"), (True, False, 1), ("a", "b", 3), (["a"], ["b", "c"], [1])],
)
def test_parameters_are_checked_against_their_defaults(default, good, bad):
    assert _run.all_parameters("mine", {"x": default}, {"x": good}) == {"x": good}
    with pytest.raises(UserError, match="parameter 'x' of 'mine' is"):
        _run.all_parameters("mine", {"x": default}, {"x": bad})


@pytest.mark.parametrize("default", [None, [1.0, 2.0]])
def test_of_a_default_that_says_nothing_anything_goes(default):
    assert _run.all_parameters("mine", {"x": default}, {"x": [3.0]}) == {"x": [3.0]}


@pytest.mark.parametrize("selector", NAMES)
def test_a_selector_that_says_so_is_greedy_and_no_other(selector):
    greedy = plugins.constant("selectors", selector, "GREEDY", False)
    assert greedy == (selector in (*GREEDY, "full"))
    assert run(selector)["greedy"] == greedy


@pytest.mark.parametrize("selector", GREEDY)
def test_the_first_views_of_an_order_are_the_choice_of_so_many(selector):
    cut, own = first_views(run(selector, N), 7), run(selector, 7)
    for key in set(own) - {"seconds"}:
        assert cut[key] == own[key], key
    assert (cut["cut_from"], own.get("cut_from")) == (N, None)
    assert selection_sha256(cut) == selection_sha256(own)
    with pytest.raises(UserError, match="has 7 views"):
        first_views(cut, 8)


@pytest.mark.parametrize("parameters", [{}, {"sample": True}])
def test_a_choice_without_an_order_is_not_cut(parameters):
    selector = "logdet" if parameters else "uniform"
    with pytest.raises(UserError, match="are not its choice of 3; select 3"):
        first_views(run(selector, 10, parameters=parameters), 3)


def test_the_notes_of_an_order_go_with_the_views_that_they_are_about():
    twins = type(VIEWS)(*(np.repeat(part[:6], 5, axis=0) for part in list(vars(VIEWS).values())[:4]))
    order = run("logdet", N, scene=scene_of(twins), features=twins.features)
    at = order["notes"]["below_precision_from"]
    assert at == 6
    assert "notes" not in first_views(order, at)
    assert first_views(order, at + 1)["notes"]["below_precision_from"] == at


def test_the_hash_of_a_choice_is_of_the_choice_alone():
    record = run("maxmin")
    same = {
        **record,
        "seconds": {"similarity": 9.0, "select": 9.0},
        "gains": None,
        "viewbench": "9",
        "code_sha256": "x",
    }
    assert selection_sha256(same) == selection_sha256(record)
    for key in ("scene_sha256", "holdout", "indices", "seed", "parameters"):
        assert selection_sha256({**record, key: None}) != selection_sha256(record)


def test_a_selection_of_another_version_of_the_scene_is_refused():
    record = run("maxmin")
    assert check_selection(record, SCENE, record["scene_sha256"]).tolist() == record["indices"]
    with pytest.raises(UserError, match=r"with holdout 'given' and hash .*; give the capture that it was made of, or"):
        check_selection(record, SCENE, "0" * 64)
    for broken in (
        {"indices": [[0, 1]]},
        {"indices": [float("inf")]},
        {"indices": [10**30]},
        {"names": []},
        {"names": 3},
    ):
        with pytest.raises(UserError, match=r"select again|viewbench select"):
            check_selection({**record, **broken}, SCENE, record["scene_sha256"])
    by_hand = {key: record[key] for key in ("selector", "seed", "n_views", "indices", "names")}
    assert check_selection(by_hand, SCENE, "0" * 64).tolist() == record["indices"]


def test_halves_go_to_the_even_number():
    assert [count_of(0.5, n) for n in (1, 3, 5, 7)] == [1, 2, 2, 4]


FEATURES = known(VIEWS.features)
BAD_FEATURES = {
    "short": FEATURES[:-1],
    "flat": FEATURES.ravel(),
    "empty": FEATURES[:, :0],
    "nan": np.where(np.arange(N)[:, None] == 4, np.nan, FEATURES),
    "zero": np.where(np.arange(N)[:, None] == 4, 0, FEATURES),
    "text": np.full((N, 3), "a"),
}


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"selector": "maxmim"}, "did you mean 'maxmin'"),
        ({"count": 0}, r"\[1, 30\]"),
        ({"count": 31}, r"\[1, 30\]"),
        ({"parameters": {"alfa": 0.5}}, "did you mean 'alpha'"),
        ({"parameters": {"alpha": "much"}}, "expected a number"),
        ({"parameters": {"alpha": True}}, "expected a number"),
        ({"parameters": {"alpha": float("nan")}}, "expected a number"),
        ({"parameters": {"alpha": 0.9, "beta": 0.2}}, "at most 1"),
        ({"parameters": {"sigma": 0}}, "sigma"),
        ({"parameters": {"factors": ["post"]}}, "did you mean 'pos'"),
        ({"parameters": {"factors": []}}, "have no weight"),
        ({"parameters": {"factors": ["sem"]}, "features": None}, "image features"),
        ({"parameters": {"start": "medoit"}}, "did you mean 'medoid'"),
        ({"parameters": {"start": 3}}, "expected a word"),
        ({"parameters": {"sharpness": 1.0}}, "was not given"),
        ({"sharpness": np.ones(3)}, "shape"),
        ({"sharpness": np.full(N, np.nan)}, "frame 000"),
        ({"selector": "logdet", "parameters": {"sample": 1}}, "true or false"),
        ({"selector": "kcenter", "parameters": {"factors": ["pos", "ang"]}}, "one factor"),
        ({"selector": "random", "parameters": {"alpha": 1}}, "has none"),
        *[({"features": BAD_FEATURES[name]}, f"shape.*\\({N}, D\\)") for name in ("short", "flat", "empty", "text")],
        *[({"features": BAD_FEATURES[name]}, "row 4 .*'frame 004'") for name in ("nan", "zero")],
    ],
)
def test_mistakes_are_answered_in_one_sentence(given_, message):
    arguments = {"selector": "maxmin", "count": 5, "features": VIEWS.features} | given_
    with pytest.raises(UserError, match=message):
        run(**arguments)


@pytest.mark.parametrize("ratio", [0.0, -0.1, 1.0001, float("nan"), float("inf")])
def test_a_ratio_outside_its_range(ratio):
    with pytest.raises(UserError, match="must lie in"):
        count_of(ratio, 10)


def test_full_is_not_a_choice():
    with pytest.raises(UserError, match="takes all 30"):
        _run.run(SCENE, "full", 10, 0)


def test_light_selectors_load_nothing_heavy():
    import subprocess
    import sys

    code = """
import sys
import viewbench.selectors._run
from viewbench.common import plugins
for name in plugins.names("selectors"):
    plugins.load("selectors", name)
print([name for name in ("numba", "scipy", "torch", "pandas") if name in sys.modules])
"""
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"
