"""Runs inside instant-ngp's own Python and drives its module pyngp; imports nothing of viewbench.

    _ngp_driver.py check CHECKOUT
    _ngp_driver.py train CHECKOUT --scene FILE --snapshot FILE --record FILE --steps N --seconds S --near D
    _ngp_driver.py render CHECKOUT --snapshot FILE --cameras FILE --images FOLDER --samples N --near D

The names of pyngp are those of instant-ngp's src/python_api.cu; the way of training and rendering is that of its
scripts/run.py, which itself cannot do it: its screenshots know no principal point and one field of view for all.
"""

import argparse
import importlib
import json
import sys
import time
from pathlib import Path
from typing import Any

CURVE_POINTS = 20
PYNGP = "build*/**/pyngp*"  # where CMake puts the module, by the README's build folder
MIN_TRANSMITTANCE = 1e-4  # as scripts/run.py scores test views


def modules(checkout: Path) -> list[Path]:
    """What CMake built; Python's own cache of a module says nothing of whether it is still there."""
    return sorted(file for file in checkout.glob(PYNGP) if "__pycache__" not in file.parts)


def import_pyngp(checkout: Path) -> Any:
    """The module that was built in the checkout. Raises ImportError where there is none."""
    for file in modules(checkout):
        sys.path.insert(0, str(file.parent))
    return importlib.import_module("pyngp")


def train(ngp: Any, scene: Path, snapshot: Path, record: Path, steps: int, seconds: float, near: float) -> None:
    """Trains until `steps` or `seconds` (0: no such limit), saves the network, and notes steps, seconds and losses."""
    testbed = ngp.Testbed()
    testbed.load_training_data(str(scene))
    if near >= 0:
        testbed.nerf.training.near_distance = near
    testbed.shall_train = True
    curve: list[dict[str, float]] = []
    every = max(1, steps // CURVE_POINTS) if steps else 500
    began = time.perf_counter()
    while testbed.frame():
        step, elapsed = testbed.training_step, time.perf_counter() - began
        done = bool(steps and step >= steps) or bool(seconds and elapsed >= seconds)
        if done or step >= (len(curve) + 1) * every:
            curve.append({"step": step, "seconds": elapsed, "loss": float(testbed.loss)})
            print(f"step {step} loss {testbed.loss:.5f}", flush=True)
        if done:
            break
    result = {"iterations": testbed.training_step, "seconds": time.perf_counter() - began, "curve": curve}
    testbed.save_snapshot(str(snapshot), False)
    record.write_text(json.dumps(result), encoding="utf-8")


def render(ngp: Any, snapshot: Path, cameras: Path, images: Path, samples: int, near: float) -> None:
    """Writes an (H, W, 3) float32 array in sRGB for every frame of the transforms file `cameras`, in its order."""
    import numpy as np

    testbed = ngp.Testbed()
    testbed.load_snapshot(str(snapshot))
    testbed.shall_train = False
    testbed.background_color = [0.0, 0.0, 0.0, 1.0]
    testbed.snap_to_pixel_centers = True
    testbed.nerf.render_min_transmittance = MIN_TRANSMITTANCE
    if near >= 0:
        testbed.render_near_distance = near
    testbed.fov_axis = 0  # both focal lengths below are divided by the width
    for frame in json.loads(cameras.read_text(encoding="utf-8"))["frames"]:
        width, height = frame["w"], frame["h"]
        testbed.set_nerf_camera_matrix(np.array(frame["transform_matrix"])[:3])
        testbed.relative_focal_length = [frame["fl_x"] / width, frame["fl_y"] / width]
        testbed.screen_center = [1 - frame["cx"] / width, 1 - frame["cy"] / height]  # the module counts from the end
        pixels = testbed.render(width, height, samples, False)  # False: sRGB, as the pictures it was trained on
        name = Path(frame["file_path"]).with_suffix(".npy").name
        np.save(images / name, np.asarray(pixels, dtype=np.float32)[..., :3], allow_pickle=False)


def main() -> None:
    parser = argparse.ArgumentParser()
    actions = parser.add_subparsers(dest="action", required=True)
    places = {"train": ("scene", "snapshot", "record"), "render": ("snapshot", "cameras", "images"), "check": ()}
    numbers = {"train": {"steps": int, "seconds": float, "near": float}, "render": {"samples": int, "near": float}}
    for action, names in places.items():
        known = actions.add_parser(action)
        known.add_argument("checkout", type=Path)
        for name in names:
            known.add_argument(f"--{name}", type=Path, required=True)
        for name, kind in numbers.get(action, {}).items():
            known.add_argument(f"--{name}", type=kind, required=True)
    arguments = vars(parser.parse_args())
    action, ngp = arguments.pop("action"), import_pyngp(arguments.pop("checkout"))
    if action == "train":
        train(ngp, **arguments)
    elif action == "render":
        render(ngp, **arguments)


if __name__ == "__main__":
    main()
