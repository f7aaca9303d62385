"""Which splats touch which 8 x 8 tile, each tile's in order of depth.

One radix sort of the visible splats by depth, then each splat is written to the tiles that its ellipse
{d : dᵀ Q d < cut} touches, row of tiles by row of tiles, found exactly; a counting fill keeps the depth order in each
tile. Every (splat, tile) pair has a slot of its own for gradients, grouped by splat: no atomics, and the same bytes on
every run.
"""

import math
from typing import NamedTuple

import numpy as np

from ...common.kernels import compiled
from .kernels import HALF, ONE, ZERO, F
from .projection import (
    CONIC_A,
    CONIC_B,
    CONIC_C,
    CUT,
    DEPTH,
    HALF_HEIGHT,
    X,
    Y,
)

TILE = 8  # pixels; 64 of them are a few vectors, and small tiles waste little on small splats


class Order(NamedTuple):
    """Visible splats in order of depth, and what sorting them takes."""

    indices: np.ndarray  # (N,) int64, the first of them used, nearest first
    keys: np.ndarray  # (N,) uint32, log depth in 22 bits
    scratch: np.ndarray  # (N,) int64, indices half sorted
    scratch_keys: np.ndarray  # (N,) uint32

    @classmethod
    def zeros(cls, capacity: int) -> "Order":
        """Room for so many Gaussians."""
        return cls(*(np.zeros(capacity, kind) for kind in (np.int64, np.uint32, np.int64, np.uint32)))


class Slots(NamedTuple):
    """One slot for each of the P pairs (splat, tile) that touch, grouped by splat."""

    first: np.ndarray  # (N,) int64, where a splat's slots begin
    number: np.ndarray  # (N,) int64, how many there are, 0 for splats that are not drawn
    tile: np.ndarray  # (at least P,) int64, by slot
    splat: np.ndarray  # (at least P,) int64, by slot

    @classmethod
    def zeros(cls, capacity: int, pairs: int) -> "Slots":
        """Room for so many Gaussians and pairs."""
        return cls(*(np.zeros(size, np.int64) for size in (capacity, capacity, pairs, pairs)))


class Tiles(NamedTuple):
    """A picture's tiles, row by row, each with the list of its slots."""

    width: int  # pixels of the picture
    height: int  # pixels
    lists: np.ndarray  # (at least P,) int64 slots, tile after tile, nearest first
    starts: np.ndarray  # (tiles + 1,) int64, where a tile's list begins
    stops: np.ndarray  # (tiles,) int64, where drawing left it, since nothing behind is seen

    @classmethod
    def zeros(cls, width: int, height: int, pairs: int) -> "Tiles":
        """Of a picture, with room for so many pairs."""
        tiles = -(-width // TILE) * -(-height // TILE)
        return cls(width, height, *(np.zeros(size, np.int64) for size in (pairs, tiles + 1, tiles)))


@compiled
def sort_visible(n, extents, order):
    """Writes the indices of visible splats among the first n, nearest first, into the order; returns their number.

    Sorts 22 bits of log depth, 11 at a time: neighbours closer than 3e-6 of the range keep their storage order.
    """
    indices, keys, scratch, scratch_keys = order
    visible = 0
    nearest, farthest = np.inf, 0.0
    for i in range(n):
        if extents[i, CUT] > ZERO:
            indices[visible] = i
            visible += 1
            nearest, farthest = min(nearest, extents[i, DEPTH]), max(farthest, extents[i, DEPTH])
    if visible == 0:
        return 0
    low = math.log(nearest)
    largest = 2**22 - 1
    scale = largest / max(math.log(farthest) - low, 1e-6)
    first, second = np.zeros(2048, np.int64), np.zeros(2048, np.int64)
    for j in range(visible):
        # Clamped: where all depths are nearly one, rounding alone would lead out of the table.
        key = np.uint32(min(max((math.log(extents[indices[j], DEPTH]) - low) * scale, 0.0), largest))
        keys[j] = key
        first[key & 2047] += 1
        second[key >> 11] += 1
    start, other = 0, 0
    for bucket in range(2048):
        start, first[bucket] = start + first[bucket], start
        other, second[bucket] = other + second[bucket], other
    for j in range(visible):
        bucket = keys[j] & 2047
        scratch[first[bucket]], scratch_keys[first[bucket]] = indices[j], keys[j]
        first[bucket] += 1
    for j in range(visible):
        bucket = scratch_keys[j] >> 11
        indices[second[bucket]] = scratch[j]
        second[bucket] += 1
    return visible


@compiled
def fill_tiles(visible, order, splats, slots, tiles):
    """Fills slots and tiles with the `visible` first splats of the order; returns the number of pairs.

    It is -1 when they do not fit. The number of slots of splats that are not visible is set to 0 by the caller.
    """
    indices, drawn, extents = order.indices, splats.drawn, splats.extents
    width, height, lists, starts, _ = tiles
    across, down = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    counts = np.zeros(across * down + 1, np.int64)
    pairs = 0
    capacity = slots.tile.shape[0]
    size, inverse_size = F(TILE), F(1 / TILE)
    for j in range(visible):
        i = indices[j]
        x, y = drawn[i, X], drawn[i, Y]
        a, b, c = extents[i, CONIC_A], extents[i, CONIC_B], extents[i, CONIC_C]
        cut, half_height = extents[i, CUT], extents[i, HALF_HEIGHT]
        top = max(0, math.floor((y - half_height - HALF) * inverse_size))
        bottom = min(down - 1, math.floor((y + half_height - HALF) * inverse_size))
        if pairs + (bottom - top + 1) * across > capacity:
            return -1
        begin = pairs
        # At height d the ellipse spans x - (b/a) d ± sqrt(cut/a - det/a² d²); it is widest to the right at d_right.
        inverse_a = ONE / a
        slope, square = b * inverse_a, cut * inverse_a
        curve = (a * c - b * b) * inverse_a * inverse_a
        d_right = -b * np.sqrt(cut / (c * (a * c - b * b)))
        for row in range(top, bottom + 1):
            low = max(F(row) * size + HALF - y, -half_height)
            high = min(F(row) * size + size - HALF - y, half_height)
            if low > high:
                # The extreme lies between two rows of pixel centres: the row of tiles has none inside.
                continue
            at = min(max(d_right, low), high)
            right = x - slope * at + np.sqrt(max(ZERO, square - curve * at * at))
            at = min(max(-d_right, low), high)
            left = x - slope * at - np.sqrt(max(ZERO, square - curve * at * at))
            first_pixel, last_pixel = math.ceil(left - F(0.501)), math.floor(right - F(0.499))
            if last_pixel < first_pixel or last_pixel < 0 or first_pixel >= width:
                continue
            for column in range(max(first_pixel, 0) // TILE, min(last_pixel, width - 1) // TILE + 1):
                tile = row * across + column
                slots.tile[pairs], slots.splat[pairs] = tile, i
                counts[tile] += 1
                pairs += 1
        slots.first[i], slots.number[i] = begin, pairs - begin
    total = 0
    for tile in range(across * down):
        starts[tile] = total
        total, counts[tile] = total + counts[tile], total
    starts[across * down] = total
    for slot in range(pairs):
        tile = slots.tile[slot]
        lists[counts[tile]] = slot
        counts[tile] += 1
    return pairs
