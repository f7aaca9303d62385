"""Textures of floors, walls, ceilings and furniture: wood, wallpaper, plaster, brick, tiles, marble, steel, leaves."""

import itertools

import numpy as np
from PIL import Image, ImageDraw

from ._noise import between, byte_image, colour, mix, noise, stretched, whole

SIZE = 1024  # of the large ones, in pixels


def planks() -> np.ndarray:
    """A floor of twelve rows of wooden planks."""
    image, random = np.zeros((SIZE, SIZE, 3)), np.random.default_rng(1)
    spots = noise(SIZE, SIZE, 2, 6, 4)
    lengths = (noise(SIZE, 32, 3, 4, 8) * 255).astype(np.uint8)
    grain = Image.fromarray(lengths).resize((SIZE, SIZE)).transpose(Image.Transpose.TRANSPOSE)
    grain = np.asarray(grain) / 255.0
    high = SIZE // 12
    for i in range(12):
        offset = random.integers(0, 400)
        joints = [0, *sorted((offset + k * 410) % SIZE for k in range(2)), SIZE]
        rows = slice(i * high, (i + 1) * high)
        for left, right in itertools.pairwise(joints):
            base = between("6b4423", "c08a55", random.random())
            block = np.roll(grain, random.integers(0, SIZE), 0)[rows, left:right]
            image[rows, left:right] = base * (0.6 + 0.55 * block + 0.35 * (spots[rows, left:right] - 0.5))[..., None]
            image[i * high : i * high + 3, left:right] *= 0.35
            image[rows, left : left + 3] *= 0.35
    image[12 * high :] = image[: SIZE - 12 * high]
    return byte_image(image)


def wallpaper() -> np.ndarray:
    """Stripes with a motif."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    wave = np.sin(x * 16 * np.pi) * np.sin(y * 16 * np.pi) + 0.5 * np.sin(x * 48 * np.pi + 2 * np.sin(y * 32 * np.pi))
    motif = (wave > 0.55).astype(float)[..., None]
    image = mix(colour("c9b48a"), colour("9fae93"), np.floor(x * 8) % 2)
    image = image * (1 - 0.45 * motif) + 0.45 * motif * colour("7a2f2f")
    return byte_image(image * (0.75 + 0.45 * noise(SIZE, SIZE, 5, 6, 8))[..., None])


def plaster() -> np.ndarray:
    """Blue-green plaster with cracks and spots of paint."""
    patches = np.clip((noise(SIZE, SIZE, 7, 7, 4, 0.6) - 0.3) * 2, 0, 1)
    image = mix(colour("2f6f73"), colour("86b3a6"), patches)
    image[np.abs(noise(SIZE, SIZE, 8, 5, 3) - 0.5) < 0.006] *= 0.6
    random = np.random.default_rng(9)
    canvas = Image.fromarray((image * 255).astype(np.uint8))
    draw = ImageDraw.Draw(canvas)
    for _ in range(500):
        x, y, r = random.integers(0, SIZE), random.integers(0, SIZE), random.integers(1, 5)
        draw.ellipse(whole((x - r, y - r, x + r, y + r)), fill=whole(random.integers(40, 220, 3)))
    return np.asarray(canvas)


def brick() -> np.ndarray:
    """Sixteen courses of bricks."""
    image, random = np.zeros((SIZE, SIZE, 3)), np.random.default_rng(11)
    high, wide = SIZE // 16, SIZE // 6
    stains = noise(SIZE, SIZE, 12, 7, 8, 0.65)
    image[:] = colour("b9b2a5")
    for i in range(16):
        for j in range(-1, 7):
            left = j * wide + (wide // 2 if i % 2 else 0)
            across = slice(max(left + 4, 0), max(left + wide - 4, 0))
            image[i * high + 4 : (i + 1) * high - 4, across] = between("6f2d1f", "c4704c", random.random())
    return byte_image(image * (0.55 + 0.85 * stains)[..., None])


def tiles() -> np.ndarray:
    """Eight by eight tiles with four kinds of ornament."""
    image, random = np.zeros((SIZE, SIZE, 3)), np.random.default_rng(13)
    side = SIZE // 8
    palette = [colour(text) for text in ("f2efe6", "2b5d8a", "e0b84c", "d9e4ec", "f2efe6", "6fa3b8")]
    y, x = np.mgrid[-1 : 1 : side * 1j, -1 : 1 : side * 1j]
    ornaments = [
        np.hypot(x, y) < 0.6,
        np.abs(x) + np.abs(y) < 0.7,
        np.abs(np.hypot(x - 1, y - 1) - 1) < 0.15,
        (np.abs(x) < 0.2) | (np.abs(y) < 0.2),
    ]
    for i in range(8):
        for j in range(8):
            tile = image[i * side : (i + 1) * side, j * side : (j + 1) * side]
            k = random.integers(0, len(palette))
            tile[:] = palette[k]
            ornament = ornaments[random.integers(0, 4)]
            tile[ornament] = palette[(k + 1 + random.integers(0, 4)) % 6]
            tile[:4] = 0.55
            tile[:, :4] = 0.55
    return byte_image(image * (0.85 + 0.25 * noise(SIZE, SIZE, 14, 6, 8))[..., None])


def ceiling() -> np.ndarray:
    """Whitewash with stains."""
    share = np.clip((noise(SIZE, SIZE, 15, 8, 6, 0.7) - 0.3) * 2.2, 0, 1)
    return byte_image(mix(colour("b9b09f"), colour("f4f1ea"), share))


def wood(seed: int, dark: str, light: str) -> np.ndarray:
    """Wood with rings, between two colours."""
    grain = stretched(noise(48, SIZE, seed, 5, 6), 512, 512)
    y = np.mgrid[0:512, 0:512][0] / 512
    rings = 0.5 + 0.5 * np.sin((y * 14 + grain * 5) * 2 * np.pi)
    return byte_image(mix(colour(dark), colour(light), np.clip(0.35 * rings + 0.65 * grain, 0, 1)))


def marble() -> np.ndarray:
    """Dark marble with veins and specks."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    veins = np.abs(np.sin((x * 3 + y * 2 + noise(SIZE, SIZE, 25, 7, 4, 0.6) * 4) * np.pi)) ** 0.35
    image = mix(colour("1d1f24"), colour("5d6470"), veins)
    image[noise(SIZE, SIZE, 26, 3, 200, 0.8) > 0.72] = colour("c8c0b0")
    return byte_image(image)


def leaf() -> np.ndarray:
    """A leaf's green."""
    return byte_image(mix(colour("1f4d1a"), colour("6fae3d"), noise(256, 256, 80, 5, 6, 0.7)))


def steel() -> np.ndarray:
    """Brushed steel."""
    return byte_image(mix(colour("8e9299"), colour("c2c6cc"), noise(256, 256, 81, 5, 3, 0.7)))


def outside() -> np.ndarray:
    """What is seen through a window: sky, trees and a lane."""
    y = np.mgrid[0:1:256j, 0:1:256j][0]
    clouds = np.clip(noise(256, 256, 70, 5, 3) * 1.6 - 0.4, 0, 1)
    image, rough = mix(colour("bcd8ff"), colour("ffffff"), clouds), noise(256, 256, 71, 6, 4, 0.6)
    trees = y > 0.55 + 0.35 * (rough - 0.5)
    image[trees] = mix(colour("24401c"), colour("7da050"), rough)[trees]
    image[y > 0.9] = colour("8a8f80")
    return byte_image(image)
