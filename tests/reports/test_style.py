"""Colours are fixed: no study changes what another selector looks like."""

from viewbench.reports._style import FIXED, FREE, styles


def test_known_selectors_never_change():
    assert styles(["maxmin", "zzz"])["maxmin"] == styles(["random", "maxmin"])["maxmin"] == FIXED["maxmin"]


def test_a_new_selector_keeps_its_style_in_any_order():
    names = ["mine", "uniform", "other", "third"]
    assert styles(names) == styles(reversed(names))
    assert styles(["mine"])["mine"] == styles(["mine", "uniform"])["mine"]


def test_all_styles_of_a_study_differ():
    names = [*FIXED, *(f"new-{number}" for number in range(len(FREE)))]
    found = styles(names)
    assert list(found) == names
    assert len({style.colour for style in found.values()}) == len(names)
    assert len({style.marker for style in found.values()}) == len(names)


def test_more_selectors_than_styles_still_draw():
    assert len(styles(f"new-{number}" for number in range(30))) == 30
