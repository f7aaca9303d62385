"""Mean and variance of the loss's window around each pixel of a photograph: what SSIM takes of it, once and for all.

Double precision, in the order in which it is written: the variance is a small difference of large numbers, and a view
that does not fit into memory is computed anew, to the same bits, whenever it comes up.
"""

import numpy as np

from ...common.kernels import exact
from .planes import RADIUS

R = RADIUS
U1, U2, U3, U4, U5, U6, U7, U8, U9, U10 = (np.uint64(offset) for offset in range(1, 2 * RADIUS + 1))
F, D = np.float32, np.float64


@exact
def _columns(a, w, first, second, start, stride, length):
    """Windows along columns of a and a², for the row of the picture that begins at `start` of its plane."""
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    a0, a1, a2 = a[start - 5 * stride :], a[start - 4 * stride :], a[start - 3 * stride :]
    a3, a4, a5 = a[start - 2 * stride :], a[start - stride :], a[start:]
    a6, a7, a8 = a[start + stride :], a[start + 2 * stride :], a[start + 3 * stride :]
    a9, a10 = a[start + 4 * stride :], a[start + 5 * stride :]
    for i in range(length):
        p0, p1, p2, p3, p4 = D(a0[i]), D(a1[i]), D(a2[i]), D(a3[i]), D(a4[i])
        p5, p6, p7, p8, p9 = D(a5[i]), D(a6[i]), D(a7[i]), D(a8[i]), D(a9[i])
        p10 = D(a10[i])
        first[i] = w0 * p5 + w1 * (p4 + p6) + w2 * (p3 + p7) + w3 * (p2 + p8) + w4 * (p1 + p9) + w5 * (p0 + p10)
        second[i] = (
            w0 * (p5 * p5)
            + w1 * (p4 * p4 + p6 * p6)
            + w2 * (p3 * p3 + p7 * p7)
            + w3 * (p2 * p2 + p8 * p8)
            + w4 * (p1 * p1 + p9 * p9)
            + w5 * (p0 * p0 + p10 * p10)
        )


@exact
def _row(a, w, out, width):
    w0, w1, w2, w3, w4, w5 = w[0], w[1], w[2], w[3], w[4], w[5]
    for i in range(np.uint64(width)):
        out[i] = (
            w0 * a[i + U5]
            + w1 * (a[i + U4] + a[i + U6])
            + w2 * (a[i + U3] + a[i + U7])
            + w3 * (a[i + U2] + a[i + U8])
            + w4 * (a[i + U1] + a[i + U9])
            + w5 * (a[i] + a[i + U10])
        )


@exact
def measure(image, window, stride, planes, mean, variance):
    """Fills padded planes (3, size) float32 with an image (H, W, 3) float32, its windows' means and variances.

    window: (6,) float64, from its middle outwards; `planes` and the others are zero around the picture.
    """
    height, width = image.shape[0], image.shape[1]
    first, second = np.zeros(width + 2 * R), np.zeros(width + 2 * R)
    means, squares = np.zeros(width), np.zeros(width)
    for c in range(3):
        for y in range(height):
            row = planes[c, (y + R) * stride + R :]
            for x in range(width):
                row[x] = image[y, x, c]
    for c in range(3):
        for y in range(height):
            start = (y + R) * stride + R
            _columns(planes[c], window, first[R:], second[R:], start, stride, width)
            _row(first, window, means, width)
            _row(second, window, squares, width)
            to_mean, to_variance = mean[c, start:], variance[c, start:]
            for x in range(width):
                to_mean[x] = F(means[x])
                to_variance[x] = F(squares[x] - means[x] * means[x])
