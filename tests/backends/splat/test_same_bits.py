"""A training gives the same bits whatever the width of the processor's vectors and the number of threads."""

import hashlib
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from tests.backends.splat.test_kernels import camera, cloud
from viewbench.backends.splat.backward import Moments, Rates
from viewbench.backends.splat.options import Rendering
from viewbench.backends.splat.team import Team
from viewbench.backends.splat.trainer import Trainer, Weights


def trained(team=None, n=700, width=72, height=51, steps=6):
    """(parameters, losses, picture, gradient of a picture) after a few steps on two views."""
    rng = np.random.default_rng(0)
    g = cloud(n, rng)
    g[7:10, :5] += 3  # some that cover everything
    cameras = [camera(width, height, rng) for _ in range(2)]
    trainer = Trainer(n, width, height, Rendering(0.05, 0.2, 1, 0.1, True), team)
    targets = [trainer.target(rng.uniform(0, 1, (height, width, 3)).astype(np.float32)) for _ in cameras]
    moments, weights = Moments.zeros(g), Weights(0.2, 1e-3, 1e-3)
    losses = [
        trainer.step(g, moments, cameras[k % 2], targets[k % 2], Rates.of_step(k + 1, np.full(len(g), 1e-2)), weights)
        for k in range(steps)
    ]
    return g, np.array(losses), trainer.renderer.draw(g, cameras[0]).copy(), trainer.gradient.copy()


def digest():
    return hashlib.sha256(b"".join(part.tobytes() for part in trained())).hexdigest()


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_any_number_of_threads_gives_the_same_bits(threads):
    team = Team(threads)
    assert len(team.blocks(700)) > 1
    for alone, together in zip(trained(), trained(team), strict=True):
        np.testing.assert_array_equal(alone, together)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the features are those of x86 processors")
def test_any_width_of_vectors_gives_the_same_bits(tmp_path):
    """As on an older processor, of 8 lanes; where this one has no wider ones, it says nothing."""
    narrow = "+sse2,+sse3,+ssse3,+sse4.1,+sse4.2,+popcnt,+avx,+avx2,+fma,+bmi,+bmi2,+lzcnt,+f16c"
    code = "from tests.backends.splat.test_same_bits import digest; print(digest())"
    variables = {
        "NUMBA_CPU_NAME": "haswell",
        "NUMBA_CPU_FEATURES": narrow,
        "NUMBA_CACHE_DIR": str(tmp_path),
    }
    found = subprocess.check_output([sys.executable, "-c", code], text=True, env={**os.environ, **variables})
    assert found.split()[-1] == digest()


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 1000])
@pytest.mark.parametrize("threads", [1, 2, 7])
def test_ranges_cover_everything_once(count, threads):
    team = Team(threads)
    for ranges, multiple in ((team.blocks(count), 16), (team.blocks(count, 1), 1), (team.rows(count), 1)):
        covered = [i for first, last in ranges for i in range(first, last)]
        assert covered == list(range(count))
        assert all(first % multiple == 0 for first, _ in ranges)
    starts = np.cumsum(np.append(0, np.random.default_rng(count).integers(0, 9, count + 1)))
    assert [i for first, last in team.shares(starts) for i in range(first, last)] == list(range(count + 1))


def test_what_a_thread_raises_is_raised():
    def task(number):
        if number == 3:
            raise MemoryError(number)

    for threads in (1, 3):
        with pytest.raises(MemoryError):
            Team(threads).each(task, [(k,) for k in range(8)])
