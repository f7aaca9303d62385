"""What large pictures and many views cost the CPU splat backend: seconds to 25 dB by size, and memory by views.

    python tests/bench/bench_size.py [--only seconds,memory] [--decibels 25] [--most 64] [--views 100,1000]

Seconds: a run for each budget, twice the one before, until the mean PSNR of the test views is reached; between two
budgets, linear in the logarithm of the seconds. Half of a scene's training views, evenly chosen. Memory: the peak of a
process that trains 200,000 Gaussians for some steps on so many views at 512 x 512, each a file of its own.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))

from bench_quality import measure, options, views  # noqa: E402

from viewbench.backends import splat  # noqa: E402
from viewbench.common.errors import UserError  # noqa: E402
from viewbench.scenes.ply import write_points  # noqa: E402
from viewbench.scenes.types import Points  # noqa: E402

SIZES = (
    *(("room_human", width, 0.5) for width in (64, 128, 256)),  # its pictures are 256 x 256
    *(("real_room", width, 1.0) for width in (240, 480, 960)),
)
SHORTEST = 1.0  # seconds
SIDE, STEPS, TEST_VIEWS = 512, 40, 8
GAUSSIANS = POINTS = 200_000


def seconds_to(decibels: float, scene: str, width: int, share: float, most: float) -> str:
    """A row of the table: seconds, or how far it came."""
    data, truth, cameras = views(scene, width, share, None)
    size = f"{scene:12} {len(data.names):5} {data.images.shape[2]:4} x {data.images.shape[1]:<4}"
    seconds, last = SHORTEST, None
    while seconds <= most:
        score, steps, *_, before = measure(data, truth, cameras, seconds, 0, options(""))
        if score >= decibels:
            if last is not None:
                seconds *= 2 ** -((score - decibels) / (score - last))
            return f"{size} {seconds:8.1f} {steps:8} {before:8.1f}"
        last, seconds = score, 2 * seconds
    return f"{size}    never {steps:8} {before:8.1f}   {last:.1f} dB after {seconds / 2:g} s"


def capture(folder: Path, count: int) -> None:
    """A Blender-form scene of a synthetic room: a circle of views, whose pictures are soft noise of their own."""
    rng = np.random.default_rng(0)
    for split, number in (("train", count), ("test", TEST_VIEWS)):
        (folder / split).mkdir(parents=True)
        frames = []
        for i in range(number):
            angle = 2 * math.pi * (i + 0.5 * (split == "test")) / number
            c, s = math.cos(angle), math.sin(angle)
            pose = [[-s, 0, c, 2 * c], [0, 1, 0, 0], [-c, 0, -s, -2 * s], [0, 0, 0, 1]]
            noise = Image.fromarray(rng.integers(0, 256, (32, 32, 3), dtype=np.uint8))
            noise.resize((SIDE, SIDE), Image.Resampling.BICUBIC).save(folder / split / f"{i:04d}.jpg")
            frames.append({"file_path": f"{split}/{i:04d}.jpg", "transform_matrix": pose})
        table = {"camera_angle_x": 1.2, "w": SIDE, "h": SIDE, "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(table), encoding="utf-8")
    xyz = rng.uniform(-3, 3, (POINTS, 3))
    write_points(folder / "points3d.ply", Points(xyz, rng.integers(0, 256, (POINTS, 3)).astype(np.uint8)))


def memory(count: int) -> str:
    """A row of the table."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        capture(folder / "room", count)
        run("select", folder / "room", "--selector", "uniform", "--ratio", 1, "--selection", folder / "all.json")
        # Without the sweep's share all points are the scene's, but the views are swept all the same.
        how = f"--iterations {STEPS} --set gaussians={GAUSSIANS} --set sweep=0".split()
        run("train", folder / "room", "--selection", folder / "all.json", *how, "--out", folder / "model")
        record = json.loads((folder / "model" / "train.json").read_text(encoding="utf-8"))
    each = 1e3 * record["seconds"] / record["iterations"]
    setup, peak = record["notes"]["setup_seconds"], record["peak_rss_bytes"]
    return f"{count:6,} {record['n_primitives']:9,} {peak / 2**30:9.2f} {setup:10.1f} {each:10.0f}"


def run(*arguments: object) -> None:
    """The command line, in a process of its own, whose memory is only its own."""
    command = [sys.executable, "-m", "viewbench", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--only", default="seconds,memory")
    parser.add_argument("--decibels", type=float, default=25.0)
    parser.add_argument("--most", type=float, default=64.0, help="seconds of the longest run")
    parser.add_argument("--views", default="100,1000")
    asked = parser.parse_args()
    splat.warm()
    if "memory" in asked.only:
        print(f"Memory of {GAUSSIANS:,} Gaussians at {SIDE} x {SIDE}")
        print(f"{'views':>6} {'Gaussians':>9} {'peak GiB':>9} {'set-up s':>10} {'ms a step':>10}")
        for count in map(int, asked.views.split(",")):
            print(memory(count), flush=True)
    if "seconds" in asked.only:
        print(f"Seconds of training to {asked.decibels:g} dB on one thread")
        print(f"{'scene':12} {'views':>5} {'pixels':>11} {'seconds':>8} {'steps':>8} {'set-up s':>8}")
        for scene, width, share in SIZES:
            try:
                print(seconds_to(asked.decibels, scene, width, share, asked.most), flush=True)
            except UserError as error:
                print(f"{scene:12} left out: {error}")


if __name__ == "__main__":
    main()
