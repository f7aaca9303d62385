"""Gradients of the parameters from those of the (splat, tile) pairs: the projection of projection.py, in reverse."""

from typing import NamedTuple

import numpy as np

from ...common.kernels import compiled
from .harmonics import MOST, colour, fill_basis
from .kernels import HALF, ONE, TWO, ZERO, F, exp, sigmoid
from .layout import LOG_SCALE, LOGIT, MEAN, QUATERNION, SH0
from .projection import (
    FAINTEST,
    FX,
    FY,
    HEIGHT,
    MARGIN,
    WIDTH,
    clamped,
    jacobian_rows,
    shape,
    to_camera,
    unit_quaternion,
    view_direction,
)


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


@compiled
def project_backward(g, view, slots, pair_gradient, out):
    """Fills out (rows, at least N) for Gaussians g (rows, N); those without pairs get zeros."""
    cam, degree, _, low_pass, antialias = view
    fx, fy = cam[FX], cam[FY]
    limit_x, limit_y = HALF * MARGIN * cam[WIDTH] / fx, HALF * MARGIN * cam[HEIGHT] / fy
    sums = np.empty(9, np.float32)
    basis, count = np.empty(MOST, np.float32), (degree + 1) * (degree + 1)
    for i in range(g.shape[1]):
        if slots.number[i] == 0:
            for row in range(g.shape[0]):
                out[row, i] = ZERO
            continue
        sums[:] = ZERO
        for slot in range(slots.first[i], slots.first[i] + slots.number[i]):
            for column in range(9):
                sums[column] += pair_gradient[slot, column]
        # Forward again, to where the ellipse is.
        tx, ty, tz = to_camera(g, cam, i)
        rz = ONE / tz
        ux, uy = tx * rz, ty * rz
        u, v = clamped(ux, limit_x), clamped(uy, limit_y)
        w, x, y, z, inverse_length = unit_quaternion(g, i)
        s0, s1, s2 = exp(g[LOG_SCALE, i]), exp(g[LOG_SCALE + 1, i]), exp(g[LOG_SCALE + 2, i])
        m0, m1, m2, m3, m4, m5, m6, m7, m8 = shape(w, x, y, z, s0, s1, s2)
        t0, t1, t2, t3, t4, t5 = jacobian_rows(cam, rz, u, v)
        u0, u1, u2 = t0 * m0 + t1 * m3 + t2 * m6, t0 * m1 + t1 * m4 + t2 * m7, t0 * m2 + t1 * m5 + t2 * m8
        u3, u4, u5 = t3 * m0 + t4 * m3 + t5 * m6, t3 * m1 + t4 * m4 + t5 * m7, t3 * m2 + t4 * m5 + t5 * m8
        sharp_a, b, sharp_c = u0 * u0 + u1 * u1 + u2 * u2, u0 * u3 + u1 * u4 + u2 * u5, u3 * u3 + u4 * u4 + u5 * u5
        a, c = sharp_a + low_pass, sharp_c + low_pass
        inverse = ONE / (a * c - b * b)
        qa, qb, qc = c * inverse, -b * inverse, a * inverse
        # To the screen mean, ∂/∂µ = Q Σ s d, and to the covariance, -Q (∂/∂Q) Q with ∂/∂Q = -½ Σ s d dᵀ.
        by_px, by_py = qa * sums[1] + qb * sums[2], qb * sums[1] + qc * sums[2]
        ha, hb, hc = -HALF * sums[3], -HALF * sums[4], -HALF * sums[5]
        x00, x01 = qa * ha + qb * hb, qa * hb + qb * hc
        x10, x11 = qb * ha + qc * hb, qb * hb + qc * hc
        by_a, by_b, by_c = -(x00 * qa + x01 * qb), -TWO * (x00 * qb + x01 * qc), -(x10 * qb + x11 * qc)
        if antialias:
            # sums[0] is the gradient by log α, so also by log of the factor, ½ log|U Uᵀ| - ½ log|Σ'|.
            sharp = sharp_a * sharp_c - b * b
            if sharp * inverse > FAINTEST:
                sharper = ONE / sharp
                by_a += HALF * sums[0] * (sharp_c * sharper - c * inverse)
                by_b += sums[0] * b * (inverse - sharper)
                by_c += HALF * sums[0] * (sharp_a * sharper - a * inverse)
        # To U, then to M = R diag(s) and to T = J W.
        g0, g1, g2 = TWO * by_a * u0 + by_b * u3, TWO * by_a * u1 + by_b * u4, TWO * by_a * u2 + by_b * u5
        g3, g4, g5 = TWO * by_c * u3 + by_b * u0, TWO * by_c * u4 + by_b * u1, TWO * by_c * u5 + by_b * u2
        n0, n1, n2 = t0 * g0 + t3 * g3, t0 * g1 + t3 * g4, t0 * g2 + t3 * g5
        n3, n4, n5 = t1 * g0 + t4 * g3, t1 * g1 + t4 * g4, t1 * g2 + t4 * g5
        n6, n7, n8 = t2 * g0 + t5 * g3, t2 * g1 + t5 * g4, t2 * g2 + t5 * g5
        e0, e1, e2 = g0 * m0 + g1 * m1 + g2 * m2, g0 * m3 + g1 * m4 + g2 * m5, g0 * m6 + g1 * m7 + g2 * m8
        e3, e4, e5 = g3 * m0 + g4 * m1 + g5 * m2, g3 * m3 + g4 * m4 + g5 * m5, g3 * m6 + g4 * m7 + g5 * m8
        j00, j02 = e0 * cam[0] + e1 * cam[1] + e2 * cam[2], e0 * cam[6] + e1 * cam[7] + e2 * cam[8]
        j11, j12 = e3 * cam[3] + e4 * cam[4] + e5 * cam[5], e3 * cam[6] + e4 * cam[7] + e5 * cam[8]
        # To t, through J (its point does not move where it is clamped) and through the screen mean.
        by_u = -fx * rz * j02 if abs(ux) < limit_x else ZERO
        by_v = -fy * rz * j12 if abs(uy) < limit_y else ZERO
        by_rz = fx * j00 - fx * u * j02 + fy * j11 - fy * v * j12
        by_tx, by_ty = (by_px * fx + by_u) * rz, (by_py * fy + by_v) * rz
        by_tz = -(by_tx * tx + by_ty * ty) * rz - by_rz * rz * rz
        out[MEAN, i] = cam[0] * by_tx + cam[3] * by_ty + cam[6] * by_tz
        out[MEAN + 1, i] = cam[1] * by_tx + cam[4] * by_ty + cam[7] * by_tz
        out[MEAN + 2, i] = cam[2] * by_tx + cam[5] * by_ty + cam[8] * by_tz
        out[LOG_SCALE, i] = n0 * m0 + n3 * m3 + n6 * m6
        out[LOG_SCALE + 1, i] = n1 * m1 + n4 * m4 + n7 * m7
        out[LOG_SCALE + 2, i] = n2 * m2 + n5 * m5 + n8 * m8
        r0, r1, r2, r3, r4, r5, r6, r7, r8 = (
            n0 * s0,
            n1 * s1,
            n2 * s2,
            n3 * s0,
            n4 * s1,
            n5 * s2,
            n6 * s0,
            n7 * s1,
            n8 * s2,
        )
        by_w = TWO * (x * (r7 - r5) + y * (r2 - r6) + z * (r3 - r1))
        by_x = TWO * (-TWO * x * (r4 + r8) + y * (r1 + r3) + z * (r2 + r6) + w * (r7 - r5))
        by_y = TWO * (x * (r1 + r3) - TWO * y * (r0 + r8) + z * (r5 + r7) + w * (r2 - r6))
        by_z = TWO * (x * (r2 + r6) + y * (r5 + r7) - TWO * z * (r0 + r4) + w * (r3 - r1))
        along = by_w * w + by_x * x + by_y * y + by_z * z
        out[QUATERNION, i] = (by_w - along * w) * inverse_length
        out[QUATERNION + 1, i] = (by_x - along * x) * inverse_length
        out[QUATERNION + 2, i] = (by_y - along * y) * inverse_length
        out[QUATERNION + 3, i] = (by_z - along * z) * inverse_length
        out[LOGIT, i] = sums[0] * (ONE - sigmoid(g[LOGIT, i]))
        dx, dy, dz = view_direction(g, cam, i)
        fill_basis(degree, dx, dy, dz, basis)
        for channel in range(3):
            shown = colour(g, i, channel, count, basis) > ZERO
            for k in range(count):
                out[SH0 + 3 * k + channel, i] = basis[k] * sums[6 + channel] if shown else ZERO


@compiled
def regularise(g, opacity_weight, scale_weight, out):
    """Adds the gradients of opacity_weight · Σ opacity + scale_weight · Σ scale (Kheradmand et al. 2024, Eq. 10)."""
    n = g.shape[1]
    for i in range(n):
        opacity = sigmoid(g[LOGIT, i])
        out[LOGIT, i] += opacity_weight * opacity * (ONE - opacity)
    for axis in range(3):
        for i in range(n):
            out[LOG_SCALE + axis, i] += scale_weight * exp(g[LOG_SCALE + axis, i])


@compiled
def adam(parameters, gradient, moments, rates):
    """One step of Adam (Kingma and Ba 2015), β = (0.9, 0.999), ε = 1e-15 as 3DGS; one rate per row."""
    b1, b2, eps = F(0.9), F(0.999), F(1e-15)
    for row in range(parameters.shape[0]):
        p, g, m, v = parameters[row], gradient[row], moments.first[row], moments.second[row]
        rate = rates.rows[row] * rates.correction_1
        if rate == ZERO:
            continue
        for i in range(parameters.shape[1]):
            mean = b1 * m[i] + (ONE - b1) * g[i]
            square = b2 * v[i] + (ONE - b2) * g[i] * g[i]
            m[i], v[i] = mean, square
            p[i] -= rate * mean / (np.sqrt(square * rates.correction_2) + eps)
