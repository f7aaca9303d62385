"""Alpha blending front to back, tile by tile (3DGS, Eqs. 2 and 3), and its gradient.

C = Σᵢ cᵢ αᵢ Tᵢ with Tᵢ = Πⱼ₍ⱼ₌₁..ᵢ₋₁₎ (1 - αⱼ) and αᵢ = min(0.99, oᵢ exp(-½ dᵀ Qᵢ d)), dropped below 1/255.

The backward pass goes front to back too. With G the image gradient at a pixel and B the background, ⟨G, C⟩ is known
from the forward pass, so the part of it that lies behind splat i is found by subtraction as one scalar:
∂L/∂αᵢ · αᵢ = wᵢ (⟨G, cᵢ⟩ - (⟨G, C⟩ behind i) / Tᵢ₊₁), wᵢ = αᵢ Tᵢ.
"""

import numpy as np

from ...common.kernels import exact, written
from ...common.lane_functions import dot, exp2_short
from ...common.lanes import (
    aligned,
    bits,
    fma,
    load,
    load_square,
    lowest,
    smaller,
    spread,
    store,
    store_row,
    store_square,
    sums,
    where,
)
from .binning import QUARTER
from .kernels import HALF, ONE, ZERO, F
from .planes import RADIUS
from .projection import BLUE, GREEN, LOG2_OPACITY, MIN_ALPHA_LOG2, RED, TILE, A, B, C, X, Y

LOG2_MAX_ALPHA = F(-0.01449956969)  # log2 0.99
OPAQUE = F(1e-4)  # transmittance below which nothing behind is seen; a tile stops when all its pixels are there
FAINT = F(1e-30)  # added to a transmittance before it divides: behind many opaque splats it is 0
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
def _pair(drawn, slots, slot, left, upper):
    """Which quarters of a tile at (left, upper) a splat touches, its mean from there, conic, opacity and colour."""
    i, quarters = slots.splat[slot] >> 4, np.int64(slots.splat[slot] & 15)
    x, y, a, b, c = left - drawn[i, X], upper - drawn[i, Y], drawn[i, A], drawn[i, B], drawn[i, C]
    return quarters, x, y, a, b, c, drawn[i, LOG2_OPACITY], drawn[i, RED], drawn[i, GREEN], drawn[i, BLUE]


@written
def _alpha(x, y, a, b, c, opacity):
    """Alpha of 16 pixels at (x, y) from the mean, and its log2 before it is cut."""
    across = fma(a, x, b * y)
    e = fma(-x, across, fma(-(c * y), y, opacity))
    below = smaller(e, spread(LOG2_MAX_ALPHA)) if opacity > LOG2_MAX_ALPHA else e
    return where(e > -MIN_ALPHA_LOG2, exp2_short(below), spread(ZERO)), e


@written
def _opaque(memory, own):
    """Whether nothing behind is seen in any pixel of the tile."""
    upper = (load(memory, own) > OPAQUE) | (load(memory, own + 16) > OPAQUE)
    return bits(upper | (load(memory, own + 32) > OPAQUE) | (load(memory, own + 48) > OPAQUE)) == 0


@exact
def render(drawn, slots, tiles, background, image, stride, first, last):
    """Draws splats (N, SPLAT_COLUMNS) in tiles `first` to `last` of an image; sets where tiles' lists stop.

    It lies in padded planes (3, size) with rows of `stride`; `background` (3,) is what is behind all of them.
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
            quarters, x, y, a, b, c, opacity, red, green, blue = _pair(drawn, slots, lists[k], left, upper)
            k += 1
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
        for q in range(4):
            x, y, p = x0 + QUARTER * (q & 1), y0 + QUARTER * (q >> 1), own + 16 * q
            at, rest = (y + RADIUS) * stride + x + RADIUS, load(memory, T + p)
            whole = x + QUARTER <= width and y + QUARTER <= height
            for c in range(3):
                value = fma(rest, background[c], load(memory, SUM_R + c * PIXELS + p))
                if whole:
                    store_square(image[c], at, stride, value)
                    continue
                store(memory, SUM_R + c * PIXELS + p, value)
                for row in range(min(QUARTER, height - y)):
                    for column in range(min(QUARTER, width - x)):
                        image[c, at + row * stride + column] = memory[SUM_R + c * PIXELS + p + QUARTER * row + column]


@exact
def render_backward(drawn, slots, tiles, image, image_gradient, stride, pair_gradient, first, last):
    """Fills pair_gradient (P, PAIR_COLUMNS), by slot, for the pairs of tiles `first` to `last`.

    The image and its gradient, which is 0 around it, lie in padded planes (3, size) with rows of `stride`.
    """
    lists, starts, stops = tiles.lists, tiles.starts, tiles.stops
    across = (tiles.width + TILE - 1) // TILE
    memory = np.empty(5 * PIXELS + 16, np.float32)
    own = aligned(memory)
    columns, rows = _places()
    for tile in range(first, last):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        left, upper = F(x0) + HALF, F(y0) + HALF
        for q in range(4):
            p = own + 16 * q
            at = (y0 + QUARTER * (q >> 1) + RADIUS) * stride + x0 + QUARTER * (q & 1) + RADIUS
            r, g = load_square(image_gradient[0], at, stride), load_square(image_gradient[1], at, stride)
            b_ = load_square(image_gradient[2], at, stride)
            red, green = load_square(image[0], at, stride), load_square(image[1], at, stride)
            store(memory, T + p, spread(ONE))
            store(memory, SUM_R + p, r)
            store(memory, SUM_G + p, g)
            store(memory, SUM_B + p, b_)
            store(memory, BEHIND + p, dot(r, red, g, green, b_, load_square(image[2], at, stride)))
        for k in range(starts[tile], stops[tile]):
            slot = lists[k]
            quarters, x, y, a, b, c, opacity, red, green, blue = _pair(drawn, slots, slot, left, upper)
            s_0 = s_x = s_y = s_xx = s_xy = s_yy = w_r = w_g = w_b = spread(ZERO)
            while quarters:
                q = lowest(quarters)
                quarters &= quarters - 1
                p = own + 16 * q
                dx, dy = load(columns, 16 * q) + x, load(rows, 16 * q) + y
                alpha, e = _alpha(dx, dy, a, b, c, opacity)
                through = load(memory, T + p)
                weight = alpha * through
                through = through - weight
                store(memory, T + p, through)
                by_r, by_g, by_b = load(memory, SUM_R + p), load(memory, SUM_G + p), load(memory, SUM_B + p)
                colour = dot(by_r, red, by_g, green, by_b, blue)
                behind = fma(-weight, colour, load(memory, BEHIND + p))
                store(memory, BEHIND + p, behind)
                s = weight * (colour - behind / (through + FAINT))
                if opacity > LOG2_MAX_ALPHA:
                    s = where(e < LOG2_MAX_ALPHA, s, spread(ZERO))
                sx, sy = s * dx, s * dy
                s_0, s_x, s_y = s_0 + s, s_x + sx, s_y + sy
                s_xx, s_xy, s_yy = fma(sx, dx, s_xx), fma(sx, dy, s_xy), fma(sy, dy, s_yy)
                w_r, w_g, w_b = fma(weight, by_r, w_r), fma(weight, by_g, w_g), fma(weight, by_b, w_b)
            store_row(pair_gradient, slot, 0, sums((s_0, s_x, s_y, s_xx, s_xy, s_yy, w_r, w_g, w_b)))
        for k in range(stops[tile], starts[tile + 1]):
            store_row(pair_gradient, lists[k], 0, spread(ZERO))
