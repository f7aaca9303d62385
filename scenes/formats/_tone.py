"""High dynamic range to sRGB: HLG and PQ video, as iPhones film it, in the colours that a trainer expects.

What is done, in linear light, the same for every frame (a curve that follows each frame's content would change the
room's colours from view to view):

1. R'G'B' to light in cd/m²: HLG by its inverse OETF and the OOTF of a display of 1,000 cd/m² (γ = 1.2), PQ by its EOTF
   (Recommendation ITU-R BT.2100, tables 4 and 5).
2. HDR Reference White, 203 cd/m² (Report ITU-R BT.2408, table 1), becomes 1: what is no highlight keeps the colours
   that it has in SDR.
3. BT.2020's primaries to BT.709's by the linear matrix, what lies outside is clipped (Report ITU-R BT.2407, section 2).
4. Highlights: the largest of R, G, B is left as it is up to KNEE, and above bent towards 1, which PEAK reaches, by
   x (1 + x / w²) / (1 + x) (Reinhard et al. 2002, equation 4, on the part above the knee; its slope there is 1). R, G
   and B are scaled alike, which keeps the hue.
5. sRGB's transfer function (IEC 61966-2-1).
"""

from functools import cache

import numpy as np

WHITE = 203.0  # cd/m²
PEAK = 1000.0  # cd/m²: HLG's nominal display; brighter light in PQ becomes white
KNEE = 0.75  # of white: code 225 of 255
STEPS = 1 << 16
ROWS = 128  # at a time: a 4K frame in float32 takes 100 MB a copy
TO_709 = np.array(  # Report ITU-R BT.2407, section 2
    [
        [1.660491, -0.587641, -0.072850],
        [-0.124550, 1.132900, -0.008349],
        [-0.018151, -0.100579, 1.118730],
    ],
    dtype=np.float32,
)
LUMA_2020 = np.array([0.2627, 0.6780, 0.0593], dtype=np.float32)


def to_srgb(codes: np.ndarray, hlg: bool, wide: bool = True) -> np.ndarray:
    """(H, W, 3) uint8 sRGB of HDR R'G'B' (H, W, 3) uint16 full range; HLG, or else PQ.

    `wide` says that the primaries are BT.2020's, else they are BT.709's.
    """
    out = np.empty(codes.shape, np.uint8)
    for top in range(0, len(codes), ROWS):
        part = slice(top, top + ROWS)
        light = _light(hlg)[codes[part]]
        if hlg:  # the OOTF: F = L_w Y^(γ − 1) E
            light *= np.maximum(light @ LUMA_2020, 1e-6)[..., None] ** np.float32(0.2) * np.float32(PEAK / WHITE)
        if wide:
            light = light @ TO_709.T
        out[part] = _encoded()[np.round(bent(np.maximum(light, 0)) * (STEPS - 1)).astype(np.uint16)]
    return out


def bent(light: np.ndarray) -> np.ndarray:
    """(…, 3) light ≥ 0 in units of white, its highlights bent into [0, 1] with their hue."""
    top = light.max(axis=-1, keepdims=True)
    x = np.maximum(top - KNEE, 0) / (1 - KNEE)
    w = (PEAK / WHITE - KNEE) / (1 - KNEE)
    above = KNEE + (1 - KNEE) * np.minimum(x * (1 + x / w**2) / (1 + x), 1)
    return np.where(top > KNEE, light * (above / np.maximum(top, KNEE)), light).clip(0, 1)


@cache
def _light(hlg: bool) -> np.ndarray:
    """(STEPS,) float32: HLG's scene light in [0, 1], or PQ's display light in units of white."""
    code = np.arange(STEPS) / (STEPS - 1)
    if hlg:
        a = 0.17883277
        b, c = 1 - 4 * a, 0.5 - a * np.log(4 * a)
        return np.where(code <= 0.5, code**2 / 3, (np.exp((code - c) / a) + b) / 12).astype(np.float32)
    m1, m2, c1, c2, c3 = 2610 / 16384, 2523 / 4096 * 128, 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    power = code ** (1 / m2)
    return ((np.maximum(power - c1, 0) / (c2 - c3 * power)) ** (1 / m1) * 10000 / WHITE).astype(np.float32)


@cache
def _encoded() -> np.ndarray:
    """(STEPS,) uint8 sRGB code of light in [0, 1]."""
    x = np.arange(STEPS) / (STEPS - 1)
    return np.round(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)).astype(np.uint8)
