"""Elementary functions of sixteen float32 at a time, by polynomials: of no library, so the same bits everywhere."""

import numpy as np

from .kernels import written
from .lanes import exponent, fma, larger, mantissa, smaller, spread, times_power, where

# 2^f on [-½, ½], the minimax polynomial: relative error 1e-7 and what rounding adds.
_P0, _P1, _P2, _P3, _P4, _P5 = (
    np.float32(c) for c in (1.0, 0.69314698, 0.24022242, 0.055507337, 0.0096715126, 0.0013264727)
)
_S1, _S2, _S3, _S4 = (np.float32(c) for c in (0.69312419, 0.2402411, 0.055906425, 0.0095828531))
_MAGIC = np.float32(1.5 * 2**23)
_ROOT2 = np.float32(2**0.5)
_L1, _L3, _L5, _L7, _L9 = (np.float32(2 / np.log(2) / k) for k in (1, 3, 5, 7, 9))
_LOG2E = np.float32(1.4426950408889634)


@written
def _parted(x):
    """x - n, and n + _MAGIC for `times_power`, with the whole number n that is nearest to x."""
    magic = x + _MAGIC
    return x - (magic - _MAGIC), magic


@written
def exp2(x):
    """2^x for x in [-126, 126]."""
    f, magic = _parted(x)
    p = fma(f, spread(_P5), spread(_P4))
    p = fma(f, p, spread(_P3))
    p = fma(f, p, spread(_P2))
    p = fma(f, p, spread(_P1))
    return times_power(fma(f, p, spread(_P0)), magic)


@written
def exp2_short(x):
    """2^x for x in [-126, 126], to 3e-6 of it."""
    f, magic = _parted(x)
    p = fma(f, spread(_S4), spread(_S3))
    p = fma(f, p, spread(_S2))
    p = fma(f, p, spread(_S1))
    return times_power(fma(f, p, spread(_P0)), magic)


@written
def exp(x):
    """e^x for x in [-22, 22], and clamped to it: 3e-10 to 4e9, which can be squared."""
    return exp2(smaller(larger(x * _LOG2E, spread(np.float32(-32))), spread(np.float32(32))))


@written
def log2(x):
    """log2 of positive normal numbers, by the series of the inverse hyperbolic tangent; error below 2e-7 · |log2 x|."""
    m = mantissa(x)
    high = m > _ROOT2
    m = where(high, m * np.float32(0.5), m)
    e = exponent(x) + where(high, spread(np.float32(1)), spread(np.float32(0)))
    s = (m - np.float32(1)) / (m + np.float32(1))
    z = s * s
    p = fma(z, spread(_L9), spread(_L7))
    p = fma(z, p, spread(_L5))
    p = fma(z, p, spread(_L3))
    p = fma(z, p, spread(_L1))
    return fma(s, p, e)


@written
def dot(a0, b0, a1, b1, a2, b2):
    """a₀ b₀ + a₁ b₁ + a₂ b₂."""
    return fma(a0, b0, fma(a1, b1, a2 * b2))


@written
def sigmoid(x):
    """1 / (1 + e^-x)."""
    return np.float32(1) / (np.float32(1) + exp(-x))
