"""Gradients of the parameters from those of the (splat, tile) pairs: the projection of projection.py, in reverse."""

from typing import NamedTuple

import numpy as np

from ...common.kernels import exact
from ...common.lane_functions import dot, exp, sigmoid
from ...common.lanes import (
    aligned,
    fma,
    load,
    load_row,
    load_some,
    magnitude,
    numbers,
    spread,
    sqrt,
    store,
    store_row,
    store_some,
    where,
)
from .harmonics import MOST, colour, fill_basis
from .kernels import HALF, ONE, TWO, ZERO, F
from .layout import LOG_SCALE, LOGIT, MEAN, QUATERNION, SH0
from .projection import (
    FAINTEST,
    FX,
    FY,
    HEIGHT,
    MARGIN,
    WIDTH,
    clamped,
    covariance,
    jacobian_rows,
    on_screen,
    scales,
    shape,
    to_camera,
    unit_quaternion,
    view_direction,
)
from .raster import SUMS


class Moments(NamedTuple):
    """What Adam remembers of the gradients."""

    first: np.ndarray  # (rows, N) float32, their running mean
    second: np.ndarray  # (rows, N) float32, that of their squares

    @classmethod
    def zeros(cls, gaussians: np.ndarray) -> "Moments":
        """Of (rows, N) parameters that have not moved yet."""
        return cls(np.zeros_like(gaussians), np.zeros_like(gaussians))


class Rates(NamedTuple):
    """What Adam goes by in one step."""

    rows: np.ndarray  # (rows,) float32, how far a step goes in each parameter
    correction_1: np.float32  # 1 / (1 - β₁ᵗ), t the number of the step
    correction_2: np.float32  # 1 / (1 - β₂ᵗ)

    @classmethod
    def of_step(cls, number: int, rows: np.ndarray) -> "Rates":
        """Of a step that counts from 1."""
        return cls(rows.astype(np.float32, copy=False), F(1 / (1 - 0.9**number)), F(1 / (1 - 0.999**number)))


@exact
def project_backward(g, view, slots, pair_gradient, out, first, last):
    """Fills columns `first` (a multiple of 16) to `last` of out (rows, a multiple of 16) for Gaussians g (rows, N).

    Those without pairs get zeros.
    """
    cam, degree, _, low_pass, antialias = view
    fx, fy = cam[FX], cam[FY]
    limit_x, limit_y = spread(HALF * MARGIN * cam[WIDTH] / fx), spread(HALF * MARGIN * cam[HEIGHT] / fy)
    memory, basis = np.empty(16 * SUMS + 32, np.float32), np.empty(16 * MOST, np.float32)
    own, count = aligned(memory), (degree + 1) * (degree + 1)
    one = own + 16 * SUMS  # a Gaussian's sums
    drawn = np.empty(16, np.float32)
    zero = spread(ZERO)
    for i in range(first, last, 16):
        pairs = 0
        for lane in range(16):
            number = slots.number[i + lane]
            drawn[lane] = F(number)
            pairs += number
        if pairs == 0:
            for row in range(g.shape[0]):
                store_row(out, row, i, zero)
            continue
        for lane in range(16):
            total = zero
            begin = np.int64(slots.first[i + lane])
            for slot in range(begin, begin + slots.number[i + lane]):
                total = total + load_row(pair_gradient, slot, 0)
            store(memory, one, total)
            for column in range(SUMS):
                memory[own + 16 * column + lane] = memory[one + column]
        inside, shown = numbers() < F(last - i), load(drawn, 0) > ZERO
        s_0, s_x, s_y = load(memory, own), load(memory, own + 16), load(memory, own + 32)
        s_xx, s_xy, s_yy = load(memory, own + 48), load(memory, own + 64), load(memory, own + 80)
        # Forward again, to where the ellipse is.
        tx, ty, tz = to_camera(g, cam, i, inside)
        rz = ONE / tz
        ux, uy = tx * rz, ty * rz
        u, v = clamped(ux, limit_x), clamped(uy, limit_y)
        w, x, y, z, inverse_length = unit_quaternion(g, i, inside)
        s0, s1, s2 = scales(g, i, inside)
        m = shape(w, x, y, z, s0, s1, s2)
        t = jacobian_rows(cam, rz, u, v)
        us = on_screen(t, m)
        sharp_a, b, sharp_c, sharp = covariance(us)
        a, c = sharp_a + low_pass, sharp_c + low_pass
        inverse = ONE / fma(low_pass, a + sharp_c, sharp)
        qa, qb, qc = c * inverse, -(b * inverse), a * inverse
        # To the screen mean, ∂/∂µ = Q Σ s d, and to the covariance, -Q (∂/∂Q) Q with ∂/∂Q = -½ Σ s d dᵀ.
        by_px, by_py = fma(qa, s_x, qb * s_y), fma(qb, s_x, qc * s_y)
        ha, hb, hc = -HALF * s_xx, -HALF * s_xy, -HALF * s_yy
        x00, x01 = fma(qa, ha, qb * hb), fma(qa, hb, qb * hc)
        x10, x11 = fma(qb, ha, qc * hb), fma(qb, hb, qc * hc)
        by_a, by_b, by_c = -fma(x00, qa, x01 * qb), -TWO * fma(x00, qb, x01 * qc), -fma(x10, qb, x11 * qc)
        if antialias:
            # s_0 is the gradient by log α, so also by log of the factor, ½ log|U Uᵀ| - ½ log|Σ'|.
            counts = where(sharp * inverse > FAINTEST, s_0, zero)
            sharper = ONE / where(sharp * inverse > FAINTEST, sharp, spread(ONE))
            by_a = fma(HALF * counts, fma(sharp_c, sharper, -(c * inverse)), by_a)
            by_b = fma(counts * b, inverse - sharper, by_b)
            by_c = fma(HALF * counts, fma(sharp_a, sharper, -(a * inverse)), by_c)
        # To U, then to M = R diag(s) and to T = J W.
        by_a, by_c = TWO * by_a, TWO * by_c
        g0, g1, g2 = fma(by_a, us[0], by_b * us[3]), fma(by_a, us[1], by_b * us[4]), fma(by_a, us[2], by_b * us[5])
        g3, g4, g5 = fma(by_c, us[3], by_b * us[0]), fma(by_c, us[4], by_b * us[1]), fma(by_c, us[5], by_b * us[2])
        n0, n1, n2 = fma(t[0], g0, t[3] * g3), fma(t[0], g1, t[3] * g4), fma(t[0], g2, t[3] * g5)
        n3, n4, n5 = fma(t[1], g0, t[4] * g3), fma(t[1], g1, t[4] * g4), fma(t[1], g2, t[4] * g5)
        n6, n7, n8 = fma(t[2], g0, t[5] * g3), fma(t[2], g1, t[5] * g4), fma(t[2], g2, t[5] * g5)
        e0, e1 = dot(g0, m[0], g1, m[1], g2, m[2]), dot(g0, m[3], g1, m[4], g2, m[5])
        e2 = dot(g0, m[6], g1, m[7], g2, m[8])
        e3, e4 = dot(g3, m[0], g4, m[1], g5, m[2]), dot(g3, m[3], g4, m[4], g5, m[5])
        e5 = dot(g3, m[6], g4, m[7], g5, m[8])
        j00, j02 = dot(e0, cam[0], e1, cam[1], e2, cam[2]), dot(e0, cam[6], e1, cam[7], e2, cam[8])
        j11, j12 = dot(e3, cam[3], e4, cam[4], e5, cam[5]), dot(e3, cam[6], e4, cam[7], e5, cam[8])
        # To t, through J (its point does not move where it is clamped) and through the screen mean.
        by_u = where(magnitude(ux) < limit_x, -(fx * rz * j02), zero)
        by_v = where(magnitude(uy) < limit_y, -(fy * rz * j12), zero)
        by_rz = fma(fx, j00 - u * j02, fy * (j11 - v * j12))
        by_tx, by_ty = fma(by_px, fx, by_u) * rz, fma(by_py, fy, by_v) * rz
        by_tz = -(fma(by_tx, tx, by_ty * ty) * rz) - by_rz * rz * rz
        store_row(out, MEAN, i, where(shown, dot(cam[0], by_tx, cam[3], by_ty, cam[6], by_tz), zero))
        store_row(out, MEAN + 1, i, where(shown, dot(cam[1], by_tx, cam[4], by_ty, cam[7], by_tz), zero))
        store_row(out, MEAN + 2, i, where(shown, dot(cam[2], by_tx, cam[5], by_ty, cam[8], by_tz), zero))
        store_row(out, LOG_SCALE, i, where(shown, dot(n0, m[0], n3, m[3], n6, m[6]), zero))
        store_row(out, LOG_SCALE + 1, i, where(shown, dot(n1, m[1], n4, m[4], n7, m[7]), zero))
        store_row(out, LOG_SCALE + 2, i, where(shown, dot(n2, m[2], n5, m[5], n8, m[8]), zero))
        r0, r1, r2, r3, r4, r5 = n0 * s0, n1 * s1, n2 * s2, n3 * s0, n4 * s1, n5 * s2
        r6, r7, r8 = n6 * s0, n7 * s1, n8 * s2
        by_w = TWO * dot(x, r7 - r5, y, r2 - r6, z, r3 - r1)
        by_x = TWO * fma(-TWO * x, r4 + r8, dot(y, r1 + r3, z, r2 + r6, w, r7 - r5))
        by_y = TWO * fma(-TWO * y, r0 + r8, dot(x, r1 + r3, z, r5 + r7, w, r2 - r6))
        by_z = TWO * fma(-TWO * z, r0 + r4, dot(x, r2 + r6, y, r5 + r7, w, r3 - r1))
        along = fma(by_w, w, dot(by_x, x, by_y, y, by_z, z))
        store_row(out, QUATERNION, i, where(shown, (by_w - along * w) * inverse_length, zero))
        store_row(out, QUATERNION + 1, i, where(shown, (by_x - along * x) * inverse_length, zero))
        store_row(out, QUATERNION + 2, i, where(shown, (by_y - along * y) * inverse_length, zero))
        store_row(out, QUATERNION + 3, i, where(shown, (by_z - along * z) * inverse_length, zero))
        opacity = sigmoid(load_some(g, LOGIT, i, inside))
        store_row(out, LOGIT, i, where(shown, s_0 * (ONE - opacity), zero))
        dx, dy, dz = view_direction(g, cam, i, inside)
        fill_basis(degree, dx, dy, dz, basis)
        for channel in range(3):
            lit = shown & (colour(g, i, inside, channel, count, basis) > ZERO)
            by_colour = where(lit, load(memory, own + 16 * (6 + channel)), zero)
            for k in range(count):
                store_row(out, SH0 + 3 * k + channel, i, load(basis, 16 * k) * by_colour)


@exact
def regularise(g, opacity_weight, scale_weight, out, first, last):
    """Adds the gradients of opacity_weight · Σ opacity + scale_weight · Σ scale (Kheradmand et al. 2024, Eq. 10)."""
    for i in range(first, last, 16):
        inside = numbers() < F(last - i)
        opacity = sigmoid(load_some(g, LOGIT, i, inside))
        by_logit = fma(opacity_weight * opacity, ONE - opacity, load_row(out, LOGIT, i))
        store_row(out, LOGIT, i, by_logit)
        for row in range(LOG_SCALE, LOG_SCALE + 3):
            size = exp(load_some(g, row, i, inside))
            store_row(out, row, i, fma(scale_weight, size, load_row(out, row, i)))


@exact
def adam(parameters, gradient, moments, rates, first, last):
    """One step of Adam (Kingma and Ba 2015), β = (0.9, 0.999), ε = 1e-15 as 3DGS; one rate per row.

    Of columns `first` (a multiple of 16) to `last`.
    """
    b1, b2, eps = F(0.9), F(0.999), F(1e-15)
    for row in range(parameters.shape[0]):
        rate = rates.rows[row] * rates.correction_1
        if rate == ZERO:
            continue
        for i in range(first, last, 16):
            inside = numbers() < F(last - i)
            slope = load_row(gradient, row, i)
            mean = fma(b1, load_some(moments.first, row, i, inside), (ONE - b1) * slope)
            square = fma(b2, load_some(moments.second, row, i, inside), (ONE - b2) * slope * slope)
            step = rate * mean / (sqrt(square * rates.correction_2) + eps)
            store_some(moments.first, row, i, mean, inside)
            store_some(moments.second, row, i, square, inside)
            store_some(parameters, row, i, load_some(parameters, row, i, inside) - step, inside)
