"""A trainer that we did not write, from PyPI and without a GPU: nerfstudio's nerfacto behind `command:`.

    python -m tests.external_trainer FOLDER [--iterations N]          (or: make external)

makes FOLDER/nerfstudio, a virtual environment (4 GB; kept for the next time), trains on 80 views of the generated room
with the example of environment.toml, scores the test views, and checks that renders are where their cameras are. It
also has nerfstudio read the command lines of the other example, whose rasteriser needs CUDA. It takes ten minutes to
install and six to run on two quiet cores, and is no part of `make test`. Raises AssertionError on the first thing that
is wrong. A run gave 17.99 dB on test views and 20.57 on training views, where the mean colour has 14.53 on the former.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.backends.test_command import example_text
from viewbench.backends import _registry
from viewbench.backends._psnr import psnr_db
from viewbench.common import settings as settings_file
from viewbench.common.files import read_json
from viewbench.common.settings import PACKAGE, Settings
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene

WANTED = (("torch==2.13.0", "torchvision==0.28.0"), ("nerfstudio==1.1.5",))
ROOM = "room_human"
WIDTH = 64
VIEWS = 80

# Where the index has a CPU build of torch and a CUDA build of torchvision, torchvision misses two operators at its
# import, which nothing here calls.
DECLARED = """import torch
library = torch.library.Library("torchvision", "FRAGMENT")
for operator in ("nms", "qnms"):
    library.define(f"{operator}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
"""
# nerfstudio loads AlexNet for a score that nobody asks for, and would download it: one zero stands for each weight.
NO_ALEXNET = """import pathlib, sys, torch, torchvision
file = pathlib.Path(sys.argv[1], "hub", "checkpoints", "alexnet-owt-7be5be79.pth")
file.parent.mkdir(parents=True, exist_ok=True)
weights = torchvision.models.alexnet().state_dict()
torch.save({name: torch.zeros(1).expand(value.shape) for name, value in weights.items()}, file)
"""
# What nerfstudio's own command lines make of ours.
CONFIGURATION = """import json, sys, tyro
from nerfstudio.configs.method_configs import AnnotatedBaseConfigUnion
from nerfstudio.scripts.render import Commands
train, render = json.loads(sys.argv[1])
config = tyro.cli(AnnotatedBaseConfigUnion, args=train)
manager, model = config.pipeline.datamanager, config.pipeline.model
print(json.dumps({"seed": config.machine.seed, "iterations": config.max_num_iterations, "vis": config.vis,
    "order": manager.train_cameras_sampling_seed, "background": model.background_color,
    "camera_optimizer": model.camera_optimizer.mode, "downscales": model.num_downscales,
    "folder": str(config.get_base_dir()), "parser": vars(manager.dataparser),
    "render": vars(tyro.cli(Commands, args=render))}, default=str))
"""
READ = {
    "eval_mode": "all",
    "orientation_method": "none",
    "center_method": "none",
    "auto_scale_poses": False,
    "scale_factor": 1.0,
    "downscale_factor": 1,
    "load_3D_points": True,
    "data": "SCENE",
}
SPLATFACTO = {
    "seed": 7,
    "order": 7,
    "iterations": 1500,
    "vis": "tensorboard",
    "background": "black",
    "camera_optimizer": "off",
    "downscales": 0,
    "folder": "cell/splatfacto/run",
}
RENDERED = {
    "load_config": "cell/splatfacto/run/config.yml",
    "data": "CAMERAS",
    "output_path": "RENDERS",
    "split": "test",
    "rendered_output_names": ["rgb"],
    "image_format": "png",
}


@dataclass(frozen=True)
class Place:
    """The folder that everything goes to."""

    folder: Path

    @property
    def programs(self) -> Path:
        return self.folder / "nerfstudio" / "bin"

    @property
    def variables(self) -> dict[str, str]:
        """For this process and its children: the settings written here, no downloads, one thread a process."""
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
        ours = {
            "VIEWBENCH_ENVIRONMENT": str(self.folder / "environment.toml"),
            "TORCH_HOME": str(self.folder / "torch"),
        }
        return {**threads, **ours}

    def python(self, *arguments: object) -> str:
        """What the environment's Python prints."""
        command = [str(self.programs / "python"), *map(str, arguments)]
        return subprocess.run(command, cwd=self.folder, check=True, stdout=subprocess.PIPE, text=True).stdout

    def viewbench(self, *arguments: object) -> None:
        """Runs a command of this clone, which prints how far it is."""
        subprocess.run([sys.executable, "-m", "viewbench", *map(str, arguments)], cwd=self.folder, check=True)


def install(place: Place) -> None:
    """nerfstudio and all that it asks for, in an environment of its own, where it is not there yet."""
    if not (place.programs / "ns-train").exists():
        subprocess.run([sys.executable, "-m", "venv", place.programs.parent], check=True)
        for packages in WANTED:
            place.python("-m", "pip", "install", "-qq", "--disable-pip-version-check", *packages)
    if subprocess.run([place.programs / "python", "-c", "import torchvision"], capture_output=True).returncode:
        site = Path(place.python("-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
        (site / "sitecustomize.py").write_text(DECLARED, encoding="utf-8")
    place.python("-c", NO_ALEXNET, place.folder / "torch")


def configure(place: Place) -> Settings:
    """Settings with the examples of environment.toml, their programs those just installed."""
    shipped = (PACKAGE / "environment.toml").read_text(encoding="utf-8")
    examples = example_text().replace("/opt/nerfstudio/bin", str(place.programs))
    (place.folder / "environment.toml").write_text(f"{shipped}\n{examples}\n", encoding="utf-8")
    os.environ.update(place.variables)
    return settings_file.load()


def check_splatfacto(place: Place) -> None:
    """nerfstudio understands the example that needs CUDA as it is meant."""
    text = example_text()
    for name, value in {"seed": 7, "iterations": 1500, "scene": "SCENE", "cameras": "CAMERAS"}.items():
        text = text.replace(f"{{{name}}}", str(value))
    example = tomllib.loads(text.replace("{renders}", "RENDERS"))["command"]["splatfacto"]
    train = example["train"][1:]
    render = example["render"][example["render"].index("dataset") :]
    found = json.loads(place.python("-c", CONFIGURATION, json.dumps([train, render])).splitlines()[-1])
    for wanted, got in ((SPLATFACTO, found), (READ, found["parser"]), (RENDERED, found["render"])):
        differ = {name: got[name] for name, value in wanted.items() if got[name] != value}
        assert not differ, f"nerfstudio reads {differ} from the example for splatfacto"


def check_renders(place: Place, settings: Settings) -> str:
    """Test views are better than one colour, training views much better, and each is the picture of its camera."""
    scene = open_scene(ROOM, settings)
    chosen = np.array(read_json(place.folder / "selection.json")["indices"])
    views, cameras = load_images(scene.train, chosen, WIDTH)
    tests, test_cameras = load_images(scene.test, np.arange(len(scene.test)), WIDTH)
    colour = views.mean(axis=(0, 1, 2))
    flat = float(np.mean([psnr_db(np.broadcast_to(colour, view.shape), view) for view in tests]))
    test = read_json(place.folder / "scores" / "metrics.json")["psnr_db"]
    model, backend = place.folder / "model", _registry.load("command:nerfacto", settings)
    renders = list(backend.render(model, cameras))
    table = np.array([[psnr_db(render, view) for view in views] for render in renders])
    own = float(table.diagonal().mean())
    (alone,) = backend.render(model, test_cameras[:1])
    found = f"test views {test:.2f} dB, training views {own:.2f} dB, the mean colour {flat:.2f} dB on test views"
    assert np.array_equal(table.argmax(axis=1), np.arange(VIEWS)), f"renders of other cameras' views: {found}"
    assert own > flat + 4, found
    assert test > flat + 2, found
    assert psnr_db(alone, tests[0]) > flat - 3, f"a view rendered alone is another: {psnr_db(alone, tests[0]):.2f} dB"
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--iterations", type=int, default=1000)
    arguments = parser.parse_args()
    place = Place(arguments.folder.resolve())
    place.folder.mkdir(parents=True, exist_ok=True)
    install(place)
    settings = configure(place)
    check_splatfacto(place)
    for made in ("model", "scores"):
        shutil.rmtree(place.folder / made, ignore_errors=True)
    selection = place.folder / "selection.json"
    place.viewbench("select", ROOM, "--count", VIEWS, "--factors", "pos,ang", "--selection", selection)
    size = ("--width", WIDTH, "--iterations", arguments.iterations)
    place.viewbench(
        *("train", ROOM, "--selection", selection, "--backend", "command:nerfacto", "--out", "model"), *size
    )
    place.viewbench("evaluate", "model", ROOM, "--out", "scores")
    print(check_renders(place, settings))


if __name__ == "__main__":
    main()
