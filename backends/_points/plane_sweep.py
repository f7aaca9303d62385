"""Depth by plane sweep (Collins 1996): where on its ray does a pixel look the same from the neighbouring views?

Planes parallel to the picture are tried at every depth in turn. The neighbours are warped by the plane's homography,
and patches are compared by zero-mean normalised cross-correlation (ZNCC), which does not mind exposure. The mean of
the two best neighbours counts, so that one of them may be occluded.
"""

import math

import numpy as np

from ...common.kernels import compiled

F = np.float32
ZERO, HALF, ONE = F(0), F(0.5), F(1)
PATCH = 2  # patches reach so many pixels to each side
FLAT = 1e-4  # added to variances: patches without texture, which match everywhere, do not match
LEAST_INSIDE = 0.6  # of a patch's pixels


@compiled
def _warp(source, homography, depth, warped, inside):
    """The source as the reference view would see it, if everything lay at `depth`."""
    height, width = warped.shape
    h = homography
    for y in range(height):
        for x in range(width):
            warped[y, x] = inside[y, x] = ZERO
            a, b = (x + 0.5) * depth, (y + 0.5) * depth
            w = h[2, 0] * a + h[2, 1] * b + h[2, 2] * depth + h[2, 3]
            if w <= 1e-9:
                continue
            u = (h[0, 0] * a + h[0, 1] * b + h[0, 2] * depth + h[0, 3]) / w - 0.5
            v = (h[1, 0] * a + h[1, 1] * b + h[1, 2] * depth + h[1, 3]) / w - 0.5
            if not (0 <= u < source.shape[1] - 1 and 0 <= v < source.shape[0] - 1):
                continue
            i, j = int(u), int(v)
            s, t = F(u - i), F(v - j)
            upper = source[j, i] + s * (source[j, i + 1] - source[j, i])
            lower = source[j + 1, i] + s * (source[j + 1, i + 1] - source[j + 1, i])
            warped[y, x] = upper + t * (lower - upper)
            inside[y, x] = ONE


@compiled
def _tables(reference, warped, inside, tables):
    """Summed-area tables (6, H + 1, W + 1) of 1, p, q, p², q² and pq over what is inside."""
    height, width = warped.shape
    for y in range(height):
        s0 = s1 = s2 = s3 = s4 = s5 = 0.0
        for x in range(width):
            q = warped[y, x]
            p = reference[y, x] * inside[y, x]
            s0 += inside[y, x]
            s1 += p
            s2 += q
            s3 += p * p
            s4 += q * q
            s5 += p * q
            tables[0, y + 1, x + 1] = tables[0, y, x + 1] + s0
            tables[1, y + 1, x + 1] = tables[1, y, x + 1] + s1
            tables[2, y + 1, x + 1] = tables[2, y, x + 1] + s2
            tables[3, y + 1, x + 1] = tables[3, y, x + 1] + s3
            tables[4, y + 1, x + 1] = tables[4, y, x + 1] + s4
            tables[5, y + 1, x + 1] = tables[5, y, x + 1] + s5


@compiled
def _correlate(tables, inside, best, second):
    """Puts the patches' correlations among the two best so far, (H, W) each."""
    height, width = inside.shape
    least = LEAST_INSIDE * (2 * PATCH + 1) ** 2
    means = np.empty(6)
    for y in range(height):
        y0, y1 = max(0, y - PATCH), min(height, y + PATCH + 1)
        for x in range(width):
            if inside[y, x] == ZERO:
                continue
            x0, x1 = max(0, x - PATCH), min(width, x + PATCH + 1)
            for k in range(6):
                means[k] = tables[k, y1, x1] - tables[k, y0, x1] - tables[k, y1, x0] + tables[k, y0, x0]
            if means[0] < least:
                continue
            for k in range(1, 6):
                means[k] /= means[0]
            p, q = means[1], means[2]
            var_p, var_q = max(means[3] - p * p, 0.0) + FLAT, max(means[4] - q * q, 0.0) + FLAT
            score = F((means[5] - p * q) / math.sqrt(var_p * var_q))
            if score > best[y, x]:
                second[y, x], best[y, x] = best[y, x], score
            elif score > second[y, x]:
                second[y, x] = score


@compiled
def sweep(reference, sources, homographies, depths, depth, score):
    """Fills depth and score (H, W) float32 of the reference picture (H, W) float32 in [0, 1].

    sources: (S, H, W) float32; homographies: (S, 3, 4), which take (x z, y z, z, 1), (x, y) a pixel of the reference
    and z its depth, to a source's homogeneous pixel; depths: (D,) float64 to be tried, evenly spaced in log z.
    Between two depths the best is found by a parabola. Where nothing could be compared the score is -1.
    """
    height, width = reference.shape
    count = len(depths)
    warped, inside = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    tables = np.zeros((6, height + 1, width + 1))
    best, second = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    volume = np.empty((count, height, width), np.float32)
    for k in range(count):
        best[:], second[:] = -ONE, -ONE
        for s in range(len(sources)):
            _warp(sources[s], homographies[s], depths[k], warped, inside)
            _tables(reference, warped, inside, tables)
            _correlate(tables, inside, best, second)
        for y in range(height):
            for x in range(width):
                volume[k, y, x] = best[y, x] if len(sources) == 1 else HALF * (best[y, x] + second[y, x])
    for y in range(height):
        for x in range(width):
            top = 0
            for k in range(count):
                if volume[k, y, x] > volume[top, y, x]:
                    top = k
            at = 0.0
            if 0 < top < count - 1:
                before, after = volume[top - 1, y, x], volume[top + 1, y, x]
                bend = before - 2 * volume[top, y, x] + after
                if bend < -1e-6:
                    at = 0.5 * (before - after) / bend * math.log(depths[top + 1] / depths[top])
            depth[y, x], score[y, x] = F(depths[top] * math.exp(at)), volume[top, y, x]
