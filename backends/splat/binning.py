"""Which splats touch which 8 x 8 tile, each tile's in order of depth.

One radix sort of the visible splats by depth, then each splat is written to the tiles that its ellipse
{d : dᵀ Q d < cut} touches, row of quarters by row of quarters, with those 4 x 4 quarters of a tile that it touches; a
counting fill keeps the depth order in each tile. Every (splat, tile) pair has a slot of its own for gradients, grouped
by splat: no atomics, and the same bytes on every run and for any number of threads.
"""

import math
from typing import NamedTuple

import numpy as np

from ...common.kernels import exact, written
from ...common.lanes import floor, fma, larger, numbers, smaller, spread, sqrt, store_whole, where
from .kernels import HALF, ONE, ZERO, F
from .projection import CURVE, HALF_HEIGHT, SLOPE, SQUARE, TILE, WIDEST, X, Y

QUARTER = TILE // 2  # pixels
ROWS = 8  # of quarters that are looked at at once
AT_ONCE = 31  # tiles of a row, whose quarters fit the bits of a word
NOWHERE = 1 << 24
FAR = F(1 << 24)  # pixels


class Order(NamedTuple):
    """Visible splats in order of depth, and what sorting them takes."""

    indices: np.ndarray  # (N,) int32 places among the splats, the first of them used, nearest first
    keys: np.ndarray  # (N,) uint32, depth in 22 bits
    scratch: np.ndarray  # (N,) int32, indices half sorted
    scratch_keys: np.ndarray  # (N,) uint32

    @classmethod
    def zeros(cls, capacity: int) -> "Order":
        """Room for so many Gaussians."""
        return cls(*(np.zeros(capacity, kind) for kind in (np.int32, np.uint32, np.int32, np.uint32)))


class Slots(NamedTuple):
    """Slots of the pairs (splat, tile) that touch, grouped by splat; between the groups some stay empty."""

    first: np.ndarray  # (N,) int32, where a Gaussian's slots begin
    number: np.ndarray  # (N,) int32, how many there are, 0 for those that are not drawn
    tile: np.ndarray  # (P,) int32, by slot
    # (P,) int32, by slot: the place among the splats, in the last 4 bits which quarters are touched: upper left, upper
    # right, lower left, lower right.
    splat: np.ndarray

    @classmethod
    def zeros(cls, capacity: int, pairs: int) -> "Slots":
        """Room for so many Gaussians and pairs."""
        first, number = np.zeros(capacity, np.int32), np.zeros(capacity, np.int32)
        return cls(first, number, np.zeros(pairs, np.int32), np.zeros(pairs, np.int32))


class Tiles(NamedTuple):
    """A picture's tiles, row by row, each with the list of its slots."""

    width: int  # pixels of the picture
    height: int  # pixels
    lists: np.ndarray  # (P,) int32 slots, tile after tile, nearest first
    starts: np.ndarray  # (tiles + 1,) int64, where a tile's list begins
    stops: np.ndarray  # (tiles,) int64, where drawing left it, since nothing behind is seen
    counts: np.ndarray  # (parts, tiles) int64: pairs that each part of the order has in it, then where they go

    @classmethod
    def zeros(cls, width: int, height: int, pairs: int, parts: int) -> "Tiles":
        """Of a picture, with room for so many pairs, filled in so many parts."""
        tiles = -(-width // TILE) * -(-height // TILE)
        sizes = tiles + 1, tiles, (parts, tiles)
        return cls(width, height, np.zeros(pairs, np.int32), *(np.zeros(size, np.int64) for size in sizes))


@exact
def sort_visible(splats, depth, parts, order):
    """Writes the places of the splats of so many ranges, nearest first, into the order; returns their number.

    `depth` (N,) is that of the splats as uint32, which has the same order: positive floats count like their bits.
    Sorts 22 bits of them, 11 at a time: neighbours closer than 4e-6 of their depth keep their storage order (for
    depths within a factor of 256).
    """
    indices, keys, scratch, scratch_keys = order
    visible = 0
    nearest, farthest = np.uint32(0xFFFFFFFF), np.uint32(0)
    for part in range(parts):
        for place in range(splats.ranges[part, 0], splats.ranges[part, 0] + splats.ranges[part, 1]):
            key = depth[place]
            indices[visible], keys[visible] = place, key
            visible += 1
            nearest, farthest = min(nearest, key), max(farthest, key)
    if visible == 0:
        return 0
    drop = np.uint32(0)
    while (farthest - nearest) >> drop >= np.uint32(1 << 22):
        drop += np.uint32(1)
    first, second = np.zeros(2048, np.int64), np.zeros(2048, np.int64)
    for j in range(visible):
        key = (keys[j] - nearest) >> drop
        keys[j] = key
        first[key & np.uint32(2047)] += 1
        second[key >> np.uint32(11)] += 1
    start, other = 0, 0
    for bucket in range(2048):
        start, first[bucket] = start + first[bucket], start
        other, second[bucket] = other + second[bucket], other
    for j in range(visible):
        bucket = keys[j] & np.uint32(2047)
        scratch[first[bucket]], scratch_keys[first[bucket]] = indices[j], keys[j]
        first[bucket] += 1
    for j in range(visible):
        bucket = scratch_keys[j] >> np.uint32(11)
        indices[second[bucket]] = scratch[j]
        second[bucket] += 1
    return visible


@exact
def place_slots(visible, order, splats, slots):
    """Gives each of the `visible` first splats of the order its slots; returns how many there must be."""
    total = 0
    slots.number[:] = 0
    for j in range(visible):
        place = order.indices[j]
        slots.first[splats.gaussian[place]] = total
        total += splats.most[place]
    return total


@written
def _word(begin, end, start):
    """Bits from `start` on of the quarters from `begin` to `end`, of as many tiles as are looked at at once."""
    low, high = min(max(begin - start, 0), 2 * AT_ONCE), min(max(end + 1 - start, 0), 2 * AT_ONCE)
    return (1 << max(low, high)) - (1 << low)


@exact
def fill_slots(order, splats, slots, tiles, part, first, last):
    """Fills the slots of splats `first` to `last` of the order, and counts their pairs tile by tile."""
    width, height, counts, drawn = tiles.width, tiles.height, tiles.counts[part], splats.drawn
    across, down = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    counts[:] = 0
    edges = np.empty(2 * ROWS, np.int32)
    inverse_tile = F(1 / TILE)
    # Right edges of 8 rows of quarters, then their left ones: one vector of both, told apart by a sign.
    right = numbers() < F(ROWS)
    side = where(right, spread(ONE), spread(-ONE))
    row_of = where(right, numbers(), numbers() - F(ROWS)) * F(QUARTER)
    # Pixels whose centres are inside, and a thousandth of a pixel around it.
    around = where(right, spread(F(-0.499)), spread(F(0.501)))
    for j in range(first, last):
        i = order.indices[j]
        x, y, half_height = drawn[i, X], drawn[i, Y], drawn[i, HALF_HEIGHT]
        slope, square, curve, widest = drawn[i, SLOPE], drawn[i, SQUARE], drawn[i, CURVE], drawn[i, WIDEST]
        top = max(0, math.floor((y - half_height - HALF) * inverse_tile))
        bottom = min(down - 1, math.floor((y + half_height - HALF) * inverse_tile))
        gaussian = splats.gaussian[i]
        slot = np.int64(slots.first[gaussian])
        begin, limit = slot, slot + splats.most[i]  # beyond it are other slots: rounding of huge splats may lead there
        for group in range(top, bottom + 1, ROWS // 2):
            # What the ellipse spans in 8 rows of quarters, in whole pixels.
            upper = row_of + (F(TILE * group) + HALF - y)
            low = larger(upper, spread(-half_height))
            high = smaller(upper + F(QUARTER - 1), spread(half_height))
            at = smaller(larger(side * widest, low), high)
            reach = sqrt(larger(fma(-curve, at * at, square), spread(ZERO)))
            edge = floor(fma(side, fma(-slope, at, x), reach) + around)
            # The extreme may lie between two rows of pixel centres: then there is none inside.
            edge = where(low <= high, larger(smaller(edge, spread(FAR)), spread(-FAR)), spread(-FAR))
            store_whole(edges, 0, edge)
            for tile_row in range(group, min(group + ROWS // 2, bottom + 1)):
                k = 2 * (tile_row - group)
                begin_0, begin_1 = max(-edges[ROWS + k], 0), max(-edges[ROWS + k + 1], 0)
                end_0, end_1 = min(edges[k], width - 1), min(edges[k + 1], width - 1)
                # From here on in quarters; shifts, since // minds signs.
                begin_0, end_0 = (begin_0 >> 2, end_0 >> 2) if begin_0 <= end_0 else (NOWHERE, -1)
                begin_1, end_1 = (begin_1 >> 2, end_1 >> 2) if begin_1 <= end_1 else (NOWHERE, -1)
                column, end = min(begin_0, begin_1) >> 1, max(end_0, end_1) >> 1
                while column <= end:
                    above, below = _word(begin_0, end_0, 2 * column), _word(begin_1, end_1, 2 * column)
                    stop = min(column + AT_ONCE, end + 1)
                    tile, stop = tile_row * across + column, tile_row * across + stop
                    column += AT_ONCE
                    while tile < stop:
                        quarters = (above & 3) | ((below & 3) << 2)
                        if quarters and slot < limit:
                            slots.tile[slot], slots.splat[slot] = tile, i << 4 | quarters
                            counts[tile] += 1
                            slot += 1
                        above >>= 2
                        below >>= 2
                        tile += 1
        slots.number[gaussian] = slot - begin


@exact
def place_lists(tiles):
    """Turns the counts into places in the lists, the parts' one behind the other in each tile; returns their sum."""
    counts, total = tiles.counts, 0
    for tile in range(counts.shape[1]):
        tiles.starts[tile] = total
        for part in range(counts.shape[0]):
            count = counts[part, tile]
            counts[part, tile] = total
            total += count
    tiles.starts[counts.shape[1]] = total
    return total


@exact
def fill_lists(order, splats, slots, tiles, part, first, last):
    """Puts the slots of splats `first` to `last` of the order into the lists of their tiles."""
    lists, places = tiles.lists, tiles.counts[part]
    for j in range(first, last):
        i = splats.gaussian[order.indices[j]]
        begin = np.int64(slots.first[i])
        for slot in range(begin, begin + slots.number[i]):
            tile = slots.tile[slot]
            lists[places[tile]] = slot
            places[tile] += 1
