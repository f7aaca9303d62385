"""Runs inside instant-ngp's own Python and drives its module pyngp; imports nothing of viewbench.

    _ngp_driver.py check CHECKOUT
    _ngp_driver.py train CHECKOUT --scene FILE --snapshot FILE --record FILE --network NAME --steps N --seconds S
        --near D
    _ngp_driver.py render CHECKOUT --snapshot FILE --cameras FILE --images FOLDER --samples N

The way of training and rendering is that of instant-ngp's scripts/run.py, which itself cannot do it: its screenshots
know no principal point and one field of view for all. What is called, what it corresponds to, and where that was read
(commit abe236e; run.py, bindings = src/python_api.cu, testbed = src/testbed.cu, loader = src/nerf_loader.cu):

    sys.path, `import pyngp`       common.py: every folder below build* that holds a module
    Testbed(), root_dir            run.py: `testbed.root_dir = ROOT_DIR`. Without it the network's configuration is
                                   looked for below the working folder (testbed, find_network_config), is not found,
                                   and the first step throws "Unable to create a neural network trainer."
    load_training_data(FILE)       run.py --scene. A file is read alone, a folder with every .json in it (testbed_nerf,
                                   load_nerf). Loader: frames in natural order of file_path; p → 0.33 p + 0.5; pixels
                                   8-bit sRGB; focal lengths in pixels; cx, cy over the frame's own w, h
    reload_network_from_file       run.py --network; configs/nerf/base.json is its default. Before the clock starts,
                                   since it allocates and compiles
    training.train_mode            run.py --train_mode nerf: the paper's loss. The default is RflRelax, which run.py
                                   schedules and which falls back to Nerf where there is no JIT (testbed_nerf)
    training.near_distance         run.py --near_distance; negative leaves 0.1 in its own units
    shall_train, frame()           run.py: one step a call; without a window nothing is drawn. It sets shall_train back
                                   when no ray meets anything, and frame() goes on returning True
    training_step, loss            run.py's progress bar; the loss is brought up to date every 16 steps
    save_snapshot(FILE, False)     run.py --save_snapshot: without the optimiser's state. It has the data set's scale,
                                   offset, aabb_scale and cameras, but no picture
    load_snapshot(FILE)            run.py --load_snapshot
    background_color 0, 0, 0, 1    run.py scores test views on black
    exposure 0                     run.py's default
    snap_to_pixel_centers          run.py, for test views
    render_min_transmittance       run.py: 1e-4 for test views
    set_nerf_camera_matrix         run.py: the upper three rows of transform_matrix, converted as the loader does
    fov_axis, relative_focal_length, screen_center
                                   testbed, set_camera_to_training_view: focal length over the size along fov_axis,
                                   1 - principal point
    render(W, H, samples, False)   run.py renders linear and converts to sRGB before it compares; False converts within
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
MODULES = (".so", ".pyd", ".py")
MIN_TRANSMITTANCE = 1e-4  # as scripts/run.py scores test views


def modules(checkout: Path) -> list[Path]:
    """What CMake built, and none of what it needed for that (build/CMakeFiles/pyngp.dir); nor Python's own cache."""
    found = (file for file in checkout.glob(PYNGP) if file.suffix in MODULES and "__pycache__" not in file.parts)
    return sorted(file for file in found if file.is_file())


def import_pyngp(checkout: Path) -> Any:
    """The module that was built in the checkout. Raises ImportError where there is none."""
    for file in modules(checkout):
        sys.path.insert(0, str(file.parent))
    return importlib.import_module("pyngp")


def configurations(checkout: Path) -> dict[str, Path]:
    """Files of the networks for radiance fields by name; "base" is instant-ngp's default."""
    return {file.stem: file for file in sorted((checkout / "configs" / "nerf").glob("*.json"))}


def testbed_of(ngp: Any, checkout: Path) -> Any:
    """A fresh testbed that finds what belongs to it."""
    testbed = ngp.Testbed()
    testbed.root_dir = str(checkout)
    return testbed


def train(
    checkout: Path, scene: Path, snapshot: Path, record: Path, network: str, steps: int, seconds: float, near: float
) -> None:
    """Trains until `steps` or `seconds` (0: no such limit), saves the network, and notes steps, seconds and losses."""
    ngp = import_pyngp(checkout)
    testbed = testbed_of(ngp, checkout)
    testbed.load_training_data(str(scene))
    if hasattr(ngp, "TrainMode"):  # older checkouts have but this one
        testbed.nerf.training.train_mode = ngp.TrainMode.Nerf
    testbed.reload_network_from_file(str(configurations(checkout)[network]))
    if near >= 0:
        testbed.nerf.training.near_distance = near
    testbed.shall_train = True
    curve: list[dict[str, float]] = []
    every = max(1, steps // CURVE_POINTS) if steps else 500
    began = time.perf_counter()
    while testbed.frame():
        if not testbed.shall_train:
            sys.exit('instant-ngp gave up: no ray met anything ("generated 0 samples"); is aabb_scale large enough?')
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


def render(checkout: Path, snapshot: Path, cameras: Path, images: Path, samples: int) -> None:
    """Writes an (H, W, 3) float32 array in sRGB for every frame of the transforms file `cameras`, in its order."""
    import numpy as np

    testbed = testbed_of(import_pyngp(checkout), checkout)
    testbed.load_snapshot(str(snapshot))
    testbed.shall_train = False
    testbed.background_color = [0.0, 0.0, 0.0, 1.0]
    testbed.exposure = 0.0
    testbed.snap_to_pixel_centers = True
    testbed.nerf.render_min_transmittance = MIN_TRANSMITTANCE
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
    numbers: dict[str, dict[str, Any]] = {
        "train": {"network": str, "steps": int, "seconds": float, "near": float},
        "render": {"samples": int},
    }
    for action, names in places.items():
        known = actions.add_parser(action)
        known.add_argument("checkout", type=Path)
        for name in names:
            known.add_argument(f"--{name}", type=Path, required=True)
        for name, kind in numbers.get(action, {}).items():
            known.add_argument(f"--{name}", type=kind, required=True)
    arguments = vars(parser.parse_args())
    action = arguments.pop("action")
    if action == "train":
        train(**arguments)
    elif action == "render":
        render(**arguments)
    else:
        import_pyngp(arguments["checkout"])


if __name__ == "__main__":
    main()
