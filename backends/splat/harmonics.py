"""Real spherical harmonics up to degree 3 with the signs and the order of 3DGS: how a colour changes with direction.

√2 Im Yₗ^|m| for m < 0, Yₗ⁰, √2 Re Yₗ^m for m > 0, with the Condon-Shortley phase; m from -l to l.
"""

from ...common.kernels import written
from ...common.lanes import fma, load, load_some, spread, store
from .kernels import HALF, ONE, F
from .layout import SH0, SH_C0

MOST = 16  # basis functions
C0 = F(SH_C0)
C1 = F(0.4886025119029199)
C2_XY, C2_ZZ, C2_XX = F(1.0925484305920792), F(0.31539156525252005), F(0.5462742152960396)
C3_33, C3_32, C3_31, C3_30 = F(0.5900435899266435), F(2.890611442640554), F(0.4570457994644658), F(0.3731763325901154)
TWO, THREE, FIVE = F(2), F(3), F(5)


@written
def fill_basis(degree, x, y, z, basis):
    """Writes the (degree + 1)² basis functions of 16 unit vectors (x, y, z), one behind the other."""
    store(basis, 0, spread(C0))
    if degree > 0:
        store(basis, 16, -C1 * y)
        store(basis, 32, C1 * z)
        store(basis, 48, -C1 * x)
    if degree > 1:
        store(basis, 64, C2_XY * x * y)
        store(basis, 80, -C2_XY * y * z)
        store(basis, 96, C2_ZZ * (THREE * z * z - ONE))
        store(basis, 112, -C2_XY * x * z)
        store(basis, 128, C2_XX * (x * x - y * y))
    if degree > 2:
        store(basis, 144, -C3_33 * y * (THREE * x * x - y * y))
        store(basis, 160, C3_32 * x * y * z)
        store(basis, 176, -C3_31 * y * (FIVE * z * z - ONE))
        store(basis, 192, C3_30 * z * (FIVE * z * z - THREE))
        store(basis, 208, -C3_31 * x * (FIVE * z * z - ONE))
        store(basis, 224, C3_32 * HALF * z * (x * x - y * y))
        store(basis, 240, -C3_33 * x * (x * x - THREE * y * y))


@written
def colour(g, i, which, channel, count, basis):
    """Of one channel of the 16 Gaussians from i on, by `count` basis functions, before it is cut at 0."""
    value = spread(HALF)
    for k in range(count):
        value = fma(load(basis, 16 * k), load_some(g, SH0 + 3 * k + channel, i, which), value)
    return value
