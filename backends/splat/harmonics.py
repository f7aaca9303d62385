"""Real spherical harmonics up to degree 3 with the signs and the order of 3DGS: how a colour changes with direction.

√2 Im Yₗ^|m| for m < 0, Yₗ⁰, √2 Re Yₗ^m for m > 0, with the Condon-Shortley phase; m from -l to l.
"""

from ...common.kernels import inlined
from .kernels import HALF, ONE, F
from .layout import SH0, SH_C0

MOST = 16  # basis functions
C0 = F(SH_C0)
C1 = F(0.4886025119029199)
C2_XY, C2_ZZ, C2_XX = F(1.0925484305920792), F(0.31539156525252005), F(0.5462742152960396)
C3_33, C3_32, C3_31, C3_30 = F(0.5900435899266435), F(2.890611442640554), F(0.4570457994644658), F(0.3731763325901154)
TWO, THREE, FIVE = F(2), F(3), F(5)


@inlined
def fill_basis(degree, x, y, z, basis):
    """Writes the (degree + 1)² basis functions of the unit vector (x, y, z)."""
    basis[0] = C0
    if degree > 0:
        basis[1], basis[2], basis[3] = -C1 * y, C1 * z, -C1 * x
    if degree > 1:
        basis[4], basis[5] = C2_XY * x * y, -C2_XY * y * z
        basis[6] = C2_ZZ * (THREE * z * z - ONE)
        basis[7], basis[8] = -C2_XY * x * z, C2_XX * (x * x - y * y)
    if degree > 2:
        basis[9] = -C3_33 * y * (THREE * x * x - y * y)
        basis[10] = C3_32 * x * y * z
        basis[11] = -C3_31 * y * (FIVE * z * z - ONE)
        basis[12] = C3_30 * z * (FIVE * z * z - THREE)
        basis[13] = -C3_31 * x * (FIVE * z * z - ONE)
        basis[14] = C3_32 * HALF * z * (x * x - y * y)
        basis[15] = -C3_33 * x * (x * x - THREE * y * y)


@inlined
def colour(g, i, channel, count, basis):
    """Of one channel of Gaussian i by `count` basis functions, before it is cut at 0."""
    value = HALF
    for k in range(count):
        value += basis[k] * g[SH0 + 3 * k + channel, i]
    return value
