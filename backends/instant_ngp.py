"""Instant-ngp, the hash-grid radiance field, run from a checkout of its own that environment.toml names."""

import hashlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError, nearest
from ..common.files import read_json, sha256_file, write_json
from ..common.settings import Settings, at_home
from ..scenes.types import Cameras
from . import _ngp_driver, _process, _subset
from ._memory import Usage
from ._types import Budget, Capabilities, Report, Trained, TrainingSet

SNAPSHOT = "model.ingp"
RECORD = "model.json"
LOG = "instant_ngp.log"
SCALE = 0.33  # instant-ngp multiplies positions by it and adds 0.5, so that the unit cube is 3 scene units wide
LARGEST_AABB = 128
DEFAULT_NETWORK = "base"
CHECK_SECONDS = 60.0
BUILD = (
    "clone https://github.com/NVlabs/instant-ngp with --recursive, build it (cmake . -B build && cmake --build build) "
    "and set [instant_ngp] path in environment.toml to the checkout"
)


@dataclass(frozen=True)
class InstantNgp:
    """The backend on one checkout."""

    checkout: str
    python: str

    CAPABILITIES = Capabilities(
        device="cuda",
        deterministic=False,  # its CUDA kernels add up in no fixed order
        options={
            "network": DEFAULT_NETWORK,  # a file of its configs/nerf: base, big, small, …
            "aabb_scale": 4,  # side of the box in units of 1 / 0.33 scene units; the paper takes 16 for Replica
            "near_distance": -1.0,  # in its own units: density nearer to a camera is discouraged; negative: its default
            "samples": 8,  # per pixel of a render
        },
    )

    def available(self) -> str | None:
        if not self.checkout:
            return f"no checkout is configured; {BUILD}"
        folder = at_home(self.checkout)
        if not folder.is_dir():
            return f"[instant_ngp] path '{folder}' is not there; {BUILD}"
        if not _ngp_driver.modules(folder):
            return f"'{folder}' has no build/pyngp; build it with its Python bindings (cmake --build build)"
        if DEFAULT_NETWORK not in _ngp_driver.configurations(folder):
            return f"'{folder}' has no configs/nerf/{DEFAULT_NETWORK}.json; set [instant_ngp] path to a whole checkout"
        if shutil.which(self.python) is None:
            return f"[instant_ngp] python '{self.python}' is not there; set it to the Python that pyngp was built for"
        try:
            with tempfile.TemporaryDirectory(prefix="viewbench-") as place:
                self._drive("check", {}, Path(place), Path(place) / LOG, CHECK_SECONDS)
        except UserError as error:
            return f"its module pyngp cannot be used ({error}); build it again for [instant_ngp] python '{self.python}'"
        return None

    def version(self) -> str:
        """The checkout's commit, where it is a git checkout, and hashes of its networks and the module built there."""
        if not self.checkout:
            raise UserError(f"instant-ngp has no version: no checkout is configured; {BUILD}")
        folder = at_home(self.checkout)
        module = next(iter(_ngp_driver.modules(folder)), None)
        built = "no module" if module is None else f"sha256:{sha256_file(module)[:12]}"
        networks = "".join(f"{name} {sha256_file(file)}\n" for name, file in _ngp_driver.configurations(folder).items())
        built += f", networks {hashlib.sha256(networks.encode()).hexdigest()[:12]}"
        command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=CHECK_SECONDS, check=True)
            return f"instant-ngp {done.stdout.strip()}, {built}"
        except (OSError, subprocess.SubprocessError):
            return f"instant-ngp {built}"

    def train(
        self, data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict[str, Any], report: Report
    ) -> Trained:
        """Writes the chosen views as transforms.json, trains, and keeps the snapshot of the network.

        Its own seed is fixed and not within reach of Python; which rays it draws depends on the order of the frames,
        so that is what the seed shuffles. Raises UserError for a network or a box that it does not know, for cameras
        outside of the box, and, with its last line, when it fails.
        """
        _check(data, options)
        networks = _ngp_driver.configurations(at_home(self.checkout))
        if options["network"] not in networks:
            close = nearest(options["network"], networks)
            raise UserError(f"its configs/nerf has no network '{options['network']}'{close} ({', '.join(networks)})")
        order = np.random.default_rng(seed).permutation(len(data.names))
        scene = out / "scene"
        extra = {"aabb_scale": options["aabb_scale"]}
        images = (data.images[int(index)] for index in order)
        _subset.write(scene, "transforms", data.cameras[order], images, extra=extra)
        report.progress(0, budget.iterations, f"running instant-ngp, which writes {LOG}")
        arguments = {
            "scene": scene / "transforms.json",
            "snapshot": out / SNAPSHOT,
            "record": out / RECORD,
            "network": options["network"],
            "steps": budget.iterations or 0,
            "seconds": budget.seconds or 0.0,
            "near": options["near_distance"],
        }
        usage = self._drive("train", arguments, out, out / LOG)
        shutil.rmtree(scene)
        record = read_json(out / RECORD, "instant-ngp's record")
        write_json(out / RECORD, {**record, "samples": options["samples"]})
        return Trained(
            iterations=record["iterations"],
            seconds=record["seconds"],
            curve=[{**point, "test_psnr_db": None} for point in record["curve"]],
            device="cuda",
            peak_rss_bytes=usage.rss_bytes,
            peak_gpu_bytes=usage.gpu_bytes,
        )

    def render(self, model: Path, cameras: Cameras) -> Iterator[np.ndarray]:
        """Has it render all cameras, then yields them one by one."""
        record = read_json(model / RECORD, "instant-ngp's record")
        with tempfile.TemporaryDirectory(prefix="viewbench-") as folder:
            place = Path(folder)
            write_json(place / "cameras.json", _subset.transforms(cameras))
            arguments = {
                "snapshot": model / SNAPSHOT,
                "cameras": place / "cameras.json",
                "images": place,
                "samples": record["samples"],
            }
            self._drive("render", arguments, place, place / LOG)
            for index in range(len(cameras)):
                image = np.load(place / Path(_subset.image_name(index)).with_suffix(".npy"), allow_pickle=False)
                yield np.clip(image, 0, 1)

    def _drive(
        self, action: str, arguments: dict[str, Any], folder: Path, log: Path, timeout_s: float | None = None
    ) -> Usage:
        """Runs one action of _ngp_driver.py under the checkout's Python; paths are made absolute."""
        command = [self.python, str(Path(_ngp_driver.__file__).resolve()), action]
        command.append(str(at_home(self.checkout).resolve()))
        for name, value in arguments.items():
            command += [f"--{name}", str(value.resolve() if isinstance(value, Path) else value)]
        return _process.run(command, folder, log, f"instant-ngp ({action})", timeout_s)


def _check(data: TrainingSet, options: dict[str, Any]) -> None:
    side = options["aabb_scale"]
    if not 1 <= side <= LARGEST_AABB or side & (side - 1):
        raise UserError(f"option 'aabb_scale' is {side}, expected a power of two up to {LARGEST_AABB}")
    if options["samples"] < 1:
        raise UserError(f"option 'samples' is {options['samples']}, expected a positive number")
    reach = side / 2 / SCALE
    far = np.abs(data.training.positions).max()  # of all training cameras, so that no choice fails where another goes
    if far > reach:
        raise UserError(
            f"a training camera is {far:.1f} scene units from the origin, instant-ngp's box with aabb_scale={side} "
            f"ends at {reach:.1f}; set a larger aabb_scale"
        )


def configured(argument: str, settings: Settings) -> InstantNgp:
    """The backend on the checkout that environment.toml names."""
    if argument:
        raise UserError(f"backend 'instant-ngp' takes no name behind a colon, got '{argument}'")
    return InstantNgp(settings.instant_ngp.path, settings.instant_ngp.python or sys.executable)
