"""One picture or one training step: holds the working memory and calls the kernels in turn."""

import numpy as np

from .backward import adam, project_backward, regularise
from .binning import TILE, fill_tiles, sort_visible
from .kernels import F
from .layout import rows
from .loss import Planes, loss
from .options import Rendering
from .projection import EXTENT_COLUMNS, SPLAT_COLUMNS, project
from .raster import PAIR_COLUMNS, render, render_backward


class Engine:
    """Renders and trains pictures of one size, for up to `capacity` Gaussians. Not for use by several threads."""

    def __init__(self, capacity: int, width: int, height: int, rendering: Rendering):
        self.width, self.height, self.degree = width, height, rendering.degree
        self.near, self.low_pass, self.antialias = F(rendering.near), F(rendering.low_pass), bool(rendering.antialias)
        self.background = np.full(3, rendering.background, np.float32)
        self.planes = Planes(width, height)
        self.padded, self.padded_gradient = self.planes.new(), self.planes.new()
        self.image = self.planes.view(self.padded)
        self.image_gradient = self.planes.view(self.padded_gradient)
        self.tiles = -(-width // TILE) * -(-height // TILE)
        self.starts = np.zeros(self.tiles + 1, np.int64)
        self.stops = np.zeros(self.tiles, np.int64)
        self.pairs = 0
        self._make_room(max(65536, 8 * capacity))
        self.resize(capacity)

    def resize(self, capacity: int) -> None:
        """Makes room for so many Gaussians."""
        self.splats = np.zeros((capacity, SPLAT_COLUMNS), np.float32)
        self.extents = np.zeros((capacity, EXTENT_COLUMNS), np.float32)
        self.first_slot, self.slots = np.zeros(capacity, np.int64), np.zeros(capacity, np.int64)
        self.order, self.scratch = np.zeros(capacity, np.int64), np.zeros(capacity, np.int64)
        self.keys, self.scratch_keys = np.zeros(capacity, np.uint32), np.zeros(capacity, np.uint32)
        self.gradient = np.zeros((rows(self.degree), capacity), np.float32)

    def _make_room(self, pairs: int) -> None:
        self.slot_tile, self.slot_splat = np.zeros(pairs, np.int64), np.zeros(pairs, np.int64)
        self.lists = np.zeros(pairs, np.int64)
        self.pair_gradient = np.zeros((pairs, PAIR_COLUMNS), np.float32)

    def draw(self, gaussians: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(3, H, W) picture of all columns of `gaussians`; valid until the next call."""
        n = gaussians.shape[1]
        if len(gaussians) != len(self.gradient):
            # The kernels check no bounds: beyond them is other memory.
            raise ValueError(f"{len(gaussians)} rows of parameters, made for {len(self.gradient)}")
        if n > len(self.splats):
            raise ValueError(f"{n} Gaussians, made for at most {len(self.splats)}; resize the engine")
        project(gaussians, n, camera, self.degree, self.near, self.low_pass, self.antialias, self.splats, self.extents)
        visible = sort_visible(n, self.extents, self.order, self.scratch, self.keys, self.scratch_keys)
        while True:
            self.slots[:n] = 0
            self.pairs = fill_tiles(
                visible,
                self.order,
                self.splats,
                self.extents,
                self.width,
                self.height,
                self.first_slot,
                self.slots,
                self.slot_tile,
                self.slot_splat,
                self.lists,
                self.starts,
            )
            if self.pairs >= 0:
                break
            self._make_room(2 * len(self.lists))
        render(
            self.width,
            self.height,
            self.splats,
            self.slot_splat,
            self.lists,
            self.starts,
            self.stops,
            self.background,
            self.image,
        )
        return self.image

    def differentiate(self, gaussians: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(rows, capacity) gradient of what `image_gradient` was set to, for the picture that `draw` drew last."""
        render_backward(
            self.width,
            self.height,
            self.splats,
            self.slot_splat,
            self.lists,
            self.starts,
            self.stops,
            self.image,
            self.image_gradient,
            self.pair_gradient,
        )
        n = gaussians.shape[1]
        if n > len(self.splats) or len(gaussians) != len(self.gradient):
            raise ValueError(f"the picture was not drawn of these {n} Gaussians; draw it first")
        project_backward(
            gaussians,
            n,
            camera,
            self.degree,
            self.low_pass,
            self.antialias,
            self.first_slot,
            self.slots,
            self.pair_gradient,
            self.gradient,
        )
        return self.gradient

    def compare(self, target: np.ndarray, weight: float) -> float:
        """The loss of the picture drawn last against `Planes.target`; sets `image_gradient`."""
        p = self.planes
        return loss(self.padded, target, p.mask, p.work, self.padded_gradient, p.stride, F(weight), p.width * p.height)

    def step(
        self,
        gaussians: np.ndarray,
        moments: tuple[np.ndarray, np.ndarray],
        camera: np.ndarray,
        target: np.ndarray,
        rates: np.ndarray,
        number: int,
        ssim_weight: float,
        opacity_weight: float = 0.0,
        scale_weight: float = 0.0,
    ) -> float:
        """One step of training on one view; returns the loss. `number` counts from 1."""
        self.draw(gaussians, camera)
        value = self.compare(target, ssim_weight)
        gradient = self.differentiate(gaussians, camera)
        n = gaussians.shape[1]
        if opacity_weight or scale_weight:
            regularise(gaussians, n, gradient, F(opacity_weight), F(scale_weight))
        corrections = F(1 / (1 - 0.9**number)), F(1 / (1 - 0.999**number))
        adam(gaussians, gradient, moments[0], moments[1], n, rates, *corrections)
        return value
