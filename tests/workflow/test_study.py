import re

import pytest
import yaml

from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.workflow import _study

GRID = {
    "scenes": ["room_human", "room_smooth"],
    "selectors": ["random", "coverage", {"name": "places", "selector": "maxmin", "parameters": {"factors": ["pos"]}}],
    "ratios": [0.05, 0.2],
    "seeds": 3,
    "backends": ["splat"],
    "budget": {"iterations": 10},
}


@pytest.fixture
def load(tmp_path):
    settings = settings_file.load(settings_file.PACKAGE / settings_file.FILE)

    def read(**changes):
        path = tmp_path / "mine.yaml"
        raw = {key: value for key, value in {**GRID, **changes}.items() if value is not None}
        path.write_text(yaml.safe_dump(raw), encoding="utf-8")
        return _study.load(str(path), settings)

    return read


@pytest.mark.parametrize("name", _study.names())
def test_the_studies_that_ship_are_valid(name):
    study = _study.load(name, settings_file.load(settings_file.PACKAGE / settings_file.FILE))
    assert study.cells()


def test_the_grid_is_complete_and_has_nothing_twice(load):
    study = load()
    cells = study.cells()
    keys = {tuple(cell.values()) for cell in cells}
    assert len(keys) == len(cells)
    # per scene and seed: three selectors, of which one has no randomness, x 2 ratios, and the full-data reference
    assert len(cells) == 2 * 3 * (3 * 2 + 1)
    for selector in ("coverage", "full"):
        assert {cell["seed"] for cell in cells if cell["selector"] == selector} == {"0", "1", "2"}


def test_a_backend_may_run_a_part_of_the_grid(load):
    part = {"scenes": ["room_human"], "selectors": ["random"], "ratios": [0.2], "seeds": [1], "reference": False}
    study = load(backends=["splat", {"name": "some", "backend": "splat", "grid": part}])
    (cell,) = [cell for cell in study.cells() if cell["backend"] == "some"]
    assert list(cell.values()) == ["some", "room_human", "random", "0.2", "1"]
    with pytest.raises(UserError, match="has selector 'coverge', which the study does not have; did you mean"):
        load(backends=[{"backend": "splat", "grid": {"selectors": ["coverge"]}}])


def test_a_selector_and_the_reference_may_have_fewer_seeds(load):
    fewer = ["random", {"selector": "coverage", "seeds": 2}]
    study = load(selectors=fewer, seeds=[4, 0, 1], reference=[4])
    found = {name: {cell["seed"] for cell in study.cells() if cell["selector"] == name} for name in ("random", "full")}
    assert found == {"random": {"0", "1", "4"}, "full": {"4"}}
    assert {cell["seed"] for cell in study.cells() if cell["selector"] == "coverage"} == {"0", "1"}
    part = {"selectors": ["coverage"], "seeds": [4, 1]}
    both = load(selectors=fewer, seeds=[4, 0, 1], backends=[{"backend": "splat", "grid": part}], reference=False)
    assert {cell["seed"] for cell in both.cells()} == {"1"}
    assert not load(reference=False).reference
    assert load(seeds=3.0, reference=2.0).reference == (0, 1)
    assert load(reference=True).reference == (0, 1, 2)
    for wrong in ({"selectors": [{"selector": "coverage", "seeds": 4}]}, {"reference": 4}):
        with pytest.raises(UserError, match=r"'(coverage|reference)' has seed 3, which the study does not have"):
            load(**wrong)


def test_a_backend_without_the_seeds_of_a_selector_is_refused(load):
    late = [{"selector": "random", "seeds": [1, 2]}, "uniform"]
    with pytest.raises(UserError, match="'splat' has none of the seeds of 'random'"):
        load(selectors=late, backends=[{"backend": "splat", "grid": {"seeds": [0]}}])
    assert load(selectors=late, backends=[{"backend": "splat", "grid": {"seeds": [0], "selectors": ["uniform"]}}])


def test_a_backend_may_have_a_reference_where_the_study_has_none(load):
    study = load(reference=False, backends=["splat", {"name": "b", "backend": "splat", "grid": {"reference": True}}])
    found = {(cell["backend"], cell["seed"]) for cell in study.cells() if cell["selector"] == "full"}
    assert found == {("b", "0"), ("b", "1"), ("b", "2")}


def test_words_that_backends_share_are_set_in_one_line(load):
    study = load(backends=["splat", "gsplat", "instant-ngp"], background=0.5, sh_degree=0, gaussians=900)
    one, other, none = (entry.options for entry in study.backends)
    assert one == other == {"background": 0.5, "sh_degree": 0, "gaussians": 900}
    assert none == {}
    with pytest.raises(UserError, match="'background' is set, and none of its backends has it"):
        load(backends=["instant-ngp"], background=0.5)


def test_one_line_chooses_the_start_of_every_trainer_that_can_be_told(load):
    other = {"name": "told", "backend": "splat", "options": {"points": "rays"}}
    study = load(backends=["splat", other, "instant-ngp"], points="sweep")
    assert [entry.options for entry in study.backends] == [{"points": "sweep"}, {"points": "rays"}, {}]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"selectors": [{"selector": "maxmin", "parameters": {"factor": ["pos"]}}]}, "did you mean 'factors'"),
        ({"selectors": [{"selector": "maxmin", "parameters": {"sigma": "wide"}}]}, "expected a number"),
        ({"backends": [{"backend": "splat", "options": {"point": "sweep"}}]}, "did you mean 'points'"),
        ({"backends": ["command:nobody"]}, "has no [command.nobody]"),
        ({"points": "swep"}, "cannot start from points 'swep'; did you mean 'sweep'?"),
    ],
)
def test_parameters_and_options_are_checked_before_anything_runs(load, changes, words):
    with pytest.raises(UserError, match=re.escape(words)) as caught:
        load(**changes)
    assert "mine.yaml" in str(caught.value)


def test_greedy_orders_are_those_that_say_so(load):
    entries = [{"name": "drawn", "selector": "logdet", "parameters": {"sample": True}}, "logdet", "uniform", "maxmin"]
    study = load(selectors=entries)
    assert [study.selector(name).greedy for name in ("drawn", "logdet", "uniform", "maxmin")] == [0, 1, 0, 1]


def test_only_selectors_that_use_semantics_need_features(load):
    study = load()
    assert not study.selector("places").needs_features
    assert not study.selector("random").needs_features
    assert load(selectors=["maxmin"]).selector("maxmin").needs_features


def test_a_backend_entry_may_have_its_own_budget_and_width(load):
    study = load(backends=["splat", {"name": "long", "backend": "splat", "budget": {"seconds": 2}, "width": 64}])
    assert (study.backend("splat").iterations, study.backend("splat").seconds) == (10, None)
    assert (study.backend("long").iterations, study.backend("long").seconds) == (None, 2)
    assert study.backend("long").width == 64


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ratois": [0.1]}, "unknown key 'ratois'; did you mean 'ratios'"),
        ({"budget": {"iteration": 5}}, "unknown key 'iteration' in 'budget'; did you mean 'iterations'"),
        ({"selectors": [{"selector": "maxmin", "parameter": {}}]}, "did you mean 'parameters'"),
        ({"scenes": ["room_humna"]}, "did you mean 'room_human'"),
        ({"selectors": ["maxmim"]}, "did you mean 'maxmin'"),
        ({"selectors": [{"selector": "maxmin", "parameters": {"factors": ["post"]}}]}, "did you mean 'pos'"),
        ({"backends": ["splatt"]}, "did you mean 'splat'"),
        ({"reports": ["camera"]}, "did you mean 'cameras'"),
        ({"selectors": ["maxmin", "maxmin"]}, "stands twice"),
        ({"selectors": ["full"]}, "stands twice"),
        ({"ratios": [0]}, "ratios"),
        ({"ratios": [1.5]}, "ratios"),
        ({"seeds": 0}, "seeds"),
        ({"scenes": None}, "'scenes' is a required property"),
        ({"budget": None}, "has no budget"),
        ({"width": 2}, "width"),
        ({"scenes": ["../x"]}, "does not match"),
    ],
)
def test_a_mistake_is_named(load, changes, words):
    with pytest.raises(UserError, match=words.replace("[", r"\[")):
        load(**changes)


def test_an_unknown_study_is_answered_with_the_nearest():
    with pytest.raises(UserError, match="did you mean 'quick'"):
        _study.load("quik", settings_file.load())
