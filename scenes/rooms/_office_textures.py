"""Surfaces of `open_office`: carpet, oak, ceiling tiles, concrete, felt, brick, cloth, zinc, wood."""

import numpy as np
from PIL import Image, ImageDraw

from ._noise import byte_image, colour, mix, noise, stretched, whole

SIZE = 1024
CARPET = ("59626b", "737c84", "8d969c", "46606f", "4c8286", "9aa3a4", "59626b", "d0a94a")
FELT = ("2f4358", "5c7690", "9fb0bb", "3d7f80", "d9dcd8", "c9a24a", "7b8790")


def carpet() -> np.ndarray:
    """Eight by eight carpet tiles, their ribs across and along in turn, some in colour."""
    random, image = np.random.default_rng(201), np.zeros((SIZE, SIZE, 3))
    side = SIZE // 8
    y, x = np.mgrid[0:side, 0:side]
    for i in range(8):
        for j in range(8):
            tile = image[i * side : (i + 1) * side, j * side : (j + 1) * side]
            along = x if (i + j) % 2 else y
            ribs = 0.88 + 0.16 * (along % 8 < 5) + 0.12 * np.sin(along * (0.11 + 0.05 * random.random()))
            tile[:] = colour(CARPET[random.integers(0, len(CARPET))]) * ribs[..., None]
            tile[:2] *= 0.6
            tile[:, :2] *= 0.6
    tufts = 0.62 + 0.55 * noise(SIZE, SIZE, 202, 3, 160, 0.9) + 0.3 * noise(SIZE, SIZE, 203, 4, 5)
    return byte_image(image * tufts[..., None])


def chevron() -> np.ndarray:
    """A floor of oak in eight columns of slanted planks."""
    random = np.random.default_rng(204)
    wide, high = SIZE // 8, SIZE // 16
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    column, across = x // wide, x % wide
    along = (y + np.where(column % 2, across, wide - across)) % SIZE
    plank = along // high
    tones = random.random((8, 16))[column, plank]
    grain = stretched(noise(SIZE, 64, 205, 5, 8), SIZE, SIZE)[along, (across * 3 + plank * 97) % SIZE]
    image = mix(colour("9a7248"), colour("dcbb8a"), tones) * (0.65 + 0.6 * grain)[..., None]
    image[along % high < 3] *= 0.5
    image[across < 2] *= 0.5
    return byte_image(image)


def mineral() -> np.ndarray:
    """Four by four tiles of a hung ceiling: pores, fissures, stains, metal rails between."""
    random, side = np.random.default_rng(206), SIZE // 4
    image = mix(colour("c6c8c6"), colour("f2f2ee"), noise(SIZE, SIZE, 207, 6, 4, 0.7))
    image[noise(SIZE, SIZE, 208, 3, 90, 0.8) > 0.68] *= 0.62
    canvas = Image.fromarray(byte_image(image))
    draw = ImageDraw.Draw(canvas)
    for _ in range(4500):
        px, py, r = random.integers(0, SIZE), random.integers(0, SIZE), random.integers(1, 3)
        draw.ellipse(whole((px, py, px + r, py + r)), fill=whole(random.integers(70, 150, 1).repeat(3)))
    image = np.asarray(canvas) / 255
    tints = [colour(text) * 1.02 for text in ("ffffff", "f4f6f7", "d4dee2", "bccdd4", "e6d8bf")]
    tone = np.array(tints)[random.integers(0, 5, (4, 4))] * random.uniform(0.84, 1.0, (4, 4, 1))
    tone = tone.repeat(side, 0).repeat(side, 1)
    y, x = np.mgrid[0:SIZE, 0:SIZE] % side
    rail = (x < 10) | (y < 10)
    image = np.where(rail[..., None], colour("dfe3e6"), image * tone)
    image[((x >= 10) & (x < 14)) | ((y >= 10) & (y < 14)) | (x > side - 4) | (y > side - 4)] *= 0.45
    return byte_image(image)


def concrete() -> np.ndarray:
    """Board-marked concrete with the holes of its ties."""
    random = np.random.default_rng(209)
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    board = y // 64
    grain = stretched(noise(96, SIZE, 210, 5, 6), SIZE, SIZE)
    share = 0.45 * noise(SIZE, SIZE, 211, 7, 4, 0.6) + 0.4 * grain + 0.3 * random.random(16)[board]
    image = mix(colour("6d7276"), colour("cfd0cc"), np.clip(share * 1.25 - 0.2, 0, 1))
    image[y % 64 < 2] *= 0.72
    image[(x + board * 311) % 512 < 2] *= 0.75
    image[noise(SIZE, SIZE, 212, 3, 110, 0.8) > 0.73] *= 0.55
    for cx in (256, 768):
        for cy in (160, 672):
            away = np.hypot(x - cx, y - cy)
            image[away < 17] = 0.2
            image[(away >= 17) & (away < 23)] *= 1.2
    return byte_image(image)


def felt() -> np.ndarray:
    """Acoustic panels of felt: six by six squares of two triangles."""
    random, image = np.random.default_rng(213), np.zeros((SIZE, SIZE, 3))
    y, x = np.mgrid[0:SIZE, 0:SIZE] * 6 / SIZE
    i, j = y.astype(int), x.astype(int)
    slant = np.where((i + j) % 2, (x - j) + (y - i) - 1, (x - j) - (y - i))
    kinds = random.integers(0, len(FELT), (6, 6, 2))[i, j, (slant > 0).astype(int)]
    image = np.array([colour(text) for text in FELT])[kinds]
    image[np.abs(slant) < 0.02] *= 0.55
    image[((x - j) < 0.015) | ((y - i) < 0.015)] *= 0.55
    fibres = 0.7 + 0.35 * noise(SIZE, SIZE, 214, 3, 200, 0.9) + 0.25 * stretched(noise(300, 60, 215, 3, 20), SIZE, SIZE)
    return byte_image(image * fibres[..., None])


def whitewash() -> np.ndarray:
    """Bricks under white paint that has come off here and there."""
    random, image = np.random.default_rng(216), np.zeros((SIZE, SIZE, 3))
    high, wide = SIZE // 16, SIZE // 4
    image[:] = colour("a3a6a6")
    bare = noise(SIZE, SIZE, 217, 6, 6, 0.65)
    for i in range(16):
        for j in range(-1, 5):
            left = j * wide + (wide // 2 if i % 2 else 0)
            place = np.s_[i * high + 4 : (i + 1) * high - 4, max(left + 4, 0) : max(left + wide - 4, 0)]
            image[place] = colour("e6e5df") * random.uniform(0.78, 1.02)
            chipped = bare[place] > 0.76 - 0.08 * random.random()
            image[place][chipped] = colour("9c5b45") * random.uniform(0.7, 1.2)
    return byte_image(image * (0.72 + 0.45 * noise(SIZE, SIZE, 218, 6, 10, 0.7))[..., None])


def tweed(seed: int, dark: str, light: str) -> np.ndarray:
    """Cloth woven in a herringbone."""
    y, x = np.mgrid[0:512, 0:512]
    slant = np.where(x // 32 % 2, x + y, y - x) % 16 < 8
    share = 0.55 * slant + 0.6 * noise(512, 512, seed, 4, 60, 0.9) - 0.05
    image = mix(colour(dark), colour(light), np.clip(share, 0, 1))
    image[noise(512, 512, seed + 1, 2, 120) > 0.8] = colour("e8dcc0")
    return byte_image(image)


def kelim() -> np.ndarray:
    """A flat rug of stepped bands."""
    y, x = (np.mgrid[0:512, 0:512] // 8) * 8
    zigzag = np.abs((x % 128) - 64)
    bands = ((y + zigzag) // 32 + 3 * (y // 128)) % 6
    palette = np.array([colour(text) for text in ("2c4660", "dfe2dc", "7fa2ad", "d2a23f", "4b5258", "b9c3c6")])
    return byte_image(palette[bands] * (0.72 + 0.45 * noise(512, 512, 221, 3, 110, 0.9))[..., None])


def zinc() -> np.ndarray:
    """Galvanised sheet: flakes of grey, seams."""
    random = np.random.default_rng(222)
    centres, tones = random.random((90, 2)) * 256, random.uniform(0.5, 0.85, 90)
    y, x = np.mgrid[0:256, 0:256]
    apart = [np.abs(axis[..., None] - centres[:, k]) for k, axis in enumerate((y, x))]
    near = sum(np.minimum(d, 256 - d) ** 2 for d in apart)
    image = tones[np.asarray(near).argmin(-1)][..., None] * np.array([0.97, 1.0, 1.03])
    image[:, :4] *= 0.5
    return byte_image(image * (0.8 + 0.3 * noise(256, 256, 223, 4, 12))[..., None])


def boards(seed: int, dark: str, light: str) -> np.ndarray:
    """Glued wood: eight boards with grain along them, knots and pores."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:512, 0:512]
    start = random.integers(0, 512, 8)[y // 64]
    wood = stretched(noise(512, 512, seed + 1, 5, 32, 0.6)[:, :80], 512, 512)[y, (x + start) % 512]
    knots = stretched(noise(128, 256, seed + 2, 3, 6), 512, 512)
    rings = 0.5 + 0.5 * np.sin((y / 12 + knots * 9) * 2)
    share = 0.95 * wood + 0.3 * rings * knots + 0.42 * random.random(8)[y // 64] - 0.28
    image = mix(colour(dark), colour(light), np.clip(share, 0, 1))
    image[(y % 64 < 2) | ((x + start) % 512 < 2)] *= 0.6
    return byte_image(image * (0.88 + 0.24 * noise(512, 512, seed + 3, 3, 120, 0.9))[..., None])
