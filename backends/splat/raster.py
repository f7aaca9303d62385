"""Alpha blending front to back, tile by tile (3DGS, Eqs. 2 and 3), and its gradient.

C = Σᵢ cᵢ αᵢ Tᵢ with Tᵢ = Πⱼ₍ⱼ₌₁..ᵢ₋₁₎ (1 - αⱼ) and αᵢ = min(0.99, oᵢ exp(-½ dᵀ Qᵢ d)), dropped below 1/255.

The backward pass goes front to back too. With G the image gradient at a pixel and B the background, ⟨G, C⟩ is known
from the forward pass, so the part of it that lies behind splat i is found by subtraction as one scalar:
∂L/∂αᵢ · αᵢ = wᵢ ⟨G, cᵢ⟩ - (⟨G, C⟩ behind i) αᵢ / (1 - αᵢ), wᵢ = αᵢ Tᵢ.
"""

import numpy as np

from ...common.kernels import compiled
from .binning import TILE
from .kernels import HALF, ONE, ZERO, F, exp2_8
from .projection import BLUE, GREEN, LOG2_OPACITY, MIN_ALPHA_LOG2, RED, A, B, C, X, Y

PIXELS = TILE * TILE
LOG2_MAX_ALPHA = F(-0.01449956969)  # log2 0.99
OPAQUE = F(1e-4)  # transmittance below which nothing behind is seen; a tile stops when all its pixels are there
# Places in a tile's working memory, PIXELS floats each: one buffer, since vector code needs to know that they do not
# overlap.
T, SUM_R, SUM_G, SUM_B, PX, PY, BEHIND = (np.uint64(PIXELS * place) for place in range(7))
# Columns of the gradient of a (splat, tile) pair: sums over pixels of s, s dx, s dy, s dx², s dx dy, s dy² with
# s = ∂L/∂α α, then of w G per channel.
PAIR_COLUMNS = 12


@compiled
def render(drawn, slots, tiles, background, image):
    """Draws splats (N, SPLAT_COLUMNS) on the background (3,) into image (3, H, W); sets where tiles' lists stop."""
    width, height, lists, starts, stops = tiles
    across, down = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    m = np.empty(6 * PIXELS, np.float32)
    for tile in range(across * down):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        for p in range(np.uint64(PIXELS)):
            m[T + p] = ONE
            m[SUM_R + p] = ZERO
            m[SUM_G + p] = ZERO
            m[SUM_B + p] = ZERO
            m[PX + p] = F(x0 + (p & np.uint64(7))) + HALF
            m[PY + p] = F(y0 + (p >> np.uint64(3))) + HALF
        begin, end = starts[tile], starts[tile + 1]
        k = begin
        while k < end:
            i = slots.splat[lists[k]]
            k += 1
            x, y, a, b, c = drawn[i, X], drawn[i, Y], drawn[i, A], drawn[i, B], drawn[i, C]
            opacity = drawn[i, LOG2_OPACITY]
            red, green, blue = drawn[i, RED], drawn[i, GREEN], drawn[i, BLUE]
            for p in range(np.uint64(PIXELS)):
                dx, dy = m[PX + p] - x, m[PY + p] - y
                e = opacity - (a * dx * dx + dy * (b * dx + c * dy))
                alpha = exp2_8(min(e, LOG2_MAX_ALPHA))
                alpha = alpha if e > -MIN_ALPHA_LOG2 else ZERO
                weight = alpha * m[T + p]
                m[T + p] -= weight
                m[SUM_R + p] += weight * red
                m[SUM_G + p] += weight * green
                m[SUM_B + p] += weight * blue
            if (k - begin) & 3 == 0:
                most = ZERO
                for p in range(np.uint64(PIXELS)):
                    most = max(most, m[T + p])
                if most <= OPAQUE:
                    break
        stops[tile] = k
        for row in range(min(TILE, height - y0)):
            for column in range(min(TILE, width - x0)):
                p = row * TILE + column
                rest = m[p]
                image[0, y0 + row, x0 + column] = m[PIXELS + p] + rest * background[0]
                image[1, y0 + row, x0 + column] = m[2 * PIXELS + p] + rest * background[1]
                image[2, y0 + row, x0 + column] = m[3 * PIXELS + p] + rest * background[2]


@compiled
def render_backward(drawn, slots, tiles, image, image_gradient, pair_gradient):
    """Fills pair_gradient (P, PAIR_COLUMNS), by slot, from the image (3, H, W) and its gradient."""
    width, height, lists, starts, stops = tiles
    across, down = (width + TILE - 1) // TILE, (height + TILE - 1) // TILE
    m = np.empty(7 * PIXELS, np.float32)
    for tile in range(across * down):
        x0, y0 = (tile % across) * TILE, (tile // across) * TILE
        for p in range(np.uint64(PIXELS)):
            m[T + p] = ONE
            m[SUM_R + p] = ZERO
            m[SUM_G + p] = ZERO
            m[SUM_B + p] = ZERO
            m[BEHIND + p] = ZERO
            m[PX + p] = F(x0 + (p & np.uint64(7))) + HALF
            m[PY + p] = F(y0 + (p >> np.uint64(3))) + HALF
        for row in range(min(TILE, height - y0)):
            for column in range(min(TILE, width - x0)):
                p, y_, x_ = row * TILE + column, y0 + row, x0 + column
                r, g, b_ = image_gradient[0, y_, x_], image_gradient[1, y_, x_], image_gradient[2, y_, x_]
                m[PIXELS + p], m[2 * PIXELS + p], m[3 * PIXELS + p] = r, g, b_
                m[6 * PIXELS + p] = r * image[0, y_, x_] + g * image[1, y_, x_] + b_ * image[2, y_, x_]
        for k in range(starts[tile], stops[tile]):
            slot = lists[k]
            i = slots.splat[slot]
            x, y, a, b, c = drawn[i, X], drawn[i, Y], drawn[i, A], drawn[i, B], drawn[i, C]
            opacity = drawn[i, LOG2_OPACITY]
            red, green, blue = drawn[i, RED], drawn[i, GREEN], drawn[i, BLUE]
            s_0 = s_x = s_y = s_xx = s_xy = s_yy = w_r = w_g = w_b = ZERO
            for p in range(np.uint64(PIXELS)):
                dx, dy = m[PX + p] - x, m[PY + p] - y
                e = opacity - (a * dx * dx + dy * (b * dx + c * dy))
                alpha = exp2_8(min(e, LOG2_MAX_ALPHA))
                alpha = alpha if e > -MIN_ALPHA_LOG2 else ZERO
                weight = alpha * m[T + p]
                m[T + p] -= weight
                own = weight * (red * m[SUM_R + p] + green * m[SUM_G + p] + blue * m[SUM_B + p])
                behind = m[BEHIND + p] - own
                m[BEHIND + p] = behind
                s = own - behind * alpha / (ONE - alpha)
                s = s if e < LOG2_MAX_ALPHA else ZERO
                sx, sy = s * dx, s * dy
                s_0 += s
                s_x += sx
                s_y += sy
                s_xx += sx * dx
                s_xy += sx * dy
                s_yy += sy * dy
                w_r += weight * m[SUM_R + p]
                w_g += weight * m[SUM_G + p]
                w_b += weight * m[SUM_B + p]
            out = pair_gradient[slot]
            out[0], out[1], out[2] = s_0, s_x, s_y
            out[3], out[4], out[5] = s_xx, s_xy, s_yy
            out[6], out[7], out[8] = w_r, w_g, w_b
        for k in range(stops[tile], starts[tile + 1]):
            pair_gradient[lists[k], :9] = ZERO
