"""The training loss of 3DGS, (1 - λ) L1 + λ (1 - SSIM), and its gradient with respect to the picture.

SSIM as Wang et al. 2004: 11 x 11 Gaussian window with σ = 1.5, zero beyond the picture, C₁ = 0.01², C₂ = 0.03². The
window is separable; images lie in planes padded by 5 zeros on each side, which are gone through row by row, so that
what the window needs of the last 11 rows stays in the cache.
With µ, E = blur(x²) and F = blur(xy), SSIM = A₁A₂ / (B₁B₂), A₁ = 2µµ_y + C₁, A₂ = 2(F - µµ_y) + C₂,
B₁ = µ² + µ_y² + C₁, B₂ = E - µ² + var_y + C₂, and ∂/∂x = blur(∂/∂µ) + 2x blur(∂/∂E) + y blur(∂/∂F).
"""

from typing import NamedTuple

import numpy as np

from ...common.kernels import exact, written
from ...common.lanes import fma, load, magnitude, shifted, spread, store, where
from .kernels import ONE, TWO, ZERO, F
from .planes import RADIUS, Planes
from .windows import measure

C1, C2 = F(1e-4), F(9e-4)
_window = np.exp(-(np.arange(-RADIUS, RADIUS + 1) ** 2) / (2 * 1.5**2))
WINDOW = _window / _window.sum()
W0, W1, W2, W3, W4, W5 = (F(WINDOW[RADIUS + offset]) for offset in range(6))
LINES = 32  # rows that the window has gone along are kept, the last 10 of which it goes down


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
    """What SSIM takes of the window around each pixel, or the derivatives by it."""

    mean: np.ndarray  # (3, size) float32, µ
    square: np.ndarray  # (3, size) float32, E
    product: np.ndarray  # (3, size) float32, F


class Workspace(NamedTuple):
    """What the loss of pictures of one size works in."""

    by: Local
    similarity: np.ndarray  # (3, H, 16) float32: of each row, SSIM summed up sixteen times
    absolute: np.ndarray  # (3, H, 16) float32: the same of |x - y|
    mask: np.ndarray  # (stride,) float32, 1 in the columns of the picture and 0 beside it
    height: int  # pixels
    pixels: int

    @classmethod
    def of(cls, planes: Planes) -> "Workspace":
        """For pictures in these planes."""
        mask = np.zeros(planes.stride, np.float32)
        mask[RADIUS : RADIUS + planes.width] = 1
        rows = np.zeros((2, 3, planes.height, 16), np.float32)
        return cls(
            Local(planes.zeros(3), planes.zeros(3), planes.zeros(3)),
            rows[0],
            rows[1],
            mask,
            planes.height,
            planes.width * planes.height,
        )


@written
def _across(before, here, behind):
    """The window along a row, of 16 pixels and the 16 to each side."""
    total = W0 * here
    total = fma(W1, shifted(before, here, 15) + shifted(here, behind, 1), total)
    total = fma(W2, shifted(before, here, 14) + shifted(here, behind, 2), total)
    total = fma(W3, shifted(before, here, 13) + shifted(here, behind, 3), total)
    total = fma(W4, shifted(before, here, 12) + shifted(here, behind, 4), total)
    return fma(W5, shifted(before, here, 11) + shifted(here, behind, 5), total)


@written
def _down(lines, at, stride):
    """The window along a column: `at` is where in `lines` the 16 pixels lie of its uppermost row."""
    total = W0 * load(lines, at + 5 * stride)
    total = fma(W1, load(lines, at + 4 * stride) + load(lines, at + 6 * stride), total)
    total = fma(W2, load(lines, at + 3 * stride) + load(lines, at + 7 * stride), total)
    total = fma(W3, load(lines, at + 2 * stride) + load(lines, at + 8 * stride), total)
    total = fma(W4, load(lines, at + stride) + load(lines, at + 9 * stride), total)
    return fma(W5, load(lines, at) + load(lines, at + 10 * stride), total)


@written
def _next(slot, lines, stride):
    """Where among `lines` the next row goes; behind the last place the rows that are still needed move to the front."""
    if slot < LINES:
        return slot
    for kind in range(0, 3 * LINES * stride, LINES * stride):
        for at in range(kind, kind + 2 * RADIUS * stride, 16):
            store(lines, at, load(lines, at + (LINES - 2 * RADIUS) * stride))
    return 2 * RADIUS


@written
def _keep(lines, at, kind, before, here, behind):
    """Goes along a row with three planes' windows, `kind` apart in `lines`; of each 16 pixels and those beside them."""
    store(lines, at, _across(before[0], here[0], behind[0]))
    store(lines, kind + at, _across(before[1], here[1], behind[1]))
    store(lines, 2 * kind + at, _across(before[2], here[2], behind[2]))


@written
def _moments(x, y, at):
    """What SSIM takes the window of, of 16 pixels: x, x² and xy."""
    here = load(x, at)
    return here, here * here, here * load(y, at)


@written
def _of_each(a, b, c, at):
    """16 pixels of three planes."""
    return load(a, at), load(b, at), load(c, at)


@exact
def compare(image, target, weight, workspace, first, last):
    """Fills the derivatives and sums of SSIM of rows `first` to `last` of the picture, image (3, size)."""
    stride = workspace.mask.shape[0]
    scale = -weight / F(3 * workspace.pixels)
    kind, zero = LINES * stride, spread(ZERO)
    lines, nothing = np.empty(3 * kind, np.float32), (zero, zero, zero)
    for c in range(3):
        x, y, mean_y, var_y = image[c], target.image[c], target.mean[c], target.variance[c]
        by_mean, by_square, by_product = workspace.by.mean[c], workspace.by.square[c], workspace.by.product[c]
        slot = 0
        for line in range(first, last + 2 * RADIUS):
            slot = _next(slot, lines, stride)
            own, plane = slot * stride, line * stride
            slot += 1
            before, here = nothing, _moments(x, y, plane)
            for at in range(0, stride, 16):
                behind = _moments(x, y, plane + at + 16) if at + 16 < stride else nothing
                _keep(lines, own + at, kind, before, here, behind)
                before, here = here, behind
            row = line - 2 * RADIUS
            if row < first:
                continue
            own, plane = own - 2 * RADIUS * stride, (row + RADIUS) * stride
            total = zero
            for at in range(0, stride, 16):
                inside = load(workspace.mask, at)
                m, square = _down(lines, own + at, stride), _down(lines, kind + own + at, stride)
                product = _down(lines, 2 * kind + own + at, stride)
                my = load(mean_y, plane + at)
                both_means = m * my
                a1, a2 = fma(TWO, both_means, C1), fma(TWO, product - both_means, C2)
                b1 = fma(m, m, fma(my, my, C1))
                b2 = square - m * m + load(var_y, plane + at) + C2
                both = ONE / (b1 * b2)
                value = a1 * a2 * both
                total = fma(value, inside, total)
                by_f = TWO * a1 * both
                by_e = -(value * b1 * both)
                by_m = TWO * fma(my, a2 * both, -(m * fma(value, b2 * both, by_e))) - my * by_f
                factor = scale * inside
                store(by_mean, plane + at, factor * by_m)
                store(by_square, plane + at, factor * TWO * by_e)
                store(by_product, plane + at, factor * by_f)
            store(workspace.similarity[c, row], 0, total)


@exact
def descend(image, target, weight, workspace, gradient, first, last):
    """Fills rows `first` to `last` of the gradient (3, size) of the whole loss, and the sums of |x - y|."""
    stride = workspace.mask.shape[0]
    step = (ONE - weight) / F(3 * workspace.pixels)
    kind, zero = LINES * stride, spread(ZERO)
    lines, nothing = np.empty(3 * kind, np.float32), (zero, zero, zero)
    for c in range(3):
        x, y, out = image[c], target.image[c], gradient[c]
        by_mean, by_square, by_product = workspace.by.mean[c], workspace.by.square[c], workspace.by.product[c]
        slot = 0
        for line in range(first, last + 2 * RADIUS):
            slot = _next(slot, lines, stride)
            own, plane = slot * stride, line * stride
            slot += 1
            before, here = nothing, _of_each(by_mean, by_square, by_product, plane)
            for at in range(0, stride, 16):
                then = plane + at + 16
                behind = _of_each(by_mean, by_square, by_product, then) if at + 16 < stride else nothing
                _keep(lines, own + at, kind, before, here, behind)
                before, here = here, behind
            row = line - 2 * RADIUS
            if row < first:
                continue
            own, plane = own - 2 * RADIUS * stride, (row + RADIUS) * stride
            total = zero
            for at in range(0, stride, 16):
                drawn, there = load(x, plane + at), load(y, plane + at)
                difference = drawn - there
                total = total + magnitude(difference)
                sign = where(difference > ZERO, spread(step), where(difference < ZERO, spread(-step), zero))
                value = fma(drawn, _down(lines, kind + own + at, stride), _down(lines, own + at, stride))
                value = fma(there, _down(lines, 2 * kind + own + at, stride), value)
                store(out, plane + at, (value + sign) * load(workspace.mask, at))
            store(workspace.absolute[c, row], 0, total)


def loss(workspace: Workspace, weight: float) -> float:
    """The loss of the picture that both kernels have gone through; `weight` is λ."""
    similarity, absolute = workspace.similarity.sum(dtype=np.float64), workspace.absolute.sum(dtype=np.float64)
    count = 3 * workspace.pixels
    return float(weight * (1 - similarity / count) + (1 - weight) * absolute / count)
