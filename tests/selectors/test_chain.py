"""No gap of a choice is too large, and no more frames fill it than are needed."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from viewbench.common.errors import UserError
from viewbench.selectors import _chain
from viewbench.workflow.commands import _main

NONE = 10**6  # no fill


def reference(chosen, at, gap, allowed) -> int:
    """Every set of frames, the smallest first: the fewest that fill."""
    free = [i for i in np.flatnonzero(allowed) if i not in chosen]
    ends = at[np.flatnonzero(allowed)[[0, -1]]]
    for size in range(len(free) + 1):
        for extra in itertools.combinations(free, size):
            places = np.sort([*ends, *at[[*chosen, *extra]]] if chosen or extra else ends)
            if np.diff(places).max() <= gap + 1e-9:
                return size
    return NONE


def _capture(draw):
    n = draw(st.integers(2, 10))
    at = np.cumsum(draw(st.lists(st.integers(0, 4), min_size=n, max_size=n))) * 1.0
    allowed = np.array(draw(st.lists(st.sampled_from([True, True, True, False]), min_size=n, max_size=n)))
    assume(allowed.any())
    order = draw(st.permutations(np.flatnonzero(allowed).tolist()))
    return at, allowed, order, draw(st.integers(1, 12)) / draw(st.sampled_from([1, 2]))


captures = st.composite(_capture)


@given(captures(), st.integers(0, 5), st.integers(0, 2**32 - 1))
@settings(max_examples=400, deadline=None)
def test_a_fill_is_whole_and_the_smallest(capture, count, seed):
    at, allowed, order, gap = capture
    chosen = order[:count]
    sharpness = None if seed % 2 else np.random.default_rng(seed).random(len(at))
    fewest = reference(chosen, at, gap, allowed)
    if fewest == NONE:
        with pytest.raises(UserError, match="itself has a gap"):
            _chain.fill(chosen, at, gap, allowed, sharpness)
        return
    extra = _chain.fill(chosen, at, gap, allowed, sharpness)
    assert len(extra) == fewest
    assert extra == sorted(set(extra))
    assert allowed[extra].all()
    assert not set(extra) & set(chosen)
    places = at[allowed]
    assert np.diff(np.sort([places[0], *at[chosen + extra], places[-1]])).max(initial=0) <= gap + 1e-9


@given(captures(), st.integers(1, 10), st.booleans())
@settings(max_examples=300, deadline=None)
def test_the_longest_prefix_that_fits(capture, count, greedy):
    at, allowed, order, gap = capture
    count = min(count, int(allowed.sum()))

    def choose(k):  # one that is not greedy has another order for every count
        return order[:k] if greedy else [order[(i + k) % len(order)] for i in range(k)]

    bare = reference([], at, gap, allowed)
    assume(bare != NONE)
    if max(1, bare) > count:
        with pytest.raises(UserError, match=f"at least {bare} views") as refused:
            _chain.chained(choose, greedy, count, at, gap, allowed)
        enough = float(str(refused.value).rsplit(" ", 1)[1])
        assert reference([], at, enough, allowed) <= count
        return
    views, extra = _chain.chained(choose, greedy, count, at, gap, allowed)
    assert len(views) + len(extra) == len({*views, *extra}) == count
    places = at[allowed]
    assert np.diff(np.sort([places[0], *at[views + extra], places[-1]])).max() <= gap + 1e-9
    assert views == list(choose(len(views)))
    if greedy:
        for longer in range(len(views) + 1, count + 1):
            assert longer + reference(order[:longer], at, gap, allowed) > count


def test_the_sharpest_frame_within_what_the_gap_allows():
    at, sharpness = np.arange(11.0), np.zeros(11)
    sharpness[[4, 9]] = 1  # 9 does not reach back to 0 by 6
    assert _chain.fill([0, 10], at, 6, None, sharpness) == [4]
    assert _chain.fill([0, 10], at, 6) == [5]


def test_equal_steps():
    assert _chain.fill([0, 12], np.arange(13.0), 5) == [4, 8]


@pytest.mark.parametrize("text", ["0", "-1", "two", "1m", "", "nan", "1e3"])
def test_a_gap_that_is_none(text, small_split):
    with pytest.raises(UserError, match="expected seconds or frames"):
        _chain.gap_of(text, small_split(None))


@pytest.fixture
def small_split():
    from pathlib import Path

    from viewbench.scenes.formats.images import nominal_cameras
    from viewbench.scenes.types import Split

    def make(times):
        names = tuple(f"{i}" for i in range(4))
        return Split(names, tuple(map(Path, names)), nominal_cameras(np.full((4, 2), 8)), times)

    return make


def test_units(small_split):
    times = np.array([0, 0.5, 1, 4])
    assert _chain.gap_of("2", small_split(None))[::2] == (2, "frames")
    assert _chain.gap_of("2", small_split(times))[::2] == (2, "s")
    gap, at, unit = _chain.gap_of("30f", small_split(times), np.array([0, 15, 30, 120]))
    assert (gap, at.tolist(), unit) == (30, [0, 15, 30, 120], "frames")
    with pytest.raises(UserError, match="no times"):
        _chain.gap_of("2s", small_split(None))
    with pytest.raises(UserError, match="do not grow"):
        _chain.gap_of("2s", small_split(times[::-1]))


@pytest.mark.parametrize("selector", ["maxmin", "logdet", "logdet --sample", "random"])
def test_the_command_line(tmp_path, capsys, selector):
    factors = [] if selector == "random" else ["--factors", "pos,ang"]
    base = ["select", "room_human", "--selector", *selector.split(), *factors, "--count", "60"]
    assert _main.run([*base, "--selection", str(tmp_path / "before.json")]) == 0
    assert _main.run([*base, "--max-gap", "12f", "--selection", str(tmp_path / "after.json")]) == 0
    said = capsys.readouterr().err
    before, after = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("before", "after"))
    at = np.arange(400.0)
    assert len(set(after["indices"])) == after["count"] == 60
    assert _chain.largest_gap(after["indices"], at) <= 12 < _chain.largest_gap(before["indices"], at)
    notes = after["notes"]
    assert notes["largest_gap_before"] == f"{_chain.largest_gap(before['indices'], at):g} frames"
    assert notes["largest_gap_after"] == f"{_chain.largest_gap(after['indices'], at):g} frames"
    assert "largest gap after" in said
    kept = 60 - notes["fill"]
    assert 0 < notes["fill"] < 60
    if "--sample" not in selector:
        assert after["indices"][:kept] == before["indices"][:kept]


def test_too_few_views_is_one_sentence_that_helps(capsys):
    base = ["select", "room_human", "--selector", "uniform", "--dry-run"]
    assert _main.run([*base, "--count", "10", "--max-gap", "12f"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    count = said[0].split("--count ")[1].split(",")[0]
    gap = said[0].rsplit(" ", 1)[1]
    assert _main.run([*base, "--count", count, "--max-gap", "12f"]) == 0
    assert _main.run([*base, "--count", "10", "--max-gap", f"{gap}f"]) == 0


@pytest.mark.parametrize("rate", [30, 29.97, 24, 7])
def test_grids_whose_sums_are_rounded_have_a_sentence(rate):
    """Limits that fall on the borders of frames, which the bisection of the smallest gap finds."""
    at = np.arange(200) / rate
    for count in range(1, 200):
        gap = _chain.smallest_gap(at, count)
        assert len(_chain.fill([], at, gap)) <= count
