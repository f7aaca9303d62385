"""Renders a PLY file of 3D Gaussians that some other program trained, with whichever of our rasterisers can."""

import importlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from ..scenes.types import Cameras
from . import _gaussian_ply

NEAR = 0.01  # scene units


def render_ply(path: Path, cameras: Cameras, background: Sequence[float], device: str) -> Iterator[np.ndarray]:
    """(H, W, 3) float32 in [0, 1], one for each camera: by gsplat where there is a GPU, else by splat.

    background: red, green, blue in [0, 1], those that the model was trained on; device: "cpu" for splat in any case.
    Raises UserError for a file that is no such PLY.
    """
    gaussians = _gaussian_ply.load(path)
    gsplat = _module("gsplat").Gsplat()
    if device != "cpu" and gsplat.available() is None:
        renderer = _module("gsplat.renderer").Renderer(gsplat.rasterizer(), gsplat.device, background, NEAR)
        yield from renderer.images(renderer.parameters(gaussians), cameras, gaussians.degree)
        return
    rendering = _module("splat.options").Rendering(near=NEAR, background=tuple(background), degree=gaussians.degree)
    model = _module("splat.ply").read(path)
    yield from _module("splat.loop").draw(model, cameras, rendering)


def ply_renderer(device: str) -> str:
    """What `render_ply` draws with here."""
    gsplat = _module("gsplat").Gsplat()
    return gsplat.version() if device != "cpu" and gsplat.available() is None else "splat"


def _module(name: str) -> ModuleType:
    """A module of this folder by name: an edit of a rasteriser is no reason to train another program's models again."""
    return importlib.import_module(f"viewbench.backends.{name}")
