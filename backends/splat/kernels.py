"""The arithmetic that the kernels share: single precision, without branches, so that loops run as vectors."""

import numpy as np

from ...common.kernels import inlined

F = np.float32
ZERO, HALF, ONE, TWO = F(0), F(0.5), F(1), F(2)
LOG2E = F(1.4426950408889634)
# 2^t on [-1, 0] by a polynomial of degree 5, error below 2e-7; squared up for longer ranges. Branch-free, so that the
# loops around it run as vectors; the library's exp does not.
C0, C1, C2, C3, C4, C5 = (
    F(c) for c in (0.999999925, 0.693142253, 0.240172189, 0.0552797225, 0.00918861165, 0.000938788304)
)


@inlined
def exp2_8(x):
    """2^x for x in [-8, 0], the range of a visible splat's alpha (1/255 is about 2^-8)."""
    t = x * F(0.125)
    p = ((((C5 * t + C4) * t + C3) * t + C2) * t + C1) * t + C0
    p = p * p
    p = p * p
    return p * p


@inlined
def exp2_32(x):
    """2^x for x in [-32, 0]."""
    t = x * F(0.03125)
    p = ((((C5 * t + C4) * t + C3) * t + C2) * t + C1) * t + C0
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    return p * p


@inlined
def exp(x):
    """e^x for x in [-22, 22], clamped to it: scales of 2e-10 to 4e9 scene units. Relative error below 1.5e-5."""
    t = (min(max(x * LOG2E, F(-32)), F(32)) - F(32)) * F(0.015625)
    p = ((((C5 * t + C4) * t + C3) * t + C2) * t + C1) * t + C0
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    return p * p * F(4294967296)


@inlined
def sigmoid(x):
    """1 / (1 + e^-x) without overflow."""
    small = exp2_32(max(-abs(x) * LOG2E, F(-32)))
    larger = ONE / (ONE + small)
    return larger if x >= ZERO else small * larger
