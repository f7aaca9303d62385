"""A program of its own that "trains" by keeping views and renders the nearest one: the smallest external trainer.

    nearest_view.py train --scene FOLDER --out FOLDER --seed N --iterations N [--pause SECONDS]
    nearest_view.py render --model FOLDER --cameras FOLDER --images FOLDER

It knows nothing of viewbench: it reads transforms.json as nerfstudio and instant-ngp write it.
"""

import argparse
import json
import random
import shutil
import time
from pathlib import Path

import numpy as np
from PIL import Image


def train(scene: Path, out: Path, seed: int, iterations: int, pause: float) -> None:
    """Keeps as many views as there are iterations, in an order drawn from the seed; dawdles `pause` seconds a view."""
    transforms = json.loads((scene / "transforms.json").read_text(encoding="utf-8"))
    frames = transforms["frames"]
    random.Random(seed).shuffle(frames)
    transforms["frames"] = frames[:iterations]
    (out / "views").mkdir()
    for number, frame in enumerate(transforms["frames"]):
        kept = f"views/{number}.png"
        shutil.copy(scene / frame["file_path"], out / kept)
        frame["file_path"] = kept
        time.sleep(pause)
    (out / "model.json").write_text(json.dumps(transforms), encoding="utf-8")
    print(f"kept {len(transforms['frames'])} views with seed {seed}")


def render(model: Path, cameras: Path, images: Path) -> None:
    """Writes, for every camera, the view whose centre and direction are nearest, at the camera's size."""
    known = json.loads((model / "model.json").read_text(encoding="utf-8"))["frames"]
    asked = json.loads((cameras / "transforms.json").read_text(encoding="utf-8"))["frames"]
    places = np.array([frame["transform_matrix"] for frame in known])
    for frame in asked:
        pose = np.array(frame["transform_matrix"])
        far = np.linalg.norm(places[:, :3, 3] - pose[:3, 3], axis=1)
        turned = np.linalg.norm(places[:, :3, 2] - pose[:3, 2], axis=1)
        best = known[int(np.argmin(far + turned))]
        with Image.open(model / best["file_path"]) as picture:
            picture.resize((frame["w"], frame["h"])).save(images / Path(frame["file_path"]).name)


def main() -> None:
    parser = argparse.ArgumentParser()
    actions = parser.add_subparsers(dest="action", required=True)
    training = actions.add_parser("train")
    rendering = actions.add_parser("render")
    for name in ("scene", "out"):
        training.add_argument(f"--{name}", type=Path, required=True)
    for name in ("seed", "iterations"):
        training.add_argument(f"--{name}", type=int, required=True)
    training.add_argument("--pause", type=float, default=0.0)
    for name in ("model", "cameras", "images"):
        rendering.add_argument(f"--{name}", type=Path, required=True)
    arguments = vars(parser.parse_args())
    {"train": train, "render": render}[arguments.pop("action")](**arguments)


if __name__ == "__main__":
    main()
