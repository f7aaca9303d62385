"""Means, spreads and differences against the standard library and SciPy."""

import statistics

import numpy as np
import pytest
from scipy.stats import ttest_ind

from tests.conftest import known
from viewbench.reports._statistics import (
    difference,
    interval,
    number,
    over_ratios,
    signed,
    summary,
    usual_n,
    with_spread,
)
from viewbench.reports._study import load

from .fixtures import make_study


@pytest.mark.parametrize("n", [2, 3, 7])
def test_summary_is_the_sample_mean_and_standard_deviation(n):
    values = np.random.default_rng(n).normal(20, 1, n).tolist()
    item = summary(values)
    assert item.mean == pytest.approx(statistics.mean(values))
    assert item.std == pytest.approx(statistics.stdev(values))
    assert item.n == n


def test_one_sample_has_no_spread():
    assert summary([21.5]).std is None
    assert with_spread(summary([21.5]), 2, expected=3) == "21.50"
    assert "±" in with_spread(summary([21.5, 21.5]), 2, expected=2)


def test_a_missing_seed_is_said():
    assert with_spread(summary([20.0, 21.0]), 1, expected=3) == "20.5 ± 0.7 (n = 2)"
    assert usual_n([summary([1.0] * n) for n in (1, 3, 3, 2)]) == 3


@pytest.mark.parametrize(("n", "m"), [(2, 2), (3, 3), (5, 3)])
def test_difference_is_welchs_interval(n, m):
    rng = np.random.default_rng(n * 10 + m)
    ours, theirs = rng.normal(21, 0.3, n), rng.normal(20, 0.1, m)
    expected = ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    found = difference(ours.tolist(), theirs.tolist())
    assert found.mean == pytest.approx(ours.mean() - theirs.mean())
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_verdicts():
    assert difference([21.0, 21.1, 20.9], [20.0, 20.1, 19.9]).verdict == "better"
    assert difference([20.0, 20.1, 19.9], [21.0, 21.1, 20.9]).verdict == "worse"
    assert difference([20.0, 21.0, 22.0], [20.1, 21.2, 21.9]).verdict == "not told apart"
    assert difference([30.0], [20.0, 20.1]).verdict == "one sample"
    assert interval(difference([30.0], [20.0, 20.0])) == "+10.00"


def test_over_ratios_averages_each_seed_and_drops_incomplete_ones(tmp_path):
    study = load(make_study(tmp_path, scenes=("room_human",), failed=[("splat", "room_human", "maxmin", 0.2, 1)]))
    cells = study.find("splat", "room_human", "maxmin")
    expected = [
        statistics.mean(known(cell.psnr_db) for cell in cells if cell.seed == seed) for seed in (0, 2)
    ]  # seed 1 lacks ratio 0.2
    assert over_ratios(cells, study.ratios) == pytest.approx(expected)


def test_numbers_have_a_true_minus():
    assert number(-1.234, 1) == "−1.2"
    assert signed(0.5) == "+0.50"
