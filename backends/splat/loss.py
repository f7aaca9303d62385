"""The training loss of 3DGS, (1 - λ) L1 + λ (1 - SSIM), and its gradient with respect to the picture.

SSIM as Wang et al. 2004: 11 x 11 Gaussian window with σ = 1.5, zero beyond the picture, C₁ = 0.01², C₂ = 0.03². The
window is separable; images lie in planes padded by 5 zeros on each side, so that both passes are long flat loops.
With µ, E = blur(x²) and F = blur(xy), SSIM = A₁A₂ / (B₁B₂), A₁ = 2µµ_y + C₁, A₂ = 2(F - µµ_y) + C₂,
B₁ = µ² + µ_y² + C₁, B₂ = E - µ² + var_y + C₂, and ∂/∂x = blur(∂/∂µ) + 2x blur(∂/∂E) + y blur(∂/∂F).
"""

from typing import NamedTuple

import numpy as np

from ...common.kernels import compiled
from .kernels import ONE, TWO, ZERO, F
from .planes import RADIUS, Planes
from .windows import measure

C1, C2 = F(1e-4), F(9e-4)
_window = np.exp(-(np.arange(-RADIUS, RADIUS + 1) ** 2) / (2 * 1.5**2))
WINDOW = _window / _window.sum()
W0, W1, W2, W3, W4, W5 = (F(WINDOW[RADIUS + offset]) for offset in range(6))
# Unsigned offsets: with signed ones the compiler must allow for wrapping and gives up on vectors.
U1, U2, U3, U4, U5, U6, U7, U8, U9, U10 = (np.uint64(offset) for offset in range(1, 11))


class Target(NamedTuple):
    """A training picture in padded planes, with the part of its SSIM that the drawn picture does not change."""

    image: np.ndarray  # (3, size) float32
    mean: np.ndarray  # (3, size) float32, µ_y
    variance: np.ndarray  # (3, size) float32, var_y

    @classmethod
    def of(cls, image: np.ndarray, planes: Planes) -> "Target":
        """Of an image (H, W, 3) float32."""
        return cls.zeros(planes).filled(image, planes)

    @classmethod
    def zeros(cls, planes: Planes) -> "Target":
        """Room for one."""
        return cls(planes.zeros(3), planes.zeros(3), planes.zeros(3))

    def filled(self, image: np.ndarray, planes: Planes) -> "Target":
        """Itself, of an image (H, W, 3) float32 of the same size."""
        measure(np.ascontiguousarray(image, np.float32), WINDOW[RADIUS:], planes.stride, *self)
        return self

    @property
    def nbytes(self) -> int:
        """Of memory."""
        return sum(part.nbytes for part in self)


class Local(NamedTuple):
    """What SSIM takes of the window around each pixel of one channel, or the derivatives by it."""

    mean: np.ndarray  # (size,) float32, µ
    square: np.ndarray  # (size,) float32, E
    product: np.ndarray  # (size,) float32, F


class Workspace(NamedTuple):
    """What the loss of pictures of one size works in."""

    planes: np.ndarray  # (8, size) float32
    mask: np.ndarray  # (size,) float32, 1 inside the picture and 0 around it
    stride: int  # from one row of a plane to the next
    pixels: int  # of the picture, padding not counted

    @classmethod
    def of(cls, planes: Planes) -> "Workspace":
        """For pictures in these planes."""
        mask = planes.zeros(1)[0]
        planes.inside(mask)[:] = 1
        return cls(planes.zeros(8), mask, planes.stride, planes.width * planes.height)


@compiled
def _blur_rows(a, out, n):
    for i in range(np.uint64(n)):
        out[i + U5] = (
            W0 * a[i + U5]
            + W1 * (a[i + U4] + a[i + U6])
            + W2 * (a[i + U3] + a[i + U7])
            + W3 * (a[i + U2] + a[i + U8])
            + W4 * (a[i + U1] + a[i + U9])
            + W5 * (a[i] + a[i + U10])
        )


@compiled
def _blur_columns(a, out, n, stride):
    s1 = np.uint64(stride)
    s2, s3, s4, s5 = s1 * U2, s1 * U3, s1 * U4, s1 * U5
    s6, s7, s8, s9, s10 = s1 * U6, s1 * U7, s1 * U8, s1 * U9, s1 * U10
    for i in range(np.uint64(n)):
        out[i + s5] = (
            W0 * a[i + s5]
            + W1 * (a[i + s4] + a[i + s6])
            + W2 * (a[i + s3] + a[i + s7])
            + W3 * (a[i + s2] + a[i + s8])
            + W4 * (a[i + s1] + a[i + s9])
            + W5 * (a[i] + a[i + s10])
        )


@compiled
def _multiply(a, b, out, n):
    for i in range(n):
        out[i] = a[i] * b[i]


@compiled
def _ssim(x, mean_y, var_y, mask, scale, by):
    """Sum of SSIM over the picture; writes `scale` times its derivatives by µ, E and F."""
    total = ZERO
    for i in range(mask.shape[0]):
        m, my, inside = x.mean[i], mean_y[i], mask[i]
        a1, a2 = TWO * m * my + C1, TWO * (x.product[i] - m * my) + C2
        b1 = ONE / (m * m + my * my + C1)
        b2 = ONE / (x.square[i] - m * m + var_y[i] + C2)
        both = b1 * b2
        value = a1 * a2 * both
        total += value * inside
        by_product = TWO * a1 * both
        by_square = -value * b2
        by_mean = TWO * my * a2 * both - TWO * m * value * b1 - my * by_product - TWO * m * by_square
        factor = scale * inside
        by.mean[i], by.square[i], by.product[i] = factor * by_mean, factor * TWO * by_square, factor * by_product
    return total


@compiled
def _gradient(x, y, by, step, out):
    """Writes the gradient of the whole loss; returns the sum of |x - y|."""
    total = ZERO
    for i in range(out.shape[0]):
        difference = x[i] - y[i]
        total += abs(difference)
        sign = step if difference > ZERO else (-step if difference < ZERO else ZERO)
        out[i] = by.mean[i] + x[i] * by.square[i] + y[i] * by.product[i] + sign
    return total


@compiled
def loss(image, target, weight, workspace, gradient):
    """The loss of image (3, size), a float; fills gradient (3, size). Both are padded planes; `weight` is λ."""
    work, mask, stride, pixels = workspace
    n = image.shape[1]
    flat, tall = n - 2 * RADIUS, n - 2 * RADIUS * stride
    inverse = ONE / F(3 * pixels)
    step = (ONE - weight) * inverse
    total = 0.0
    for c in range(3):
        x, y = image[c], target.image[c]
        _multiply(x, x, work[0], n)
        _multiply(x, y, work[1], n)
        _blur_rows(x, work[2], flat)
        _blur_rows(work[0], work[3], flat)
        _blur_rows(work[1], work[4], flat)
        _blur_columns(work[2], work[5], tall, stride)
        _blur_columns(work[3], work[6], tall, stride)
        _blur_columns(work[4], work[7], tall, stride)
        by = Local(work[0], work[1], work[2])
        local = Local(work[5], work[6], work[7])
        similarity = _ssim(local, target.mean[c], target.variance[c], mask, -weight * inverse, by)
        _blur_rows(work[0], work[3], flat)
        _blur_rows(work[1], work[4], flat)
        _blur_rows(work[2], work[5], flat)
        _blur_columns(work[3], work[0], tall, stride)
        _blur_columns(work[4], work[1], tall, stride)
        _blur_columns(work[5], work[2], tall, stride)
        absolute = _gradient(x, y, by, step, gradient[c])
        total += weight * inverse * (F(pixels) - similarity) + step * absolute
    return total
