"""One training step: draws a view, compares it with its photograph, and moves the Gaussians down the gradient."""

from typing import NamedTuple

import numpy as np

from .backward import Moments, Rates, adam, project_backward, regularise
from .kernels import F
from .layout import rows
from .loss import Target, Workspace, compare, descend, loss
from .options import Rendering
from .raster import PAIR_COLUMNS, render_backward
from .renderer import Renderer
from .team import Team


class Weights(NamedTuple):
    """Of the parts of the loss."""

    ssim: float  # λ; L1 has the rest
    opacity: float = 0.0  # of the sum of opacities
    scale: float = 0.0  # of the sum of scales


class Trainer:
    """Trains on pictures of one size, up to `capacity` Gaussians, with a team of threads."""

    def __init__(self, capacity: int, width: int, height: int, rendering: Rendering, team: Team | None = None):
        self.team = team or Team()
        self.renderer = Renderer(capacity, width, height, rendering, self.team)
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
        picture, weight, work, out = self.renderer.padded, F(ssim_weight), self.workspace, self.padded_gradient
        ranges = self.team.rows(work.height)
        self.team.each(lambda first, last: compare(picture, target, weight, work, first, last), ranges)
        self.team.each(lambda first, last: descend(picture, target, weight, work, out, first, last), ranges)
        return loss(work, ssim_weight)

    def differentiate(self, gaussians: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(rows, N) gradient of what `image_gradient` was set to, for the picture that was drawn last."""
        r, n = self.renderer, gaussians.shape[1]
        columns, pairs = len(r.slots.number), len(r.slots.tile)
        if n > r.capacity or len(gaussians) != len(self.gradient):
            raise ValueError(f"the picture was not drawn of these {n} Gaussians; draw it first")
        # The renderer makes room as it needs it, and the kernels check no bounds.
        if self.gradient.shape[1] != columns:
            self.gradient = np.zeros((len(self.gradient), columns), np.float32)
        if len(self.pair_gradient) != pairs:
            self.pair_gradient = np.zeros((pairs, PAIR_COLUMNS), np.float32)
        drawn, slots, tiles, view = r.splats.drawn, r.slots, r.tiles, r.view(camera)
        image, by_image, stride = r.padded, self.padded_gradient, r.planes.stride
        by_pair, out = self.pair_gradient, self.gradient
        self.team.each(
            lambda *ends: render_backward(drawn, slots, tiles, image, by_image, stride, by_pair, *ends),
            self.team.shares(tiles.starts),
        )
        self.team.each(
            lambda *ends: project_backward(gaussians, view, slots, by_pair, out, *ends),
            self.team.blocks(n),
        )
        return out[:, :n]

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
        self.differentiate(gaussians, camera)
        gradient = self.gradient
        opacity, scale, ranges = F(weights.opacity), F(weights.scale), self.team.blocks(gaussians.shape[1])
        if opacity or scale:
            self.team.each(lambda *ends: regularise(gaussians, opacity, scale, gradient, *ends), ranges)
        self.team.each(lambda *ends: adam(gaussians, gradient, moments, rates, *ends), ranges)
        return value
