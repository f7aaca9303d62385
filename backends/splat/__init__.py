"""3D Gaussian splatting on the CPU: trains from points, writes a model.ply that any splat viewer opens."""

import importlib.metadata
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.errors import UserError
from ...common.files import read_json
from ...scenes.types import Cameras
from .._types import Budget, Capabilities, Report, Trained, TrainingSet
from .options import Options, Rendering, defaults

HUGE = 1e30  # of what is drawn with: float32 holds no more
CAPABILITIES = Capabilities(device="cpu", resumes=True, default_iterations=3000, options=defaults())


def available() -> str | None:
    """Why it cannot run here, or None."""
    return extras.missing("numba")


def version() -> str:
    """Of viewbench, whose own the kernels are, and of what compiles them."""
    from ... import __version__

    return f"viewbench {__version__}, numba {importlib.metadata.version('numba')}"


def warm() -> None:
    """Compiles every kernel into numba's cache; a second call takes a fraction of a second."""
    from .warmup import compile_kernels

    compile_kernels()


def train(data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict, report: Report) -> Trained:
    """Trains on the chosen views and fills `out` with model.ply and what rendering needs beside it."""
    from .loop import train as run

    return run(data, out, seed, budget, options, report)


def render(model: Path, cameras: Cameras) -> Iterator[np.ndarray]:
    """(H, W, 3) float32 pictures of a trained model. Raises UserError for a model that is missing or broken."""
    from . import ply
    from .loop import draw

    settings = read_json(model / "splat.json", "splat settings")
    try:
        rendering = Rendering(**{name: kind(settings[name]) for name, kind in Rendering.__annotations__.items()})
        if not all(abs(float(value)) < HUGE for value in vars(rendering).values()):
            raise ValueError
    except (KeyError, TypeError, ValueError, OverflowError):
        raise UserError(f"'{model / 'splat.json'}' is not what training wrote; train again") from None
    return draw(ply.read(model / "model.ply"), cameras, rendering)


__all__ = ["CAPABILITIES", "Options", "available", "render", "train", "version", "warm"]
