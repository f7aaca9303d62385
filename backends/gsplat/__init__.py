"""3D Gaussian splatting on CUDA: gsplat's rasteriser and densification under a trainer of our own."""

import importlib.metadata
import importlib.util
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.errors import UserError
from ...common.files import read_json, write_json
from ...common.settings import Settings
from ...scenes.types import Cameras
from .. import _gaussian_ply
from .._seeding import seed_points
from .._types import Budget, Capabilities, Report, Trained, TrainingSet

MODEL = "model.ply"
RECORD = "model.json"
REMEDY = "install a CUDA toolkit of torch's CUDA version, or a gsplat wheel built for this torch"
NOT_COMPILED = f"gsplat's CUDA code is not compiled and no nvcc is here to do it; {REMEDY}"


@dataclass(frozen=True)
class Gsplat:
    """The backend on one device. `rasterize` stands in for gsplat's own where a test has no GPU."""

    device: str = "cuda"
    rasterize: Callable | None = None

    CAPABILITIES = Capabilities(
        device="cuda",
        deterministic=False,  # the CUDA kernels add gradients up in no fixed order
        options={
            "strategy": "default",  # or "mcmc": 3DGS as Markov chain Monte Carlo
            "points": "scene",  # or "selected", "random": see _seeding.py
            "random_points": 100_000,
            "sh_degree": 3,
            "background": "black",  # or "white", as the paper's authors train
            "cap": 0,  # no growth once there are so many Gaussians; 0: none for "default", 1,000,000 for "mcmc"
        },
    )

    def available(self) -> str | None:
        reason = extras.missing("gsplat", "torch", use="training on a GPU needs", extra="gpu")
        if reason:
            return reason
        if not self.device.startswith("cuda"):
            return f"[compute] device is '{self.device}', and gsplat needs a CUDA device; set it to 'auto' or 'cuda'"
        import torch

        if torch.version.cuda is None:
            return f"torch {torch.__version__} is built without CUDA; install a CUDA build of it (pytorch.org)"
        if not torch.cuda.is_available():
            return "no CUDA device is in reach; check `nvidia-smi` and CUDA_VISIBLE_DEVICES"
        if not _compiled() and not _compiler():
            return NOT_COMPILED
        return None

    def warm(self) -> None:
        """Compiles gsplat's CUDA code, minutes the first time, before several jobs would start to at once.

        Raises UserError when there is no compiler, or it fails.
        """
        try:
            from gsplat.cuda._backend import _C
        except (ImportError, OSError, RuntimeError) as error:
            raise UserError(f"gsplat's CUDA code could not be compiled: {error}; {REMEDY}") from None
        if _C is None:
            raise UserError(NOT_COMPILED)

    def version(self) -> str:
        versions = (f"{name} {importlib.metadata.version(name)}" for name in ("gsplat", "torch"))
        return ", ".join(versions)

    def train(
        self, data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict[str, Any], report: Report
    ) -> Trained:
        """Trains on the chosen views and writes model.ply in the 3DGS authors' layout, and model.json.

        Raises UserError for an option out of its range, points that the scene does not have, and when the GPU's
        memory is full.
        """
        from .trainer import Task, fit

        _check(options)
        rng = np.random.default_rng(seed)
        xyz, rgb, seeding = seed_points(data, options["points"], rng, options["random_points"])
        task = Task(data, seed, budget, options, report)
        gaussians, near, trained = fit(task, xyz, rgb, self.device, self.rasterizer())
        _gaussian_ply.save(out / MODEL, gaussians)
        write_json(out / RECORD, {"background": options["background"], "near": near})
        return Trained(seeding=seeding, **trained)

    def render(self, model: Path, cameras: Cameras) -> Iterator[np.ndarray]:
        from .renderer import Renderer

        record = read_json(model / RECORD, "model record")
        gaussians = _gaussian_ply.load(model / MODEL)
        renderer = Renderer(self.rasterizer(), self.device, record["background"], record["near"])
        yield from renderer.images(renderer.parameters(gaussians), cameras, gaussians.degree)

    def rasterizer(self) -> Callable:
        """gsplat's `rasterization`, its CUDA code compiled."""
        if self.rasterize is not None:
            return self.rasterize
        self.warm()
        from gsplat import rasterization

        return rasterization


def _compiled() -> bool:
    """Whether gsplat came with its CUDA code compiled."""
    return importlib.util.find_spec("gsplat.csrc") is not None


def _compiler() -> bool:
    """Whether gsplat can compile it when it is first used."""
    from torch.utils.cpp_extension import CUDA_HOME

    return CUDA_HOME is not None or shutil.which("nvcc") is not None


def _check(options: dict[str, Any]) -> None:
    for option, known in (("strategy", ("default", "mcmc")), ("background", ("black", "white"))):
        if options[option] not in known:
            raise UserError(f"option '{option}' is '{options[option]}', expected {' or '.join(map(repr, known))}")
    if not 0 <= options["sh_degree"] <= 3:
        raise UserError(f"option 'sh_degree' is {options['sh_degree']}, expected 0 to 3")
    for option, least in (("cap", 0), ("random_points", 1)):
        if options[option] < least:
            raise UserError(f"option '{option}' is {options[option]}, expected {least} or more")


def configured(argument: str, settings: Settings) -> Gsplat:
    """The backend on the device that environment.toml names; "auto" is the first CUDA device."""
    if argument:
        raise UserError(f"backend 'gsplat' takes no name behind a colon, got '{argument}'")
    device = settings.compute.device
    return Gsplat("cuda" if device == "auto" else device)
