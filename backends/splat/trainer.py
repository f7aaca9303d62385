"""One training step: draws a view, compares it with its photograph, and moves the Gaussians down the gradient."""

from typing import NamedTuple

import numpy as np

from .backward import Moments, Rates, adam, project_backward, regularise
from .kernels import F
from .layout import rows
from .loss import Target, Workspace, loss
from .options import Rendering
from .raster import PAIR_COLUMNS, render_backward
from .renderer import Renderer


class Weights(NamedTuple):
    """Of the parts of the loss."""

    ssim: float  # λ; L1 has the rest
    opacity: float = 0.0  # of the sum of opacities
    scale: float = 0.0  # of the sum of scales


class Trainer:
    """Trains on pictures of one size, up to `capacity` Gaussians. Not for use by several threads."""

    def __init__(self, capacity: int, width: int, height: int, rendering: Rendering):
        self.renderer = Renderer(capacity, width, height, rendering)
        planes = self.renderer.planes
        self.workspace = Workspace.of(planes)
        self.padded_gradient = planes.zeros(3)
        self.image_gradient = planes.inside(self.padded_gradient)
        self.gradient = np.zeros((rows(rendering.degree), 0), np.float32)
        self.pair_gradient = np.zeros((0, PAIR_COLUMNS), np.float32)

    def target(self, image: np.ndarray) -> Target:
        """What a training image (H, W, 3) is to `compare`."""
        return Target.of(image, self.renderer.planes)

    def compare(self, target: Target, ssim_weight: float) -> float:
        """The loss of the picture drawn last; sets `image_gradient`."""
        return loss(self.renderer.padded, target, F(ssim_weight), self.workspace, self.padded_gradient)

    def differentiate(self, gaussians: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(rows, capacity) gradient of what `image_gradient` was set to, for the picture that was drawn last."""
        r, n = self.renderer, gaussians.shape[1]
        capacity, pairs = len(r.splats.drawn), len(r.slots.tile)
        if n > capacity or len(gaussians) != len(self.gradient):
            raise ValueError(f"the picture was not drawn of these {n} Gaussians; draw it first")
        # The renderer makes room as it needs it, and the kernels check no bounds.
        if self.gradient.shape[1] != capacity:
            self.gradient = np.zeros((len(self.gradient), capacity), np.float32)
        if len(self.pair_gradient) != pairs:
            self.pair_gradient = np.zeros((pairs, PAIR_COLUMNS), np.float32)
        render_backward(r.splats.drawn, r.slots, r.tiles, r.image, self.image_gradient, self.pair_gradient)
        project_backward(gaussians, r.view(camera), r.slots, self.pair_gradient, self.gradient)
        return self.gradient

    def step(
        self,
        gaussians: np.ndarray,
        moments: Moments,
        camera: np.ndarray,
        target: Target,
        rates: Rates,
        weights: Weights,
    ) -> float:
        """One step of training on one view, which moves `gaussians` and `moments`; returns the loss."""
        self.renderer.draw(gaussians, camera)
        value = self.compare(target, weights.ssim)
        gradient = self.differentiate(gaussians, camera)
        if weights.opacity or weights.scale:
            regularise(gaussians, F(weights.opacity), F(weights.scale), gradient)
        adam(gaussians, gradient, moments, rates)
        return value
