"""Sums in one order and exponentials rounded one way, so that a pose is the same to the last bit on every machine.

BLAS adds in an order that depends on the processor, and numpy's own exp differs in the last bit between its releases
and between processors. Order and rounding are those with which the room that ships was made: OpenBLAS 0.3.23's kernel
for processors that it does not know, and numpy 1.26's exp where there is AVX-512.
"""

from decimal import Decimal

import numpy as np

LANES = 8  # partial sums that run side by side
# By reach of a Gaussian: its weights that are one unit in the last place above and below the correctly rounded ones.
LAST_BITS = {
    14: ((1, 6, 12), (7,)),
    67: ((1, 2, 3, 10, 18, 24, 28, 29, 62, 67), (12, 19, 22, 42, 61, 65)),
    72: ((1, 4, 5, 13, 30, 48, 50, 52, 54, 58), (9, 31, 36, 40, 45, 51, 64, 70, 72)),
}


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sum over the last axis of `a * b`, in eight partial sums.

    Terms go to the sums in turn; of those left over at the end four, two and one go to the first ones.
    """
    terms = np.asarray(a * b, dtype=np.float64)
    sums = np.zeros((LANES, *terms.shape[:-1]))
    n, at = terms.shape[-1], 0
    while n - at >= LANES:
        sums += np.moveaxis(terms[..., at : at + LANES], -1, 0)
        at += LANES
    for width in (4, 2, 1):
        if (n - at) & width:
            sums[:width] += np.moveaxis(terms[..., at : at + width], -1, 0)
            at += width
    even = (sums[0] + sums[2]) + (sums[4] + sums[6])
    odd = (sums[1] + sums[3]) + (sums[5] + sums[7])
    return even + odd


def length(vector: np.ndarray) -> float:
    """Euclidean length of one vector."""
    return float(np.sqrt(dot(vector, vector)))


def exp(values: np.ndarray) -> np.ndarray:
    """The exponential of each value, correctly rounded."""
    return np.array([float(Decimal(float(value)).exp()) for value in values])


def smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    """(N, K) columns convolved with a Gaussian of `sigma` samples, cut at four; the ends are repeated."""
    weights = _gaussian(sigma)
    reach = len(weights) // 2
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    return dot(np.lib.stride_tricks.sliding_window_view(padded, len(weights), axis=0), weights)


def _gaussian(sigma: float) -> np.ndarray:
    """Weights of the steps from -4 to 4 sigma; their sum is 1."""
    reach = int(4 * sigma)
    steps = np.arange(-reach, reach + 1)
    weights = exp(-steps * steps / 2 / sigma / sigma)
    above, below = LAST_BITS.get(reach, ((), ()))
    weights = np.where(np.isin(np.abs(steps), above), np.nextafter(weights, 2), weights)
    weights = np.where(np.isin(np.abs(steps), below), np.nextafter(weights, 0), weights)
    return weights / weights.sum()
