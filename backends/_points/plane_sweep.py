"""Depth by plane sweep (Collins 1996): where on its ray does a pixel look the same from the neighbouring views?

Planes parallel to the picture are tried at every depth in turn. The neighbours are warped by the plane's homography,
and patches are compared by zero-mean normalised cross-correlation (ZNCC), which does not mind exposure. The mean of
the two best neighbours counts, so that one of them may be occluded.

Everything lies in planes that are padded by zeros, so that the sums over patches, rows first and then columns, are two
flat loops that run as vectors. Single precision is enough, since greys are centred on 0. The arithmetic is exact in
the sense of `common/kernels.py`: the same depths on every machine.
"""

from typing import NamedTuple

import numpy as np

from ...common.kernels import exact

F = np.float32
ZERO, HALF, ONE = F(0), F(0.5), F(1)
PATCH = 2  # patches reach so many pixels to each side
FLAT = F(1e-4)  # added to variances: patches without texture, which match everywhere, do not match
LEAST_INSIDE = F(0.6 * (2 * PATCH + 1) ** 2)  # of a patch's pixels
NEAREST = F(1e-6)  # depth in the source, of the depth in the reference, of what is still before it
BENT = F(-1e-6)  # a parabola that is flatter has no top
# Unsigned offsets: with signed ones the compiler must allow for wrapping and gives up on vectors.
U1, U2, U3, U4 = (np.uint64(offset) for offset in range(1, 5))


class Work(NamedTuple):
    """What a sweep of pictures of one size works in: padded planes, size = (H + 4) · stride, and one row of a warp."""

    reference: np.ndarray  # (size,) float32, grey - 0.5
    warped: np.ndarray  # (3, size) float32: 1 where the source shows the pixel, and there reference and source
    sums: np.ndarray  # (6, size) float32, over a row's 5 pixels from here on, of 1, p, q, p², q² and pq
    best: np.ndarray  # (2, size) float32, of the plane: the two best correlations
    top: np.ndarray  # (5, size) float32, over planes: last score, best score, those before and after it, its plane
    corner: np.ndarray  # (W,) int32, of a row: where in the source the pixel's four neighbours begin
    share: np.ndarray  # (3, W) float32: how far between them it lies, right and down, and 1 where it is inside


@exact
def _place(h, y, z, width, height, corner, share):
    """Where row y of the plane at depth z lies in a source of the same size."""
    h00, h10, h20 = F(h[0, 0]), F(h[1, 0]), F(h[2, 0])
    b = y + 0.5
    h01 = F(h[0, 0] * 0.5 + h[0, 1] * b + h[0, 2] + h[0, 3] / z)
    h11 = F(h[1, 0] * 0.5 + h[1, 1] * b + h[1, 2] + h[1, 3] / z)
    h21 = F(h[2, 0] * 0.5 + h[2, 1] * b + h[2, 2] + h[2, 3] / z)
    right, low = F(width - 1), F(height - 1)
    stride = np.int32(width)
    for x in range(width):
        a = F(np.int32(x))
        w = h20 * a + h21
        inverse = ONE / w
        u, v = (h00 * a + h01) * inverse - HALF, (h10 * a + h11) * inverse - HALF
        inside = (w > NEAREST) & (u >= ZERO) & (v >= ZERO) & (u < right) & (v < low)
        u, v = u if inside else ZERO, v if inside else ZERO
        i, j = np.int32(u), np.int32(v)
        corner[x] = j * stride + i
        share[0, x], share[1, x], share[2, x] = u - F(i), v - F(j), ONE if inside else ZERO


@exact
def _warp(source, homography, depth, width, height, work):
    """The source, H · W greys and W + 2 zeros, as the reference view would see it, if everything lay at `depth`."""
    stride = width + 2 * PATCH
    w = np.uint64(width)
    corner, share = work.corner, work.share
    for y in range(height):
        _place(homography, y, depth, width, height, corner, share)
        start = (y + PATCH) * stride + PATCH
        mask, reference = work.warped[0, start : start + width], work.warped[1, start : start + width]
        grey, own = work.warped[2, start : start + width], work.reference[start : start + width]
        for x in range(width):
            k = np.uint64(corner[x])
            s = share[0, x]
            upper = source[k] + s * (source[k + U1] - source[k])
            lower = source[k + w] + s * (source[k + w + U1] - source[k + w])
            grey[x] = (upper + share[1, x] * (lower - upper)) * share[2, x]
        for x in range(width):
            mask[x] = share[2, x]
            reference[x] = own[x] * share[2, x]


@exact
def _sum_rows(warped, sums, n):
    m, p, q = warped[0], warped[1], warped[2]
    for i in range(np.uint64(n)):
        p0, p1, p2, p3, p4 = p[i], p[i + U1], p[i + U2], p[i + U3], p[i + U4]
        q0, q1, q2, q3, q4 = q[i], q[i + U1], q[i + U2], q[i + U3], q[i + U4]
        sums[0, i] = m[i] + m[i + U1] + m[i + U2] + m[i + U3] + m[i + U4]
        sums[1, i] = p0 + p1 + p2 + p3 + p4
        sums[2, i] = q0 + q1 + q2 + q3 + q4
        sums[3, i] = p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3 + p4 * p4
        sums[4, i] = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4
        sums[5, i] = p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3 + p4 * q4


@exact
def _correlate(warped, sums, best, second, n, stride):
    """Puts the patches' correlations among the two best so far; `best` and `second` begin with the first patch."""
    s1 = np.uint64(stride)
    s2, s3, s4 = s1 * U2, s1 * U3, s1 * U4
    c = s2 + U2  # of a patch, from its first pixel
    t0, t1, t2, t3, t4, t5 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    m = warped[0]
    for i in range(np.uint64(n)):
        count = t0[i] + t0[i + s1] + t0[i + s2] + t0[i + s3] + t0[i + s4]
        each = ONE / count
        p = (t1[i] + t1[i + s1] + t1[i + s2] + t1[i + s3] + t1[i + s4]) * each
        q = (t2[i] + t2[i + s1] + t2[i + s2] + t2[i + s3] + t2[i + s4]) * each
        pp = (t3[i] + t3[i + s1] + t3[i + s2] + t3[i + s3] + t3[i + s4]) * each - p * p
        qq = (t4[i] + t4[i + s1] + t4[i + s2] + t4[i + s3] + t4[i + s4]) * each - q * q
        pq = (t5[i] + t5[i + s1] + t5[i + s2] + t5[i + s3] + t5[i + s4]) * each - p * q
        pp, qq = (pp if pp > ZERO else ZERO) + FLAT, (qq if qq > ZERO else ZERO) + FLAT
        score = pq / np.sqrt(pp * qq)
        score = score if (m[i + c] > ZERO) & (count >= LEAST_INSIDE) else -ONE
        one, two = best[i], second[i]
        beaten = one if score > one else score
        best[i] = score if score > one else one
        second[i] = beaten if beaten > two else two


@exact
def _keep(best, second, single, plane, top):
    """The best plane so far, with the scores before and after it."""
    last, highest, before, after, which = top[0], top[1], top[2], top[3], top[4]
    for i in range(np.uint64(best.shape[0])):
        score = best[i] if single else HALF * (best[i] + second[i])
        after[i] = score if which[i] == plane - ONE else after[i]
        better = score > highest[i]
        before[i] = last[i] if better else before[i]
        which[i] = plane if better else which[i]
        highest[i] = score if better else highest[i]
        last[i] = score


@exact
def _sweep(sources, homographies, depths, step, work, depth, score):
    height, width = depth.shape
    stride = width + 2 * PATCH
    n = height * stride - 2 * PATCH  # patches of a plane, those across its edge counted
    last = F(len(depths) - 1)
    top = work.top
    top[:4] = -ONE
    top[4] = ZERO
    for k in range(len(depths)):
        work.best[:] = -ONE
        for s in range(len(sources)):
            _warp(sources[s], homographies[s], depths[k], width, height, work)
            _sum_rows(work.warped, work.sums, work.reference.shape[0] - 2 * PATCH)
            _correlate(work.warped, work.sums, work.best[0], work.best[1], n, stride)
        _keep(work.best[0], work.best[1], len(sources) == 1, F(k), top)
    for y in range(height):
        for x in range(width):
            i = y * stride + x
            highest, before, after, plane = top[1, i], top[2, i], top[3, i], top[4, i]
            bend = before - F(2) * highest + after
            at = 0.0
            if ZERO < plane < last and bend < BENT:
                at = 0.5 * float(before - after) / float(bend) * step
            # e^at, to 1e-9 for steps of up to 0.3, without a library that differs from one machine to the next.
            grown = 1 + at * (1 + at / 2 * (1 + at / 3 * (1 + at / 4 * (1 + at / 5 * (1 + at / 6)))))
            depth[y, x], score[y, x] = F(depths[int(plane)] * grown), highest


def sweep(
    reference: np.ndarray,
    sources: np.ndarray,
    homographies: np.ndarray,
    depths: np.ndarray,
    depth: np.ndarray,
    score: np.ndarray,
) -> None:
    """Fills depth and score (H, W) float32 of the reference picture (H, W) float32 in [0, 1].

    sources: (S, H, W) float32; homographies: (S, 3, 4), which take (x z, y z, z, 1), (x, y) a pixel of the reference
    and z its depth, to a source's homogeneous pixel; depths: (D,) float64 to be tried, evenly spaced in log z.
    Between two depths the best is found by a parabola. Where nothing could be compared the score is -1.
    """
    height, width = reference.shape
    padded = np.zeros((height + 2 * PATCH, width + 2 * PATCH), np.float32)
    padded[PATCH:-PATCH, PATCH:-PATCH] = reference - HALF
    size = padded.size
    work = Work(
        padded.ravel(),
        warped=np.zeros((3, size), np.float32),
        sums=np.zeros((6, size), np.float32),
        best=np.zeros((2, size), np.float32),
        top=np.zeros((5, size), np.float32),
        corner=np.zeros(width, np.int32),
        share=np.zeros((3, width), np.float32),
    )
    # Four neighbours are read of what lies outside too, and a picture of one pixel has none.
    flat = np.zeros((len(sources), height * width + width + 2), np.float32)
    flat[:, : height * width] = (sources - HALF).reshape(len(sources), -1)
    step = float(np.log(depths[-1] / depths[0])) / max(1, len(depths) - 1)
    _sweep(flat, homographies, depths, step, work, depth, score)
