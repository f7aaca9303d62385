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

from ...common.kernels import exact, written
from ...common.lane_functions import dot, exp, log2, sigmoid
from ...common.lanes import (
    aligned,
    bits,
    floor,
    fma,
    larger,
    load_some,
    lowest,
    numbers,
    smaller,
    spread,
    sqrt,
    store,
)
from ...scenes.types import OPENCV, Cameras
from .harmonics import MOST, colour, fill_basis
from .kernels import HALF, LOG2E, ONE, TWO, ZERO, F
from .layout import LOG_SCALE, LOGIT, MEAN, QUATERNION

FAINTEST = F(2.5e-5)  # of the squared factor that `antialias` multiplies opacities by
MARGIN = F(1.3)  # of the half field of view, where J's point is clamped
MIN_ALPHA_LOG2 = F(7.994353436858858)  # -log2(1/255): below it a splat is not drawn

# A camera as kernels take it: 21 float32.
ROTATION, TRANSLATION, FX, FY, CX, CY, POSITION, WIDTH, HEIGHT = 0, 9, 12, 13, 14, 15, 16, 19, 20

TILE = 8  # pixels; 64 of them are a few vectors, and small tiles waste little on small splats

# Columns of `Splats.drawn`. With d = pixel - mean, log2 of alpha is
# L - (A dx² + B dx dy + C dy²): the conic with ½ and log2 e folded in.
X, Y, A, B, C, LOG2_OPACITY, RED, GREEN, BLUE = range(9)
# Where the ellipse at which alpha is 1/255 lies: half its height; at height d it spans x - SLOPE d ± sqrt(SQUARE -
# CURVE d²), and it is widest to the right at d = WIDEST.
HALF_HEIGHT, SLOPE, SQUARE, CURVE, WIDEST = range(9, 14)
COLUMNS = 14
SPLAT_COLUMNS = 16  # padded to a cache line


class View(NamedTuple):
    """A camera and how it sees Gaussians."""

    camera: np.ndarray  # (21,) float32, one of `camera_vectors`
    degree: int  # of spherical harmonics
    near: np.float32  # near plane, scene units
    low_pass: np.float32  # pixels², variance of the filter on the screen
    antialias: bool  # the filter keeps a splat's light


class Splats(NamedTuple):
    """Gaussians on the screen: those that are seen of each range of them, side by side from where the range begins."""

    drawn: np.ndarray  # (N, SPLAT_COLUMNS) float32
    depth: np.ndarray  # (N,) float32
    most: np.ndarray  # (N,) int32, a bound on the tiles that are touched
    gaussian: np.ndarray  # (N,) int32, which it is
    ranges: np.ndarray  # (parts, 2) int64, where a range begins and how many of it are seen

    @classmethod
    def zeros(cls, capacity: int, parts: int) -> "Splats":
        """Room for so many Gaussians, in so many ranges."""
        drawn, depth = np.zeros((capacity, SPLAT_COLUMNS), np.float32), np.zeros(capacity, np.float32)
        most, gaussian = np.zeros(capacity, np.int32), np.zeros(capacity, np.int32)
        return cls(drawn, depth, most, gaussian, np.zeros((parts, 2), np.int64))


def camera_vectors(cameras: Cameras) -> np.ndarray:
    """(N, 21) float32 camera records."""
    w2c = np.linalg.inv(cameras.c2w @ OPENCV)
    intrinsics = np.stack([cameras.fx, cameras.fy, cameras.cx, cameras.cy], axis=1)
    sizes = np.stack([cameras.width, cameras.height], axis=1)
    parts = [w2c[:, :3, :3].reshape(-1, 9), w2c[:, :3, 3], intrinsics, cameras.positions, sizes]
    return np.concatenate(parts, axis=1).astype(np.float32)


# Each of these is of the 16 Gaussians from i on, those of them that the mask `which` names.


@written
def to_camera(g, cam, i, which):
    """t = W m + d."""
    x, y, z = load_some(g, MEAN, i, which), load_some(g, MEAN + 1, i, which), load_some(g, MEAN + 2, i, which)
    tx = fma(cam[0], x, fma(cam[1], y, fma(cam[2], z, cam[9])))
    ty = fma(cam[3], x, fma(cam[4], y, fma(cam[5], z, cam[10])))
    tz = fma(cam[6], x, fma(cam[7], y, fma(cam[8], z, cam[11])))
    return tx, ty, tz


@written
def unit_quaternion(g, i, which):
    """(w, x, y, z) of length 1, and 1 / length."""
    w, x = load_some(g, QUATERNION, i, which), load_some(g, QUATERNION + 1, i, which)
    y, z = load_some(g, QUATERNION + 2, i, which), load_some(g, QUATERNION + 3, i, which)
    inverse = ONE / sqrt(fma(w, w, dot(x, x, y, y, z, z)) + F(1e-20))
    return w * inverse, x * inverse, y * inverse, z * inverse, inverse


@written
def scales(g, i, which):
    """Standard deviations along the Gaussian's axes."""
    first, second = exp(load_some(g, LOG_SCALE, i, which)), exp(load_some(g, LOG_SCALE + 1, i, which))
    return first, second, exp(load_some(g, LOG_SCALE + 2, i, which))


@written
def shape(w, x, y, z, s0, s1, s2):
    """M = R(q) diag(s), row by row."""
    return (
        (ONE - TWO * fma(y, y, z * z)) * s0,
        TWO * fma(x, y, -(w * z)) * s1,
        TWO * fma(x, z, w * y) * s2,
        TWO * fma(x, y, w * z) * s0,
        (ONE - TWO * fma(x, x, z * z)) * s1,
        TWO * fma(y, z, -(w * x)) * s2,
        TWO * fma(x, z, -(w * y)) * s0,
        TWO * fma(y, z, w * x) * s1,
        (ONE - TWO * fma(x, x, y * y)) * s2,
    )


@written
def clamped(ratio, limit):
    """tx/tz (or ty/tz) where J is taken."""
    return smaller(larger(ratio, -limit), limit)


@written
def jacobian_rows(cam, rz, u, v):
    """T = J W, its two rows."""
    j0, j1 = cam[FX] * rz, cam[FY] * rz
    j2, j3 = -(j0 * u), -(j1 * v)
    return (
        fma(j0, cam[0], j2 * cam[6]),
        fma(j0, cam[1], j2 * cam[7]),
        fma(j0, cam[2], j2 * cam[8]),
        fma(j1, cam[3], j3 * cam[6]),
        fma(j1, cam[4], j3 * cam[7]),
        fma(j1, cam[5], j3 * cam[8]),
    )


@written
def on_screen(t, m):
    """U = T M, its two rows."""
    return (
        dot(t[0], m[0], t[1], m[3], t[2], m[6]),
        dot(t[0], m[1], t[1], m[4], t[2], m[7]),
        dot(t[0], m[2], t[1], m[5], t[2], m[8]),
        dot(t[3], m[0], t[4], m[3], t[5], m[6]),
        dot(t[3], m[1], t[4], m[4], t[5], m[7]),
        dot(t[3], m[2], t[4], m[5], t[5], m[8]),
    )


@written
def covariance(u):
    """U Uᵀ: its elements xx, xy, yy, and its determinant, by the rows' cross product, which cancels nothing."""
    a = dot(u[0], u[0], u[1], u[1], u[2], u[2])
    b = dot(u[0], u[3], u[1], u[4], u[2], u[5])
    c = dot(u[3], u[3], u[4], u[4], u[5], u[5])
    x, y, z = fma(u[1], u[5], -(u[2] * u[4])), fma(u[2], u[3], -(u[0] * u[5])), fma(u[0], u[4], -(u[1] * u[3]))
    return a, b, c, dot(x, x, y, y, z, z)


@written
def view_direction(g, cam, i, which):
    """Unit vector from the camera to the Gaussian."""
    dx = load_some(g, MEAN, i, which) - cam[POSITION]
    dy = load_some(g, MEAN + 1, i, which) - cam[POSITION + 1]
    dz = load_some(g, MEAN + 2, i, which) - cam[POSITION + 2]
    inverse = ONE / sqrt(dot(dx, dx, dy, dy, dz, dz) + F(1e-20))
    return dx * inverse, dy * inverse, dz * inverse


@written
def tiles_within(middle, radius, count):
    """How many of `count` tiles in a row, at most, are nearer to `middle` than `radius`."""
    end = smaller(floor((middle + radius) * F(1 / TILE)) + ONE, count)
    return end - larger(floor((middle - radius - ONE) * F(1 / TILE)), spread(ZERO))


@exact
def project(g, view, splats, part, first, last):
    """Fills the splats of range `part`, Gaussians `first` (a multiple of 16) to `last` of g (rows, N)."""
    cam, degree, near, low_pass, antialias = view
    drawn, place = splats.drawn, first
    width, height = cam[WIDTH], cam[HEIGHT]
    limit_x, limit_y = spread(HALF * MARGIN * width / cam[FX]), spread(HALF * MARGIN * height / cam[FY])
    across, down = floor(spread((width + F(TILE - 1)) / F(TILE))), floor(spread((height + F(TILE - 1)) / F(TILE)))
    memory, basis = np.empty(16 * COLUMNS + 48, np.float32), np.empty(16 * MOST, np.float32)
    own, count = aligned(memory), (degree + 1) * (degree + 1)
    most, depth = own + 16 * COLUMNS, own + 16 * (COLUMNS + 1)
    for i in range(first, last, 16):
        inside = numbers() < F(last - i)
        tx, ty, tz = to_camera(g, cam, i, inside)
        seen = inside & (tz > near)
        if bits(seen) == 0:
            continue
        rz = ONE / tz
        ux, uy = tx * rz, ty * rz
        w, x, y, z, _ = unit_quaternion(g, i, inside)
        s0, s1, s2 = scales(g, i, inside)
        t = jacobian_rows(cam, rz, clamped(ux, limit_x), clamped(uy, limit_y))
        a, b, c, sharp = covariance(on_screen(t, shape(w, x, y, z, s0, s1, s2)))
        determinant = fma(low_pass, a + c + low_pass, sharp)
        a, c = a + low_pass, c + low_pass
        inverse = ONE / determinant
        opacity = sigmoid(load_some(g, LOGIT, i, inside))
        if antialias:
            opacity = opacity * sqrt(larger(sharp * inverse, spread(FAINTEST)))
        log2_opacity = log2(opacity)
        cut = (log2_opacity + MIN_ALPHA_LOG2) * (TWO / LOG2E)  # of the squared Mahalanobis distance
        px, py = fma(cam[FX], ux, cam[CX]), fma(cam[FY], uy, cam[CY])
        rx, ry = sqrt(cut * a), sqrt(cut * c)
        seen = seen & (cut > ZERO) & (determinant > F(1e-12))
        seen = seen & (px + rx > HALF) & (px - rx < width - HALF) & (py + ry > HALF) & (py - ry < height - HALF)
        left = bits(seen)
        if left == 0:
            continue
        store(memory, most, tiles_within(px, rx, across) * tiles_within(py, ry, down))
        store(memory, depth, tz)
        dx, dy, dz = view_direction(g, cam, i, inside)
        fill_basis(degree, dx, dy, dz, basis)
        store(memory, own + 16 * X, px)
        store(memory, own + 16 * Y, py)
        store(memory, own + 16 * A, c * inverse * (HALF * LOG2E))
        store(memory, own + 16 * B, -(b * inverse) * LOG2E)
        store(memory, own + 16 * C, a * inverse * (HALF * LOG2E))
        store(memory, own + 16 * LOG2_OPACITY, log2_opacity)
        for channel in range(3):
            value = larger(colour(g, i, inside, channel, count, basis), spread(ZERO))
            store(memory, own + 16 * (RED + channel), value)
        store(memory, own + 16 * HALF_HEIGHT, ry)
        narrow = determinant / c
        store(memory, own + 16 * SLOPE, -(b / c))
        store(memory, own + 16 * SQUARE, cut * narrow)
        store(memory, own + 16 * CURVE, narrow / c)
        store(memory, own + 16 * WIDEST, b * rx / a)
        while left:
            lane = lowest(left)
            left &= left - 1
            for column in range(COLUMNS):
                drawn[place, column] = memory[own + 16 * column + lane]
            splats.depth[place], splats.most[place] = memory[depth + lane], int(memory[most + lane])
            splats.gaussian[place] = i + lane
            place += 1
    splats.ranges[part, 0], splats.ranges[part, 1] = first, place - first
