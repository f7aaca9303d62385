"""Speed of the CPU splat backend on one thread: a full training step beside the same step in plain torch.

    python tests/bench/bench_splat.py [--quick]

Both do the same work on the same Gaussians, one step after the other in turn, and the median counts. The step is
projection, binning, rasterisation, L1 + SSIM, the gradients of all that, and Adam.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from viewbench.backends.splat import layout  # noqa: E402
from viewbench.backends.splat.backward import Moments, Rates  # noqa: E402
from viewbench.backends.splat.options import Rendering  # noqa: E402
from viewbench.backends.splat.trainer import Trainer, Weights  # noqa: E402

COUNTS, SIZES = (2_000, 10_000, 50_000, 200_000), (96, 128, 256, 512)


def cloud(n: int) -> np.ndarray:
    """Gaussians that fill a cube about evenly, as large as their spacing."""
    rng = np.random.default_rng(0)
    g = layout.empty(n, 1)
    g[0:3] = rng.uniform(-1, 1, (3, n))
    g[3:7] = rng.normal(size=(4, n))
    g[7:10] = np.log(0.9 / np.cbrt(n)) + 0.4 * rng.normal(size=(3, n))
    g[10] = 1.5 * rng.normal(size=n)
    g[11:14] = rng.normal(size=(3, n))
    g[14:23] = 0.2 * rng.normal(size=(9, n))
    return g


def camera(size: int) -> np.ndarray:
    """In front of the cube, a little turned."""
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    shift = np.array([0.1, -0.05, 3.2])
    inner = [1.2 * size, 1.2 * size, size / 2 + 1.3, size / 2 - 0.7]
    return np.array([*turn.reshape(-1), *shift, *inner, *(-turn.T @ shift), size, size], np.float32)


def measure(n: int, size: int, repeats: int) -> tuple[float, float, int]:
    """Median seconds of our step and of torch's, interleaved, and the pairs of splats and tiles."""
    import torch
    from torch_splat import TorchStep

    torch.set_num_threads(1)
    gaussians, cam = cloud(n), camera(size)
    target = np.random.default_rng(1).uniform(0, 1, (size, size, 3)).astype(np.float32)
    rates = np.full(len(gaussians), 1e-5, np.float32)
    trainer = Trainer(n, size, size, Rendering(0.05))
    planes, moments = trainer.target(target), Moments.zeros(gaussians)
    torch_step = TorchStep(gaussians, rates)
    torch_target = torch.tensor(target.transpose(2, 0, 1).copy())
    ours, theirs = [], []
    for number in range(1, repeats + 2):  # the first of each is not counted
        began = time.perf_counter()
        loss = trainer.step(gaussians, moments, cam, planes, Rates.of_step(number, rates), Weights(0.2))
        middle = time.perf_counter()
        other = torch_step(cam, torch_target)
        ours.append(middle - began)
        theirs.append(time.perf_counter() - middle)
        if number == 1 and abs(loss - other) > 2e-3:
            raise SystemExit(f"the two steps do not agree: loss {loss} and {other}")
    return float(np.median(ours[1:])), float(np.median(theirs[1:])), trainer.renderer.pairs


def cold_start() -> tuple[float, float]:
    """Seconds from starting Python to the end of the first step: compiling everything, and from the cache."""
    code = "from viewbench.backends import splat; splat.warm()"
    times = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "NUMBA_CACHE_DIR": folder})
            times.append(time.perf_counter() - began)
    return times[0], times[1]


def peak_memory(n: int, size: int) -> float:
    """Peak resident bytes of a process that does three steps."""
    code = f"""
import sys; sys.path.insert(0, {str(Path(__file__).resolve().parent)!r})
import numpy as np, bench_splat as b
g = b.cloud({n}); t = b.Trainer({n}, {size}, {size}, b.Rendering(0.05)); m = b.Moments.zeros(g)
p = t.target(np.zeros(({size}, {size}, 3), np.float32)); r = np.full(len(g), 1e-5, np.float32)
for k in range(1, 4): t.step(g, m, b.camera({size}), p, b.Rates.of_step(k, r), b.Weights(0.2))
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""
    # Not getrusage: what it says of a new process includes that of the process that started it.
    return 1024 * float(subprocess.check_output([sys.executable, "-c", code], text=True))


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer sizes and repeats, about a minute")
    quick = parser.parse_args().quick
    counts, sizes = ((2_000, 10_000), (96, 128)) if quick else (COUNTS, SIZES)
    print("One training step on one thread: viewbench | plain torch | ratio")
    print(f"{'Gaussians':>9} {'picture':>8} {'pairs':>9} {'ms':>9} {'torch ms':>9} {'ratio':>6} {'ns a pair':>9}")
    for n in counts:
        for size in sizes:
            repeats = 5 if quick else (7 if n * size * size < 5e9 else 3)
            ours, theirs, pairs = measure(n, size, repeats)
            each = 1e9 * ours / max(pairs, 1)
            ms = f"{1e3 * ours:9.2f} {1e3 * theirs:9.0f}"
            print(f"{n:9,} {size:5}² {pairs:11,} {ms} {theirs / ours:6.0f} {each:9.0f}", flush=True)
    first, second = cold_start()
    print(
        f"cold start: {first:.1f} s with compiling, {second:.2f} s from the cache (import to the end of a first step)"
    )
    print(f"peak memory at 200,000 Gaussians and 512²: {peak_memory(200_000, 512) / 2**20:.0f} MiB")


if __name__ == "__main__":
    main()
