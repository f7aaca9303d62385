"""Captures of thousands of frames, made in seconds, the most memory that a command takes for one, and its bound."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from viewbench.backends._pictures import KEPT_BYTES
from viewbench.backends.splat.stages import TARGETS
from viewbench.common.settings import PACKAGE
from viewbench.scenes.ply import write_points
from viewbench.scenes.types import Points

# A small process between this one and the command: what Linux says of a child begins with the peak of who started it.
# It looks at the sum over the command and all that it starts, too, which no call of the system says. A child that is
# not yet another program than who started it has no memory of its own.
WATCH = """
import os, subprocess, sys, time
import psutil
program = subprocess.Popen(sys.argv[2:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
most, watched = 0, psutil.Process(program.pid)
while True:
    pid, status, usage = os.wait4(program.pid, os.WNOHANG)
    if pid:
        break
    total = 0
    try:
        total = watched.memory_info().rss
        for child in watched.children(recursive=True):
            if child.cmdline() != watched.cmdline():
                total += child.memory_info().rss
    except psutil.Error:
        pass
    most = max(most, total)
    time.sleep(0.05)
with open(sys.argv[1], "w") as file:
    file.write(str(max(most, usage.ru_maxrss << 10)))
sys.exit(os.waitstatus_to_exitcode(status))
"""

MIB, KIB = 1 << 20, 1 << 10
GAUSSIANS = 2000  # that are trained here; each takes half a KiB
PER_FRAME = {"select": 16 * KIB, "train": 8 * KIB, "evaluate": 8 * KIB}  # bytes, beside pictures


def bound_bytes(command: str, frames: int, pixels: int, each: int = 12) -> int:
    """The most memory that a command may take for so many views of so many pixels each, on one thread.

    Choosing keeps two rows of 1,280 numbers a view and names. Training keeps pictures, `each` bytes a pixel (3 as they
    are, 6 where their size is a whole number of times the one trained at, else 12), at most KEPT_BYTES of them, and
    what its loss knows of them, 36 bytes a pixel and a margin around the picture, at most TARGETS and, at half the
    size, a quarter of that. Scoring has one view at a time, of which SSIM has a dozen copies in double precision. The
    rest is Python and its packages, and the kernels being loaded or compiled.
    """
    if command == "select":
        return 112 * MIB + PER_FRAME[command] * frames
    if command == "train":
        kept = min(KEPT_BYTES, each * pixels * frames) + min(TARGETS + TARGETS // 4, 72 * pixels * frames)
        return 320 * MIB + kept + PER_FRAME[command] * frames + 512 * pixels
    if command == "evaluate":
        return 288 * MIB + PER_FRAME[command] * frames + 512 * pixels
    raise ValueError(command)


def capture(folder: Path, train: int, test: int, size: tuple[int, int], distinct: int, points: int = 2000) -> Path:
    """A capture in Blender's form: views all around a room of noise, which `distinct` files of pictures are shared by.

    Every frame has a name of its own, a link to one of those files. `size` is width and height in pixels.
    """
    rng = np.random.default_rng(0)
    width, height = size
    (folder / "pictures").mkdir(parents=True)
    for number in range(distinct):
        noise = Image.fromarray(rng.integers(0, 256, (12, 16, 3), dtype=np.uint8))
        noise.resize(size, Image.Resampling.BICUBIC).save(folder / "pictures" / f"{number}.jpg")
    for split, count in (("train", train), ("test", test)):
        (folder / split).mkdir()
        frames = []
        for i in range(count):
            around = 2 * math.pi * (i + 0.5 * (split == "test")) / count
            c, s, height_now = math.cos(around), math.sin(around), math.sin(7 * around)
            name = f"{split}/{i:05d}.jpg"
            os.link(folder / "pictures" / f"{i % distinct}.jpg", folder / name)
            pose = [[-s, 0, c, 2 * c], [0, 1, 0, height_now], [-c, 0, -s, -2 * s], [0, 0, 0, 1]]
            frames.append({"file_path": name, "transform_matrix": pose})
        table = {"camera_angle_x": 1.2, "w": width, "h": height, "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(table), encoding="utf-8")
    xyz = rng.uniform(-3, 3, (points, 3))
    write_points(folder / "points3d.ply", Points(xyz, rng.integers(0, 256, (points, 3)).astype(np.uint8)))
    return folder


def peak_bytes(folder: Path, *arguments: object) -> int:
    """The largest resident sets of a `viewbench` command, run in `folder`, and of all that it starts, added up.

    Kernels are taken from the user's cache, where there are any. Raises SystemExit with what it said where it fails.
    """
    found = folder / ".peak"
    command = [sys.executable, "-c", WATCH, str(found), sys.executable, "-m", "viewbench", *map(str, arguments)]
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    path = os.pathsep.join(filter(None, [str(PACKAGE / ".editor"), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, **threads, "PYTHONPATH": path}
    (folder / "results").mkdir(exist_ok=True)  # which has the features, then
    done = subprocess.run(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return int(found.read_text())
