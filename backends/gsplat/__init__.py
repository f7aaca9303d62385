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
from .._points import DRAWN, Wanted, knowing, starting_points
from .._surroundings import surroundings
from .._types import Budget, Capabilities, Report, Trained, TrainingSet

MODEL = "model.ply"
RECORD = "model.json"
STRATEGIES = ("default", "mcmc")
REMEDY = "install a CUDA toolkit of torch's CUDA version, or a gsplat wheel built for this torch"
NOT_COMPILED = f"gsplat's CUDA code is not compiled and no nvcc is here to do it; {REMEDY}"


@dataclass(frozen=True)
class Gsplat:
    """The backend on one device. `rasterize` stands in for gsplat's own where a test has no GPU."""

    device: str = "cuda"
    rasterize: Callable | None = None

    CAPABILITIES = Capabilities(
        device="cuda",
        resumes=True,
        deterministic=False,  # the CUDA kernels add gradients up in no fixed order
        options={
            "strategy": "default",  # or "mcmc": 3DGS as Markov chain Monte Carlo
            "points": "scene",  # or any other source of _points
            "drawn_points": DRAWN,  # where the source is none of the scene's
            "gaussians": 0,  # no growth once there are so many; 0: no limit for "default", 1,000,000 for "mcmc"
            "sh_degree": 3,
            "background": 0.0,  # grey level behind everything; 1 is white, as the paper's authors train
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
            from gsplat.cuda import _backend
        except (ImportError, OSError, RuntimeError) as error:
            raise UserError(f"gsplat's CUDA code could not be compiled: {error}; {REMEDY}") from None
        if _backend._C is None:
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
        data = knowing(data, options["points"])
        around = surroundings(data.training, data.points)
        wanted = Wanted(options["points"], options["gaussians"] or None, options["drawn_points"])
        starts, seeding = starting_points(data, wanted, around, np.random.default_rng(seed))
        task = Task(data, around, out, seed, budget, options, report)
        gaussians, near, trained = fit(task, starts, self.device, self.rasterizer())
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
        # Where the package is not installed, a type checker takes this folder for it.
        from gsplat import rasterization  # pyright: ignore[reportAttributeAccessIssue]

        return rasterization


def _compiled() -> bool:
    """Whether gsplat came with its CUDA code compiled."""
    return importlib.util.find_spec("gsplat.csrc") is not None


def _compiler() -> bool:
    """Whether gsplat can compile it when it is first used."""
    from torch.utils.cpp_extension import CUDA_HOME

    return CUDA_HOME is not None or shutil.which("nvcc") is not None


def _check(options: dict[str, Any]) -> None:
    if options["strategy"] not in STRATEGIES:
        raise UserError(f"option 'strategy' is '{options['strategy']}', expected 'default' or 'mcmc'")
    for option, most in (("sh_degree", 3), ("background", 1)):
        if not 0 <= options[option] <= most:
            raise UserError(f"option '{option}' is {options[option]}, expected 0 to {most}")
    for option, least in (("gaussians", 0), ("drawn_points", 1)):
        if options[option] < least:
            raise UserError(f"option '{option}' is {options[option]}, expected {least} or more")


def configured(argument: str, settings: Settings) -> Gsplat:
    """The backend on the device that environment.toml names: the one that the process holds (common/gpu.py)."""
    if argument:
        raise UserError(f"backend 'gsplat' takes no name behind a colon, got '{argument}'")
    device = settings.compute.device
    return Gsplat("cuda" if device == "auto" or device.startswith("cuda:") else device)
