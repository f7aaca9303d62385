"""The CPU backend of this checkout beside that of another one: whole trainings, in turn, on one thread.

    python tests/bench/bench_against.py OTHER [--rounds 3] [--iterations 1000] [--cases room_human:128:80,...]

OTHER is a clone of viewbench at an earlier commit in which `make setup` has run. Both train with their own defaults on
every n-th view of a scene, one after the other, and the figures are ratios of one round's two trainings, their median
and range. `early` and `late` are a step in the first tenth and in the last fifth of a training, when the pictures have
their full size and the model is trained; `whole` is the command from start to end. `dB` are test views, with the same
number of steps; --seconds gives both the same time instead.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[2]
CASES = "room_human:128:80,room_human:256:80,hololens_space:180:65"
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def command(checkout: Path, *arguments: str) -> str:
    """Runs its `viewbench` and returns what that printed."""
    call = [str(checkout / ".venv" / "bin" / "viewbench"), *arguments]
    done = subprocess.run(call, cwd=checkout, env={**os.environ, **THREADS}, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(call)}: {done.stderr[-300:]}")
    return done.stdout


def run(checkout: Path, case: tuple[str, int, int], budget: list[str], seed: int, score: bool) -> dict[str, float]:
    """Milliseconds of a step, early and late, seconds of the command, and test PSNR in dB, of one training."""
    scene, width, count = case
    with tempfile.TemporaryDirectory() as folder:
        chosen, model = f"{folder}/selection.json", f"{folder}/model"
        command(checkout, "select", scene, "--selector", "uniform", "--count", str(count), "--selection", chosen)
        began = time.perf_counter()
        asked = ["--selection", chosen, "--out", model, "--width", str(width), "--seed", str(seed)]
        command(checkout, "train", scene, *asked, *budget)
        whole = time.perf_counter() - began
        record = json.loads(Path(model, "train.json").read_text())
        if score:
            command(checkout, "evaluate", model, scene, "--out", model)
        psnr = json.loads(Path(model, "metrics.json").read_text())["psnr_db"] if score else np.nan
    curve = record["curve"]
    last, before = curve[-1], curve[-3]
    return {
        "early": 1e3 * curve[0]["seconds"] / curve[0]["step"],
        "late": 1e3 * (last["seconds"] - before["seconds"]) / (last["step"] - before["step"]),
        "steps": record["iterations"],
        "training": record["seconds"],
        "whole": whole,
        "dB": psnr,
    }


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("other", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--seconds", type=float, help="budget of both, instead of iterations")
    parser.add_argument("--cases", default=CASES, help="SCENE:WIDTH:VIEWS,...")
    parser.add_argument(
        "--warm", type=int, default=1, help="rounds before, which compile and read what is cached later"
    )
    asked = parser.parse_args()
    budget = ["--seconds", str(asked.seconds)] if asked.seconds else ["--iterations", str(asked.iterations)]
    other = asked.other.resolve()
    names = "early", "late", "training", "whole"
    print(f"this checkout / {other.name}, {' '.join(budget)[2:]}: median of {asked.rounds} ratios (range)")
    print(
        f"{'scene':>15} {'width':>5} {'views':>5} "
        + " ".join(f"{name:>19}" for name in names)
        + "  late ms   steps       dB"
    )
    for text in asked.cases.split(","):
        scene, width, count = text.split(":")
        case = scene, int(width), int(count)
        rows: tuple[list, list] = ([], [])
        for number in range(-asked.warm, asked.rounds):
            for checkout, row in zip((HERE, other), rows, strict=True):
                found = run(checkout, case, budget, max(number, 0), asked.seconds is not None or number == 0)
                if number >= 0:
                    row.append(found)
        ours, theirs = rows
        line = f"{scene:>15} {width:>5} {count:>5} "
        for name in names:
            ratios = [a[name] / b[name] for a, b in zip(ours, theirs, strict=True)]
            line += f" {np.median(ratios):6.3f} ({min(ratios):.3f}-{max(ratios):.3f})"
        for name, form in (("late", "5.2f"), ("steps", "5.0f"), ("dB", "5.2f")):
            both = [np.nanmean([item[name] for item in side]) for side in (ours, theirs)]
            line += f"  {both[0]:{form}}|{both[1]:{form}}"
        print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
