"""Sixteen numbers at a time against numpy, one at a time."""

import operator
from typing import Any

import numpy as np
import pytest

from viewbench.common import lane_functions, lanes
from viewbench.common.kernels import exact

A = np.random.default_rng(0).uniform(-9, 9, 16).astype(np.float32)
B = np.random.default_rng(1).uniform(0.5, 9, 16).astype(np.float32)
C = np.random.default_rng(2).uniform(-9, 9, 16).astype(np.float32)


def of_two(function):
    @exact
    def kernel(a, b, out):
        lanes.store(out, 0, function(lanes.load(a, 0), lanes.load(b, 0)))

    return kernel


def of_one(function):
    @exact
    def kernel(a, out):
        for i in range(0, a.shape[0], 16):
            lanes.store(out, i, function(lanes.load(a, i)))

    return kernel


def applied(function, *arrays):
    out = np.zeros(len(arrays[0]), np.float32)
    kernel: Any = of_one(function) if len(arrays) == 1 else of_two(function)
    kernel(*arrays, out)
    return out


@pytest.mark.parametrize("name", ["add", "sub", "mul", "truediv"])
def test_arithmetic_is_that_of_numpy(name):
    function = getattr(operator, name)
    np.testing.assert_array_equal(applied(function, A, B), function(A, B))


@pytest.mark.parametrize("name", ["lt", "gt", "le", "ge"])
def test_comparisons_choose_lanes(name):
    compare = getattr(operator, name)
    b = np.where(np.arange(16) % 3 == 0, A, B)  # some are equal

    @exact
    def kernel(a, b, out):
        x, y = lanes.load(a, 0), lanes.load(b, 0)
        mask = compare(x, y)
        lanes.store(out, 0, lanes.where(mask, x, y))
        return lanes.bits(mask)

    out = np.zeros(16, np.float32)
    number = kernel(A, b, out)
    np.testing.assert_array_equal(out, np.where(compare(A, b), A, b))
    assert number == sum(1 << int(lane) for lane in np.flatnonzero(compare(A, b)))


def test_scalars_and_lanes_mix():
    @exact
    def kernel(a, out):
        x = lanes.load(a, 0)
        lanes.store(out, 0, np.float32(2) * x - x / np.float32(4) + 1)

    out = np.zeros(16, np.float32)
    kernel(A, out)
    np.testing.assert_array_equal(out, np.float32(2) * A - A / np.float32(4) + np.float32(1))


def test_fma_rounds_once():
    a = np.float32(1 + 2**-12) * np.ones(16, np.float32)

    @exact
    def kernel(a, out):
        x = lanes.load(a, 0)
        lanes.store(out, 0, lanes.fma(x, x, -(x * x)))

    out = np.zeros(16, np.float32)
    kernel(a, out)
    exactly = a.astype(np.float64) ** 2
    np.testing.assert_array_equal(out, (exactly - (a * a).astype(np.float64)).astype(np.float32))
    assert out.any()


def test_sums_of_nine_vectors():
    rows = np.random.default_rng(3).normal(size=(9, 16)).astype(np.float32)

    @exact
    def kernel(rows, out):
        v = (
            lanes.load_row(rows, 0, 0),
            lanes.load_row(rows, 1, 0),
            lanes.load_row(rows, 2, 0),
            lanes.load_row(rows, 3, 0),
            lanes.load_row(rows, 4, 0),
            lanes.load_row(rows, 5, 0),
            lanes.load_row(rows, 6, 0),
            lanes.load_row(rows, 7, 0),
            lanes.load_row(rows, 8, 0),
        )
        lanes.store(out, 0, lanes.sums(v))

    out = np.ones(16, np.float32)
    kernel(rows, out)
    halves = rows
    while halves.shape[1] > 1:
        halves = halves[:, : halves.shape[1] // 2] + halves[:, halves.shape[1] // 2 :]
    np.testing.assert_array_equal(out, np.append(halves[:, 0], np.zeros(7)))


@pytest.mark.parametrize("n", [1, 15, 16, 17, 40])
def test_the_last_lanes_of_a_row_touch_nothing_else(n):
    @exact
    def kernel(a, n):
        for i in range(0, n, 16):
            inside = lanes.numbers() < np.float32(n - i)
            lanes.store_some(a, 0, i, lanes.load_some(a, 0, i, inside) + 1, inside)

    a = np.arange(2.0 * n, dtype=np.float32).reshape(2, n)
    kernel(a, n)
    np.testing.assert_array_equal(a[0], np.arange(n) + 1)
    np.testing.assert_array_equal(a[1], np.arange(n) + n)


def test_windows_of_two_vectors():
    @exact
    def kernel(a, b, out):
        lanes.store(out, 0, lanes.shifted(lanes.load(a, 0), lanes.load(b, 0), 11))

    out = np.zeros(16, np.float32)
    kernel(A, B, out)
    np.testing.assert_array_equal(out, np.concatenate([A, B])[11:27])


@pytest.mark.parametrize(
    ("function", "wanted", "low", "high", "relative", "absolute"),
    [
        (lane_functions.exp2, np.exp2, -126, 126, 2e-7, 0),
        (lane_functions.exp2_short, np.exp2, -126, 126, 3.1e-6, 0),
        (lane_functions.exp, np.exp, -22, 22, 3e-6, 0),
        (lane_functions.sigmoid, lambda x: 1 / (1 + np.exp(-x)), -22, 22, 3e-6, 0),
        (lanes.sqrt, np.sqrt, 0, 1e6, 1e-7, 0),
        (lanes.floor, np.floor, -1e4, 1e4, 0, 0),
        (lanes.magnitude, np.abs, -1e4, 1e4, 0, 0),
    ],
)
def test_functions(function, wanted, low, high, relative, absolute):
    x = np.linspace(low, high, 16000).astype(np.float32)
    np.testing.assert_allclose(
        applied(function, x),
        wanted(x.astype(np.float64)),
        relative,
        absolute,
    )


def test_logarithms_of_all_magnitudes():
    x = (2.0 ** np.linspace(-126, 127, 16000)).astype(np.float32)
    x[:5] = np.float32(1) + np.float32(2**-23) * np.arange(5, dtype=np.float32)
    wanted = np.log2(x.astype(np.float64))
    np.testing.assert_allclose(applied(lane_functions.log2, x), wanted, rtol=2e-7, atol=1e-10)


def test_exponentials_beyond_their_range_are_those_at_its_end():
    ends = applied(lane_functions.exp, np.repeat(np.array([-1e30, -90, 90, 1e30], np.float32), 4))
    assert np.isfinite(ends).all()
    assert (ends[:8] == ends[0]).all()
    assert (ends[8:] == ends[8]).all()
    assert 0 < ends[0] < 1e-9
    assert 1e9 < ends[8] ** 2 < np.inf


def test_arrays_that_are_not_contiguous_are_refused():
    """Lanes are read from behind an address: with strides they would be other numbers."""
    with pytest.raises(Exception, match="contiguous float32"):
        applied(lanes.magnitude, np.zeros(32, np.float32)[::2])
    with pytest.raises(Exception, match="contiguous float32"):
        applied(lanes.magnitude, np.zeros(16))
