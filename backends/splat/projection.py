"""EWA splatting (Zwicker et al. 2001, as in 3DGS, Eqs. 5 and 6): Gaussians in space to ellipses on the screen.

A Gaussian with mean m and covariance Σ = M Mᵀ, M = R(q) diag(s), seen by a camera with world-to-camera rotation W and
position t = W m + d, becomes a 2D Gaussian with mean (fx tx/tz + cx, fy ty/tz + cy) and covariance
Σ' = U Uᵀ + f I, U = J W M, J the Jacobian of the perspective division at t and f the variance of the low-pass filter.
J is taken at a point clamped to 1.3 times the field of view, as in 3DGS, since the linearisation explodes outside it.

3DGS takes f = 0.3 pixels², which makes thin splats brighter than they are. With `antialias` the opacity is multiplied
by sqrt(|U Uᵀ| / |Σ'|), the 2D filter of Mip-Splatting (Yu et al. 2024, Eq. 9), whose f = 0.1 is about the variance of
a pixel's square.

The colour is ½ plus the spherical harmonics in the direction from the camera, cut at 0. Directions do not carry
gradient to the mean, which is what 3DGS's own kernels leave in and what makes no measurable difference here.
"""

from typing import NamedTuple

import numpy as np

from ...common.kernels import compiled, inlined
from ...scenes.types import OPENCV, Cameras
from .harmonics import MOST, colour, fill_basis
from .kernels import HALF, LOG2E, ONE, TWO, ZERO, F, exp, sigmoid
from .layout import LOG_SCALE, LOGIT, MEAN, QUATERNION

FAINTEST = F(2.5e-5)  # of the squared factor that `antialias` multiplies opacities by
MARGIN = F(1.3)  # of the half field of view, where J's point is clamped
MIN_ALPHA_LOG2 = F(7.994353436858858)  # -log2(1/255): below it a splat is not drawn

# A camera as kernels take it: 21 float32.
ROTATION, TRANSLATION, FX, FY, CX, CY, POSITION, WIDTH, HEIGHT = 0, 9, 12, 13, 14, 15, 16, 19, 20

# Columns of `Splats.drawn`. With d = pixel - mean, log2 of alpha is
# L - (A dx² + B dx dy + C dy²): the conic with ½ and log2 e folded in.
X, Y, A, B, C, LOG2_OPACITY, RED, GREEN, BLUE = range(9)
SPLAT_COLUMNS = 16  # padded to a cache line
# Columns of `Splats.extents`: conic, squared radius at which alpha is 1/255, half box, depth.
CONIC_A, CONIC_B, CONIC_C, CUT, HALF_WIDTH, HALF_HEIGHT, DEPTH = range(7)
EXTENT_COLUMNS = 8


class View(NamedTuple):
    """A camera and how it sees Gaussians."""

    camera: np.ndarray  # (21,) float32, one of `camera_vectors`
    degree: int  # of spherical harmonics
    near: np.float32  # near plane, scene units
    low_pass: np.float32  # pixels², variance of the filter on the screen
    antialias: bool  # the filter keeps a splat's light


class Splats(NamedTuple):
    """Gaussians on the screen."""

    drawn: np.ndarray  # (N, SPLAT_COLUMNS) float32, what the rasteriser reads
    extents: np.ndarray  # (N, EXTENT_COLUMNS) float32, what binning reads; CUT < 0 where nothing is seen

    @classmethod
    def zeros(cls, capacity: int) -> "Splats":
        """Room for so many Gaussians."""
        return cls(*(np.zeros((capacity, columns), np.float32) for columns in (SPLAT_COLUMNS, EXTENT_COLUMNS)))


def camera_vectors(cameras: Cameras) -> np.ndarray:
    """(N, 21) float32 camera records."""
    w2c = np.linalg.inv(cameras.c2w @ OPENCV)
    intrinsics = np.stack([cameras.fx, cameras.fy, cameras.cx, cameras.cy], axis=1)
    sizes = np.stack([cameras.width, cameras.height], axis=1)
    parts = [w2c[:, :3, :3].reshape(-1, 9), w2c[:, :3, 3], intrinsics, cameras.positions, sizes]
    return np.concatenate(parts, axis=1).astype(np.float32)


@inlined
def to_camera(g, cam, i):
    """t = W m + d."""
    x, y, z = g[MEAN, i], g[MEAN + 1, i], g[MEAN + 2, i]
    tx = cam[0] * x + cam[1] * y + cam[2] * z + cam[9]
    ty = cam[3] * x + cam[4] * y + cam[5] * z + cam[10]
    tz = cam[6] * x + cam[7] * y + cam[8] * z + cam[11]
    return tx, ty, tz


@inlined
def unit_quaternion(g, i):
    """(w, x, y, z) of length 1, and 1 / length."""
    w, x, y, z = g[QUATERNION, i], g[QUATERNION + 1, i], g[QUATERNION + 2, i], g[QUATERNION + 3, i]
    inverse = ONE / np.sqrt(w * w + x * x + y * y + z * z + F(1e-20))
    return w * inverse, x * inverse, y * inverse, z * inverse, inverse


@inlined
def shape(w, x, y, z, s0, s1, s2):
    """M = R(q) diag(s), row by row."""
    return (
        (ONE - TWO * (y * y + z * z)) * s0,
        TWO * (x * y - w * z) * s1,
        TWO * (x * z + w * y) * s2,
        TWO * (x * y + w * z) * s0,
        (ONE - TWO * (x * x + z * z)) * s1,
        TWO * (y * z - w * x) * s2,
        TWO * (x * z - w * y) * s0,
        TWO * (y * z + w * x) * s1,
        (ONE - TWO * (x * x + y * y)) * s2,
    )


@inlined
def clamped(ratio, limit):
    """tx/tz (or ty/tz) where J is taken."""
    return min(max(ratio, -limit), limit)


@inlined
def jacobian_rows(cam, rz, u, v):
    """T = J W, its two rows."""
    j0, j1 = cam[FX] * rz, cam[FY] * rz
    j2, j3 = -j0 * u, -j1 * v
    return (
        j0 * cam[0] + j2 * cam[6],
        j0 * cam[1] + j2 * cam[7],
        j0 * cam[2] + j2 * cam[8],
        j1 * cam[3] + j3 * cam[6],
        j1 * cam[4] + j3 * cam[7],
        j1 * cam[5] + j3 * cam[8],
    )


@inlined
def view_direction(g, cam, i):
    """Unit vector from the camera to the Gaussian."""
    dx = g[MEAN, i] - cam[POSITION]
    dy = g[MEAN + 1, i] - cam[POSITION + 1]
    dz = g[MEAN + 2, i] - cam[POSITION + 2]
    inverse = ONE / np.sqrt(dx * dx + dy * dy + dz * dz + F(1e-20))
    return dx * inverse, dy * inverse, dz * inverse


@compiled
def project(g, view, splats):
    """Fills the splats of Gaussians g (rows, N); what is not on the screen gets CUT < 0."""
    cam, degree, near, low_pass, antialias = view
    drawn, extents = splats
    fx, fy, cx, cy, width, height = cam[FX], cam[FY], cam[CX], cam[CY], cam[WIDTH], cam[HEIGHT]
    limit_x, limit_y = HALF * MARGIN * width / fx, HALF * MARGIN * height / fy
    basis, count = np.empty(MOST, np.float32), (degree + 1) * (degree + 1)
    for i in range(g.shape[1]):
        extents[i, CUT] = F(-1)
        tx, ty, tz = to_camera(g, cam, i)
        if not tz > near:
            continue
        log2_opacity = np.log2(sigmoid(g[LOGIT, i]))
        if not log2_opacity > -MIN_ALPHA_LOG2:
            continue
        rz = ONE / tz
        w, x, y, z, _ = unit_quaternion(g, i)
        s0, s1, s2 = exp(g[LOG_SCALE, i]), exp(g[LOG_SCALE + 1, i]), exp(g[LOG_SCALE + 2, i])
        m = shape(w, x, y, z, s0, s1, s2)
        t = jacobian_rows(cam, rz, clamped(tx * rz, limit_x), clamped(ty * rz, limit_y))
        u0 = t[0] * m[0] + t[1] * m[3] + t[2] * m[6]
        u1 = t[0] * m[1] + t[1] * m[4] + t[2] * m[7]
        u2 = t[0] * m[2] + t[1] * m[5] + t[2] * m[8]
        u3 = t[3] * m[0] + t[4] * m[3] + t[5] * m[6]
        u4 = t[3] * m[1] + t[4] * m[4] + t[5] * m[7]
        u5 = t[3] * m[2] + t[4] * m[5] + t[5] * m[8]
        a = u0 * u0 + u1 * u1 + u2 * u2
        b = u0 * u3 + u1 * u4 + u2 * u5
        c = u3 * u3 + u4 * u4 + u5 * u5
        sharp = a * c - b * b
        a, c = a + low_pass, c + low_pass
        determinant = a * c - b * b
        if antialias:
            log2_opacity += HALF * np.log2(max(sharp / determinant, FAINTEST))
        cut = TWO * (log2_opacity + MIN_ALPHA_LOG2) / LOG2E
        if not cut > ZERO:
            continue
        px, py = fx * tx * rz + cx, fy * ty * rz + cy
        rx, ry = np.sqrt(cut * a), np.sqrt(cut * c)
        if not determinant > F(1e-12):
            continue
        if px + rx <= HALF or px - rx >= width - HALF or py + ry <= HALF or py - ry >= height - HALF:
            continue
        inverse = ONE / determinant
        conic_a, conic_b, conic_c = c * inverse, -b * inverse, a * inverse
        extents[i, CONIC_A], extents[i, CONIC_B], extents[i, CONIC_C] = conic_a, conic_b, conic_c
        extents[i, CUT], extents[i, HALF_WIDTH], extents[i, HALF_HEIGHT] = cut, rx, ry
        extents[i, DEPTH] = tz
        dx, dy, dz = view_direction(g, cam, i)
        fill_basis(degree, dx, dy, dz, basis)
        drawn[i, X], drawn[i, Y] = px, py
        drawn[i, A], drawn[i, B], drawn[i, C] = conic_a * (HALF * LOG2E), conic_b * LOG2E, conic_c * (HALF * LOG2E)
        drawn[i, LOG2_OPACITY] = log2_opacity
        for channel in range(3):
            drawn[i, RED + channel] = max(colour(g, i, channel, count, basis), ZERO)
