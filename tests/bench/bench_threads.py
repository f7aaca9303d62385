"""Speed of the CPU splat backend on several threads, against one: a training step, and drawing and scoring views.

    python tests/bench/bench_threads.py [--threads N] [--quick]

Of 50,000 Gaussians at 512 x 512, in turn; N is the number of processors by default. Both must give the same bits.
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
from bench_splat import camera, cloud  # noqa: E402

from viewbench.backends.splat.backward import Moments, Rates  # noqa: E402
from viewbench.backends.splat.options import Rendering  # noqa: E402
from viewbench.backends.splat.team import Team  # noqa: E402
from viewbench.backends.splat.trainer import Trainer, Weights  # noqa: E402

GAUSSIANS, SIZE = 50_000, 512


def steps(threads: int, repeats: int) -> tuple[float, float]:
    """Median milliseconds of a step on one thread and on so many, in turn."""
    target = np.random.default_rng(1).uniform(0, 1, (SIZE, SIZE, 3)).astype(np.float32)
    trainers, states, times = [], [], ([], [])
    for team in (Team(1), Team(threads)):
        trainers.append(Trainer(GAUSSIANS, SIZE, SIZE, Rendering(0.05), team))
        gaussians = cloud(GAUSSIANS)
        states.append((gaussians, Moments.zeros(gaussians)))
    planes, rates = trainers[0].target(target), np.full(len(states[0][0]), 1e-4, np.float32)
    for number in range(1, repeats + 2):  # the first of each is not counted
        for trainer, (gaussians, moments), took in zip(trainers, states, times, strict=True):
            began = time.perf_counter()
            trainer.step(gaussians, moments, camera(SIZE), planes, Rates.of_step(number, rates), Weights(0.2))
            took.append(1e3 * (time.perf_counter() - began))
    if states[0][0].tobytes() != states[1][0].tobytes():
        raise SystemExit("several threads do not give the bits of one")
    return float(np.median(times[0][1:])), float(np.median(times[1][1:]))


def commands(threads: int, repeats: int) -> list[tuple[str, float, float]]:
    """Median seconds of what `train` and `evaluate` say they took, on one thread and on so many, in turn."""
    import json

    call = [sys.executable, "-m", "viewbench"]
    times = {name: ([], []) for name in ("train", "evaluate")}
    with tempfile.TemporaryDirectory() as folder:
        chosen = f"{folder}/selection.json"
        quiet = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        subprocess.run(
            [*call, "select", "room_human", "--selector", "uniform", "--count", "40", "--selection", chosen], **quiet
        )
        for _ in range(repeats):
            models = []
            for place, number in enumerate((1, threads)):
                model = f"{folder}/model{number}"
                more = ["--out", model, "--threads", str(number)]
                budget = ["--iterations", "150", "--set", f"gaussians={GAUSSIANS}", "--set", "coarse=0"]
                subprocess.run([*call, "train", "room_human", "--selection", chosen, *budget, *more], **quiet)
                subprocess.run([*call, "evaluate", model, "room_human", *more], **quiet)
                times["train"][place].append(json.loads(Path(model, "train.json").read_text())["seconds"])
                times["evaluate"][place].append(json.loads(Path(model, "metrics.json").read_text())["seconds"])
                models.append(Path(model, "model.ply").read_bytes())
            if models[0] != models[1]:
                raise SystemExit("several threads do not give the model of one")
    return [(name, float(np.median(one)), float(np.median(several))) for name, (one, several) in times.items()]


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    asked = parser.parse_args()
    n = asked.threads
    print(f"{n} threads against one, in turn; the last column is their ratio, of {n}")
    rows = [(f"step, {GAUSSIANS:,} at {SIZE}²", "ms", *steps(n, 5 if asked.quick else 21))]
    rows += [(f"{name}, room_human, 256²", "s", *both) for name, *both in commands(n, 1 if asked.quick else 3)]
    for name, unit, one, several in rows:
        print(f"{name:28} {one:8.2f} {unit:2} {several:8.2f} {unit:2} {one / several:6.2f}", flush=True)


if __name__ == "__main__":
    main()
