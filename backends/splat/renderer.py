"""Draws one picture after another: holds the working memory and calls the kernels in turn."""

import numpy as np

from .binning import Order, Slots, Tiles, fill_tiles, sort_visible
from .kernels import F
from .layout import rows
from .options import Rendering
from .planes import Planes
from .projection import Splats, View, project
from .raster import render


class Renderer:
    """Draws pictures of one size, of up to `capacity` Gaussians. Not for use by several threads."""

    def __init__(self, capacity: int, width: int, height: int, rendering: Rendering):
        self.width, self.height, self.rendering = width, height, rendering
        self.background = np.full(3, rendering.background, np.float32)
        self.planes = Planes(width, height)
        self.padded = self.planes.zeros(3)
        self.image = self.planes.inside(self.padded)
        self.pairs = 0  # of splats and tiles that touch, in the picture drawn last
        self.resize(capacity)

    def resize(self, capacity: int) -> None:
        """Makes room for so many Gaussians."""
        self.splats = Splats.zeros(capacity)
        self.order = Order.zeros(capacity)
        self._make_room(max(65536, 8 * capacity))

    def _make_room(self, pairs: int) -> None:
        self.slots = Slots.zeros(len(self.splats.drawn), pairs)
        self.tiles = Tiles.zeros(self.width, self.height, pairs)

    def view(self, camera: np.ndarray) -> View:
        """How a camera (21,) sees Gaussians here."""
        how = self.rendering
        return View(camera, how.degree, F(how.near), F(how.low_pass), bool(how.antialias))

    def draw(self, gaussians: np.ndarray, camera: np.ndarray) -> np.ndarray:
        """(3, H, W) picture of all columns of `gaussians`; valid until the next call."""
        n, wanted = gaussians.shape[1], rows(self.rendering.degree)
        if len(gaussians) != wanted:
            # The kernels check no bounds: beyond them is other memory.
            raise ValueError(f"{len(gaussians)} rows of parameters, made for {wanted}")
        if n > len(self.splats.drawn):
            raise ValueError(f"{n} Gaussians, made for at most {len(self.splats.drawn)}; resize the renderer")
        project(gaussians, self.view(camera), self.splats)
        visible = sort_visible(n, self.splats.extents, self.order)
        while True:
            self.slots.number[:n] = 0
            self.pairs = fill_tiles(visible, self.order, self.splats, self.slots, self.tiles)
            if self.pairs >= 0:
                break
            self._make_room(2 * len(self.tiles.lists))
        render(self.splats.drawn, self.slots, self.tiles, self.background, self.image)
        return self.image
