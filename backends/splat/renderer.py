"""Draws one picture after another: holds the working memory and calls the kernels in turn."""

import numpy as np

from .binning import Order, Slots, Tiles, fill_lists, fill_slots, place_lists, place_slots, sort_visible
from .kernels import F
from .layout import rows
from .options import Rendering
from .planes import Planes
from .projection import Splats, View, project
from .raster import render
from .team import Team


class Renderer:
    """Draws pictures of one size, of up to `capacity` Gaussians, with a team of its own or a trainer's."""

    def __init__(self, capacity: int, width: int, height: int, rendering: Rendering, team: Team | None = None):
        self.width, self.height, self.rendering = width, height, rendering
        self.team = team or Team()
        self.background = np.full(3, rendering.background, np.float32)
        self.planes = Planes(width, height)
        self.padded = self.planes.zeros(3)
        self.image = self.planes.inside(self.padded)
        self.visible = self.pairs = 0  # splats, and pairs of them and tiles that touch, in the picture drawn last
        self.resize(capacity)

    def resize(self, capacity: int) -> None:
        """Makes room for so many Gaussians."""
        self.capacity, columns = capacity, 16 * -(-capacity // 16)
        self.splats = Splats.zeros(columns, self.team.parts)
        self.order = Order.zeros(columns)
        self._make_room(max(65536, 8 * capacity))

    def _make_room(self, pairs: int) -> None:
        self.slots = Slots.zeros(len(self.order.indices), pairs)
        self.tiles = Tiles.zeros(self.width, self.height, pairs, self.team.parts)

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
        if n > self.capacity:
            raise ValueError(f"{n} Gaussians, made for at most {self.capacity}; resize the renderer")
        view, splats, order, team = self.view(camera), self.splats, self.order, self.team
        ranges = [(part, *ends) for part, ends in enumerate(team.blocks(n))]
        team.each(lambda *part: project(gaussians, view, splats, *part), ranges)
        visible = sort_visible(splats, splats.depth.view(np.uint32), len(ranges), order)
        self.visible = visible
        room = place_slots(visible, order, splats, self.slots)
        if room > len(self.tiles.lists):
            self._make_room(room + room // 2)
            place_slots(visible, order, splats, self.slots)
        slots, tiles = self.slots, self.tiles
        parts = [(part, *ends) for part, ends in enumerate(team.blocks(visible, 1))]
        used = tiles._replace(counts=tiles.counts[: len(parts)])
        team.each(lambda *part: fill_slots(order, splats, slots, used, *part), parts)
        self.pairs = place_lists(used)
        team.each(lambda *part: fill_lists(order, splats, slots, used, *part), parts)
        team.each(
            lambda *ends: render(splats.drawn, slots, tiles, self.background, self.padded, self.planes.stride, *ends),
            team.shares(tiles.starts),
        )
        return self.image
