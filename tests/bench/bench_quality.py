"""Quality of the CPU splat backend by seconds of training on one thread: its defaults beside other settings.

    python tests/bench/bench_quality.py [--scene room_human] [--width 128] [--shares 0.05,0.2,1] [--seconds 5,15]
                                        [--seeds 3] [--validate room_smooth] [--set NAME=option:value,option:value ...]

Every budget is a run of its own, since the learning rates fall over the budget; the settings take turns, so that what
else the machine does falls on all of them. Views are every n-th. Scores are of the test split, or, with --validate, of
50 training frames of another scene of the same room: hyperparameters are chosen there, where no table looks.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from viewbench.backends import splat  # noqa: E402
from viewbench.backends._psnr import psnr_db  # noqa: E402
from viewbench.backends._types import Budget, Report, TrainingSet  # noqa: E402
from viewbench.common.settings import load as load_settings  # noqa: E402
from viewbench.scenes.images import load_images  # noqa: E402
from viewbench.scenes.load import open_scene  # noqa: E402
from viewbench.scenes.types import Cameras  # noqa: E402

PLAIN = (
    "points:scene,gaussians:20000,shell:0,low_pass:0.3,antialias:false,opacity:0.5,scale:0.6,rate_mean:6e-4,"
    "rate_mean_end:0.01,rate_scale:0.02,rate_colour:5e-3,rate_sh:1e-3,rate_end:1.0"
)
SETTINGS = {
    "default": "",
    "plain": PLAIN,  # 3DGS's filter, the scene's points, and rates for short runs
    "scene points": "points:scene,gaussians:20500",
    "sweep": "points:sweep",
    "rays": "points:rays",
    "no shell": "shell:0",
    "3DGS's filter": "low_pass:0.3,antialias:false",
    "degree 0": "sh_degree:0",
    "degree 2": "sh_degree:2",
    "regularised": "opacity_weight:0.01,scale_weight:0.01",
}
VALIDATION_VIEWS = 50


def options(text: str) -> dict:
    """All options with those of "name:value,name:value" changed."""
    chosen = dict(splat.CAPABILITIES.options)
    for pair in filter(None, text.split(",")):
        name, value = pair.split(":")
        kind = type(chosen[name])
        chosen[name] = value == "true" if kind is bool else kind(value)
    return chosen


def views(name: str, width: int, share: float, holdout: str | None) -> tuple[TrainingSet, np.ndarray, Cameras]:
    """The chosen share of a scene's training views, and its test views' images and cameras."""
    scene = open_scene(name, load_settings(), holdout=holdout)
    count = len(scene.train)
    chosen = np.unique(np.linspace(0, count - 1, max(2, round(share * count))).round().astype(np.int64))
    images, cameras = load_images(scene.train, chosen, width)
    names = tuple(scene.train.names[i] for i in chosen)
    data = TrainingSet(name, names, cameras, images, scene.points, chosen, scene.train.cameras.scaled(width))
    return data, *load_images(scene.test, np.arange(len(scene.test)), width)


def others(name: str, width: int) -> tuple[np.ndarray, Cameras]:
    """Images and cameras of evenly spaced training frames of another scene."""
    split = open_scene(name, load_settings()).train
    return load_images(split, np.unique(np.linspace(3, len(split) - 4, VALIDATION_VIEWS).astype(np.int64)), width)


def measure(data: TrainingSet, truth: np.ndarray, cameras: Cameras, seconds: float, seed: int, chosen: dict) -> list:
    """PSNR in dB, steps, Gaussians, and the seconds before the first step, of one run."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        trained = splat.train(data, Path(folder), seed, Budget(None, seconds), chosen, Report())
        before = time.perf_counter() - began - trained.seconds
        pictures = splat.render(Path(folder), cameras)
        score = np.mean([psnr_db(np.clip(a, 0, 1), b) for a, b in zip(pictures, truth, strict=True)])
    return [score, trained.iterations, trained.n_primitives, before]


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--scene", default="room_human")
    parser.add_argument("--holdout", help="for a scene without a test split, such as every:8")
    parser.add_argument("--validate", help="score on training frames of this scene")
    parser.add_argument("--width", type=int, default=128)
    parser.add_argument("--shares", default="0.05,0.2,1")
    parser.add_argument("--seconds", default="5,15")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument(
        "--only", default="default,plain", help='of the settings below, or "all": ' + ", ".join(SETTINGS)
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=option:value,...", help="another setting")
    asked = parser.parse_args()
    known = SETTINGS if asked.only == "all" else {name: SETTINGS[name] for name in asked.only.split(",")}
    known = {**known, **dict(text.split("=", 1) for text in asked.set)}
    splat.warm()
    print(f"{asked.scene}, width {asked.width}, scored on {asked.validate or 'its test views'}, {asked.seeds} seeds")
    print(f"{'views':>5} {'seconds':>7}  {'settings':16} {'PSNR dB':>15} {'steps':>6} {'Gaussians':>9} {'set-up s':>8}")
    for share in map(float, asked.shares.split(",")):
        data, truth, cameras = views(asked.scene, asked.width, share, asked.holdout)
        if asked.validate:
            truth, cameras = others(asked.validate, asked.width)
        for seconds in map(float, asked.seconds.split(",")):
            rows = {name: [] for name in known}
            for seed in range(asked.seeds):
                for name, text in known.items():
                    rows[name].append(measure(data, truth, cameras, seconds, seed, options(text)))
            for name, values in rows.items():
                mean, spread = np.mean(values, axis=0), np.std(values, axis=0, ddof=min(1, asked.seeds - 1))
                score = f"{mean[0]:7.2f} ± {spread[0]:4.2f}"
                counts = f"{mean[1]:6.0f} {mean[2]:9.0f} {mean[3]:8.1f}"
                print(f"{len(data.images):5} {seconds:7g}  {name:16} {score:>15} {counts}", flush=True)


if __name__ == "__main__":
    main()
