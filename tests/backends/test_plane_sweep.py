"""The sweep's kernels against the definition, pixel by pixel in double precision."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from viewbench.backends._points.agreement import agreeing
from viewbench.backends._points.plane_sweep import FLAT, LEAST_INSIDE, PATCH, sweep


def warped(source, h, z, y, x):
    """Grey of the source where the reference's pixel lies at depth z; None where the source does not show it."""
    height, width = source.shape
    u, v, w = h[:, :3] @ [(x + 0.5) * z, (y + 0.5) * z, z] + h[:, 3]
    if w <= 1e-6 * z:
        return None
    u, v = u / w - 0.5, v / w - 0.5
    if not (0 <= u < width - 1 and 0 <= v < height - 1):
        return None
    i, j = int(u), int(v)
    s, t = u - i, v - j
    upper = (1 - s) * source[j, i] + s * source[j, i + 1]
    lower = (1 - s) * source[j + 1, i] + s * source[j + 1, i + 1]
    return (1 - t) * upper + t * lower


def correlation(reference, grey, y, x):
    """ZNCC of the patches around a pixel, over the pixels that the source shows."""
    if grey[y][x] is None:
        return -1.0
    height, width = reference.shape
    pairs = [
        (reference[b, a], grey[b][a])
        for b in range(max(0, y - PATCH), min(height, y + PATCH + 1))
        for a in range(max(0, x - PATCH), min(width, x + PATCH + 1))
        if grey[b][a] is not None
    ]
    if len(pairs) < LEAST_INSIDE:
        return -1.0
    p, q = np.array(pairs).T
    return np.mean((p - p.mean()) * (q - q.mean())) / math.sqrt((p.var() + FLAT) * (q.var() + FLAT))


def slow_sweep(reference, sources, homographies, depths):
    """Depth and score (H, W) in double precision."""
    height, width = reference.shape
    volume = np.empty((len(depths), height, width))
    for k, z in enumerate(depths):
        greys = [
            [[warped(source, h, z, y, x) for x in range(width)] for y in range(height)]
            for source, h in zip(sources, homographies, strict=True)
        ]
        for y in range(height):
            for x in range(width):
                scores = sorted((correlation(reference, grey, y, x) for grey in greys), reverse=True)
                volume[k, y, x] = np.mean(scores[:2])
    top = volume.argmax(axis=0)
    depth, score = depths[top], volume.max(axis=0)
    for y, x in np.argwhere((top > 0) & (top < len(depths) - 1)):
        before, best, after = volume[top[y, x] - 1 : top[y, x] + 2, y, x]
        bend = before - 2 * best + after
        if bend < -1e-6:
            depth[y, x] *= (depths[1] / depths[0]) ** (0.5 * (before - after) / bend)
    return depth, score


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (2, 1), (3, 2)])
def test_it_is_the_definition(count, seed):
    """Cameras that moved and turned, one of them so far that planes lie behind it."""
    rng = np.random.default_rng(seed)
    height, width = 14, 18
    reference = rng.uniform(0, 1, (height, width)).astype(np.float32)
    sources = rng.uniform(0, 1, (count, height, width)).astype(np.float32)
    sources[0] = np.roll(reference, 1, axis=1)
    homographies = np.zeros((count, 3, 4))
    homographies[:, :, :3] = np.eye(3) + rng.normal(size=(count, 3, 3)) * [[0.05, 0.05, 1], [0.05, 0.05, 1], [2e-3] * 3]
    homographies[:, :, 3] = rng.normal(size=(count, 3)) * [6, 6, 0.2]
    homographies[0] = np.eye(3, 4)
    homographies[0, :2, 3] = 2.0317, 0.1713  # nowhere on the edge of a pixel, where rounding decides
    homographies[-1, 2, 3] -= 1.2  # behind the nearest planes
    depths = np.geomspace(0.5, 6, 7)
    depth, score = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    sweep(reference, sources, homographies, depths, depth, score)
    slow_depth, slow_score = slow_sweep(
        reference.astype(np.float64), sources.astype(np.float64), homographies.astype(np.float64), depths
    )
    assert (slow_score > -1).mean() > 0.5
    assert (slow_score == -1).any() or count > 1
    np.testing.assert_allclose(score, slow_score, atol=1e-4)
    close = np.isclose(depth, slow_depth, rtol=1e-3)
    assert close.mean() > 0.99, "but for two planes that are equally good"


def test_pictures_of_any_size_and_any_number_of_depths():
    rng = np.random.default_rng(0)
    for height, width, planes in ((1, 1, 1), (2, 9, 2), (9, 2, 3), (5, 64, 48)):
        reference = rng.uniform(0, 1, (height, width)).astype(np.float32)
        depth, score = np.zeros_like(reference), np.zeros_like(reference)
        depths = np.geomspace(1, 1 + planes, planes)
        sweep(reference, reference[None], np.eye(3, 4)[None], depths, depth, score)
        assert np.isfinite(depth).all()
        assert ((depth >= 1) & (depth <= depths[-1])).all()
        assert ((score >= -1) & (score <= 1 + 1e-5)).all()


def test_exposure_does_not_matter():
    rng = np.random.default_rng(1)
    reference = rng.uniform(0.2, 0.8, (24, 24)).astype(np.float32)
    source = (0.5 * np.roll(reference, 2, axis=1) + 0.3).astype(np.float32)
    h = np.eye(3, 4)[None].copy()
    h[0, 0, 3] = 4.0  # two pixels to the right at depth 2
    depth, score = np.zeros_like(reference), np.zeros_like(reference)
    sweep(reference, source[None], h, np.array([1.0, 2.0, 4.0]), depth, score)
    inner = np.s_[3:-3, 3:-6]
    assert (np.abs(depth[inner] - 2) < 0.7).mean() > 0.95
    assert np.median(score[inner]) > 0.95


def test_witnesses_are_counted_where_they_found_the_same_depth():
    """Three cameras in one place that look the same way: one found the depth, one another, one looks back."""
    projection = np.array([[10.0, 0, 8, 0], [0, 10.0, 8, 0], [0, 0, 1, 0]])
    w2c = np.tile(np.eye(4), (3, 1, 1))
    w2c[2, 2, 2] = -1
    depth = np.full((3, 16, 16), 2.0, np.float32)
    depth[1] = 3.0
    points = np.array([[0, 0, 2.0], [0.5, -0.5, 2.05], [0, 0, 2.3], [9.0, 0, 2.0], [0, 0, 0.0], [np.nan, 0, 1]])
    count = np.zeros(len(points), np.int64)
    agreeing(points, np.arange(3), np.tile(projection, (3, 1, 1)), w2c, depth, 0.06, count)
    assert count.tolist() == [1, 1, 0, 0, 0, 0]


BITS = """
import hashlib
import numpy as np
from viewbench.backends._points.agreement import agreeing
from viewbench.backends._points.plane_sweep import sweep
from viewbench.backends.splat.loss import Target
from viewbench.backends.splat.planes import Planes
rng = np.random.default_rng(0)
views = rng.uniform(0, 1, (4, 33, 47)).astype(np.float32)
depth, score = np.zeros((1, 33, 47), np.float32), np.zeros((33, 47), np.float32)
h = np.eye(3, 4) + rng.normal(size=(3, 3, 4)) * [[[1e-2], [1e-2], [1e-4]]]
sweep(views[0], views[1:], h, np.geomspace(0.5, 8, 48), depth[0], score)
count = np.zeros(500, np.int64)
points = rng.uniform(0, 20, (500, 3))
agreeing(points, np.zeros(1, np.int64), h[:1], np.eye(4)[None], depth, 0.5, count)
made = [depth, score, count, *Target.of(rng.uniform(0, 1, (33, 47, 3)).astype(np.float32), Planes(47, 33))]
print(hashlib.sha256(b"".join(array.tobytes() for array in made)).hexdigest(), int(count.sum() > 0))
"""


def test_another_processor_finds_the_same_bits(tmp_path):
    """One without vectors of this one's width, and without fused multiplications."""
    found = set()
    for variables in ({}, {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / str(len(variables))), **variables}
        found.add(subprocess.check_output([sys.executable, "-c", BITS], text=True, env=environment))
    assert len(found) == 1
    assert found.pop().endswith(" 1\n")
