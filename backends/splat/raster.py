"""Alpha blending front to back, tile by tile (3DGS, Eqs. 2 and 3), and its gradient.

C = Σᵢ cᵢ αᵢ Tᵢ with Tᵢ = Πⱼ₍ⱼ₌₁..ᵢ₋₁₎ (1 - αⱼ) and αᵢ = min(0.99, oᵢ exp(-½ dᵀ Qᵢ d)), dropped below 1/255.

The backward pass goes front to back too. With G the image gradient at a pixel and B the background, ⟨G, C⟩ is known
from the forward pass, so the part of it that lies behind splat i is found by subtraction as one scalar:
∂L/∂αᵢ · αᵢ = wᵢ ⟨G, cᵢ⟩ - (⟨G, C⟩ behind i) αᵢ / (1 - αᵢ), wᵢ = αᵢ Tᵢ.
"""

import numpy as np

from ...common.kernels import exact, written
from ...common.lanes import (
    aligned,
    bits,
    dot,
    exp2,
    fma,
    load,
    lowest,
    smaller,
    spread,
    store,
    store_row,
    sums,
    where,
)
from .binning import QUARTER
from .kernels import HALF, ONE, ZERO, F
from .projection import BLUE, GREEN, LOG2_OPACITY, MIN_ALPHA_LOG2, RED, TILE, A, B, C, X, Y

LOG2_MAX_ALPHA = F(-0.01449956969)  # log2 0.99
OPAQUE = F(1e-4)  # transmittance below which nothing behind is seen; a tile stops when all its pixels are there
PIXELS = TILE * TILE  # of a tile: its quarters' one behind the other, 16 each
# Places in a tile's working memory, PIXELS floats each.
T, SUM_R, SUM_G, SUM_B, BEHIND = (PIXELS * place for place in range(5))
# Columns of the gradient of a (splat, tile) pair: sums over pixels of s, s dx, s dy, s dx², s dx dy, s dy² with
# s = ∂L/∂α α, then of w G per channel; the others are 0.
SUMS = 9
PAIR_COLUMNS = 16


@written
def _places():
    """Column and row in its tile of each pixel, in the order of the working memory."""
    columns, rows = np.empty(PIXELS, np.float32), np.empty(PIXELS, np.float32)
    for p in range(PIXELS):
        columns[p] = F(QUARTER * ((p >> 4) & 1) + (p & 3))
        rows[p] = F(QUARTER * (p >> 5) + ((p >> 2) & 3))
    return columns, rows


@written
def _alpha(x, y, a, b, c, opacity):
    """Alpha of 16 pixels at (x, y) from the mean, and its log2 before it is cut."""
    across = fma(a, x, b * y)
    e = fma(-x, across, fma(-(c * y), y, opacity))
    return where(e > -MIN_ALPHA_LOG2, exp2(smaller(e, spread(LOG2_MAX_ALPHA))), spread(ZERO)), e


@written
def _opaque(memory, own):
    """Whether nothing behind is seen in any pixel of the tile."""
    upper = (load(memory, own) > OPAQUE) | (load(memory, own + 16) > OPAQUE)
    return bits(upper | (load(memory, own + 32) > OPAQUE) | (load(memory, own + 48) > OPAQUE)) == 0


@exact
def render(drawn, slots, tiles, background, image, first, last):
    """Draws splats (N, SPLAT_COLUMNS) in tiles `first` to `last` of image (3, H, W); sets where tiles' lists stop.

    `background` (3,) is what is behind all of them.
    """
    width, height, lists, starts, stops, _ = tiles
    across = (width + TILE - 1) // TILE
    memory = np.empty(4 * PIXELS + 16, np.float32)
    own = aligned(memory)
    columns, rows = _places()
    for tile in range(first, last):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        left, upper = F(x0) + HALF, F(y0) + HALF
        for p in range(own, own + PIXELS, 16):
            store(memory, T + p, spread(ONE))
            store(memory, SUM_R + p, spread(ZERO))
            store(memory, SUM_G + p, spread(ZERO))
            store(memory, SUM_B + p, spread(ZERO))
        begin, end = starts[tile], starts[tile + 1]
        k = begin
        while k < end:
            slot = lists[k]
            i, quarters = slots.splat[slot], np.int64(slots.quarters[slot])
            k += 1
            x, y, a, b, c = left - drawn[i, X], upper - drawn[i, Y], drawn[i, A], drawn[i, B], drawn[i, C]
            opacity = drawn[i, LOG2_OPACITY]
            red, green, blue = drawn[i, RED], drawn[i, GREEN], drawn[i, BLUE]
            while quarters:
                q = lowest(quarters)
                quarters &= quarters - 1
                p = own + 16 * q
                dx, dy = load(columns, 16 * q) + x, load(rows, 16 * q) + y
                alpha, _ = _alpha(dx, dy, a, b, c, opacity)
                through = load(memory, T + p)
                weight = alpha * through
                store(memory, T + p, through - weight)
                store(memory, SUM_R + p, fma(weight, red, load(memory, SUM_R + p)))
                store(memory, SUM_G + p, fma(weight, green, load(memory, SUM_G + p)))
                store(memory, SUM_B + p, fma(weight, blue, load(memory, SUM_B + p)))
            if (k - begin) & 3 == 0 and _opaque(memory, own):
                break
        stops[tile] = k
        for row in range(min(TILE, height - y0)):
            for column in range(min(TILE, width - x0)):
                p = own + 32 * (row // QUARTER) + 16 * (column // QUARTER) + QUARTER * (row & 3) + (column & 3)
                rest = memory[T + p]
                image[0, y0 + row, x0 + column] = memory[SUM_R + p] + rest * background[0]
                image[1, y0 + row, x0 + column] = memory[SUM_G + p] + rest * background[1]
                image[2, y0 + row, x0 + column] = memory[SUM_B + p] + rest * background[2]


@exact
def render_backward(drawn, slots, tiles, image, image_gradient, pair_gradient, first, last):
    """Fills pair_gradient (P, PAIR_COLUMNS), by slot, from the image (3, H, W) and its gradient.

    It does so for the pairs of tiles `first` to `last`.
    """
    width, height, lists, starts, stops, _ = tiles
    across = (width + TILE - 1) // TILE
    memory = np.empty(5 * PIXELS + 16, np.float32)
    own = aligned(memory)
    columns, rows = _places()
    for tile in range(first, last):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        left, upper = F(x0) + HALF, F(y0) + HALF
        for p in range(own, own + PIXELS, 16):
            store(memory, T + p, spread(ONE))
            store(memory, SUM_R + p, spread(ZERO))
            store(memory, SUM_G + p, spread(ZERO))
            store(memory, SUM_B + p, spread(ZERO))
            store(memory, BEHIND + p, spread(ZERO))
        for row in range(min(TILE, height - y0)):
            for column in range(min(TILE, width - x0)):
                p = own + 32 * (row // QUARTER) + 16 * (column // QUARTER) + QUARTER * (row & 3) + (column & 3)
                y_, x_ = y0 + row, x0 + column
                r, g, b_ = image_gradient[0, y_, x_], image_gradient[1, y_, x_], image_gradient[2, y_, x_]
                memory[SUM_R + p], memory[SUM_G + p], memory[SUM_B + p] = r, g, b_
                memory[BEHIND + p] = r * image[0, y_, x_] + g * image[1, y_, x_] + b_ * image[2, y_, x_]
        for k in range(starts[tile], stops[tile]):
            slot = lists[k]
            i, quarters = slots.splat[slot], np.int64(slots.quarters[slot])
            x, y, a, b, c = left - drawn[i, X], upper - drawn[i, Y], drawn[i, A], drawn[i, B], drawn[i, C]
            opacity = drawn[i, LOG2_OPACITY]
            red, green, blue = drawn[i, RED], drawn[i, GREEN], drawn[i, BLUE]
            s_0 = s_x = s_y = s_xx = s_xy = s_yy = w_r = w_g = w_b = spread(ZERO)
            while quarters:
                q = lowest(quarters)
                quarters &= quarters - 1
                p = own + 16 * q
                dx, dy = load(columns, 16 * q) + x, load(rows, 16 * q) + y
                alpha, e = _alpha(dx, dy, a, b, c, opacity)
                through = load(memory, T + p)
                weight = alpha * through
                store(memory, T + p, through - weight)
                by_r, by_g, by_b = load(memory, SUM_R + p), load(memory, SUM_G + p), load(memory, SUM_B + p)
                ours = weight * dot(by_r, red, by_g, green, by_b, blue)
                behind = load(memory, BEHIND + p) - ours
                store(memory, BEHIND + p, behind)
                s = where(e < LOG2_MAX_ALPHA, ours - behind * alpha / (ONE - alpha), spread(ZERO))
                sx, sy = s * dx, s * dy
                s_0, s_x, s_y = s_0 + s, s_x + sx, s_y + sy
                s_xx, s_xy, s_yy = fma(sx, dx, s_xx), fma(sx, dy, s_xy), fma(sy, dy, s_yy)
                w_r, w_g, w_b = fma(weight, by_r, w_r), fma(weight, by_g, w_g), fma(weight, by_b, w_b)
            store_row(pair_gradient, slot, 0, sums((s_0, s_x, s_y, s_xx, s_xy, s_yy, w_r, w_g, w_b)))
        for k in range(stops[tile], starts[tile + 1]):
            store_row(pair_gradient, lists[k], 0, spread(ZERO))
