"""Textures of `glass_living`: terrazzo, wallpaper of fans, stucco, velvet, brocade, records, piano keys, parquetry."""

import numpy as np
from PIL import Image, ImageDraw

from ._noise import between, byte_image, colour, hsv, mix, noise, stretched, whole

SIZE = 1024  # of the large ones, in pixels
CHIPS = ("f4ead2", "2b4a3c", "7a2433", "c9a24c", "9a8f80", "23252a", "d8c9b0", "5f7f6c")
SPINES = ((0.0, 0.75, 0.55), (0.4, 0.5, 0.4), (0.12, 0.6, 0.85), (0.6, 0.5, 0.5), (0.08, 0.2, 0.9))


def terrazzo() -> np.ndarray:
    """Slabs of terrazzo, cream and green, with strips of brass between them."""
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    half = SIZE // 2
    dark = ((x // half + y // half) % 2).astype(float)
    base = mix(colour("d9cbb2"), colour("57796a"), dark) * (0.8 + 0.4 * noise(SIZE, SIZE, 201, 5, 5))[..., None]
    canvas, random = Image.fromarray(byte_image(base)), np.random.default_rng(202)
    draw = ImageDraw.Draw(canvas)
    for _ in range(5200):
        cx, cy = random.integers(0, SIZE, 2)
        r = 2 + 12 * random.random() ** 3
        turn = random.uniform(0, 6.28, 5)
        turn.sort()
        outline = [(cx + r * np.cos(t), cy + r * np.sin(t)) for t in turn]
        draw.polygon(outline, fill=whole(255 * colour(CHIPS[random.integers(0, 8)])))
    image = np.array(canvas)
    brass = (np.minimum(x % half, y % half) < 7) | (np.abs(np.abs(x % half - half / 2) + y % half - half / 2) < 4)
    image[brass] = (201, 158, 72)
    return image


def fans(seed: int, ground: str, other: str, line: str) -> np.ndarray:
    """Wallpaper of overlapping fans, each of a shade of its own; upside down, as sheets of walls are."""
    image, random = np.zeros((SIZE, SIZE, 3)), np.random.default_rng(seed)
    y, x = np.mgrid[0:SIZE, 0:SIZE].astype(float)
    wide, r = 128, 64.0
    ink = colour(line)
    for row in range(-1, 18):
        shift = 0.5 * (row % 2)
        which = np.floor(x / wide - shift).astype(int) % 8
        dx, dy = (x / wide - shift) % 1 * wide - r, y - row * r
        far = np.hypot(dx, dy)
        fan = far < r
        shares = np.random.default_rng(seed + row % 16).random(8)
        shades = np.stack([between(ground, other, share) for share in shares])
        here = shades[which]
        spokes = np.abs((np.arctan2(dy, dx) * 9 / np.pi) % 1 - 0.5) < 0.07
        rings = (np.abs(far - r + 3) < 3) | (np.abs(far - 0.62 * r) < 2) | (np.abs(far - 0.3 * r) < 2)
        here = np.where((rings | (spokes & (far < 0.62 * r)))[..., None], ink, here)
        image[fan] = here[fan]
    worn = noise(SIZE, SIZE, int(random.integers(0, 999)), 6, 4, 0.6)
    return byte_image(image[::-1] * (0.8 + 0.36 * worn)[..., None])


def stucco() -> np.ndarray:
    """A coffer: a rosette of petals with rings, moulded and a little gilded."""
    y, x = np.mgrid[-1:1:768j, -1:1:768j]
    far, angle = np.hypot(x, y), np.arctan2(y, x)
    petals = far < 0.5 + 0.22 * np.abs(np.sin(angle * 6))
    relief = 0.5 + 0.5 * np.sin(far * 30 + 2 * np.cos(angle * 12))
    image = mix(colour("cdbf9f"), colour("f7f0de"), np.where(petals, relief, 0.8 - 0.3 * (far > 0.95)))
    square = np.maximum(np.abs(x), np.abs(y))
    gold = (np.abs(square - 0.8) < 0.02) | (np.abs(far - 0.24) < 0.025) | (petals & (np.abs(far - 0.55) < 0.02))
    image[gold] = colour("b88c3c")
    rays = (far > 0.74) & (square < 0.78) & (np.sin(angle * 24) > 0.3)
    image[rays] = colour("a9bfa6")
    return byte_image(image * (0.75 + 0.4 * noise(768, 768, 205, 6, 6, 0.7))[..., None])


def plaster_grain() -> np.ndarray:
    """Cream stucco of beams, with a running key pattern."""
    y, x = np.mgrid[0:512, 0:512]
    key = ((x // 32 + (y // 32) * 2) % 5 == 0) | (x % 128 < 6)
    image = mix(colour("e9dfc8"), colour("b79a5b"), key.astype(float) * 0.7)
    return byte_image(image * (0.7 + 0.5 * noise(512, 512, 206, 6, 8, 0.7))[..., None])


def velvet(seed: int, dark: str, light: str) -> np.ndarray:
    """Velvet in upright channels, crushed here and there."""
    x = np.mgrid[0:768, 0:768][1]
    channel = 0.5 + 0.5 * np.sin(x / 96 * 2 * np.pi)
    crushed = noise(768, 768, seed, 6, 5, 0.65)
    share = np.clip(0.45 * channel + 1.1 * (crushed - 0.25), 0, 1)
    image = mix(colour(dark), colour(light), share)
    image[x % 96 < 4] *= 0.5
    return byte_image(image * (0.8 + 0.4 * noise(768, 768, seed + 1, 2, 190, 0.9))[..., None])


def chevrons() -> np.ndarray:
    """Zigzags of five colours, for cushions."""
    y, x = np.mgrid[0:512, 0:512]
    palette = np.array([colour(text) for text in ("d9b25a", "1f5244", "f0e4c8", "7d2136", "12282a")])
    kind = ((y + np.abs(x % 128 - 64)) // 26) % 5
    return byte_image(palette[kind] * (0.75 + 0.4 * noise(512, 512, 211, 3, 100, 0.8))[..., None])


def sunburst() -> np.ndarray:
    """Rays from a corner over arcs, for cushions and for the back of the cabinet."""
    y, x = np.mgrid[0:1:512j, 0:1:512j]
    rays = np.floor(np.arctan2(y, x + 1e-6) * 2 / np.pi * 11) % 2
    arcs = np.floor(np.hypot(x, y) * 6).astype(int) % 3
    palette = np.array([colour(text) for text in ("e7c878", "8a2b3f", "eadfc6", "2c6552", "b5853a", "3c1a2a")])
    image = palette[arcs * 2 + rays.astype(int)]
    return byte_image(image * (0.75 + 0.4 * noise(512, 512, 212, 3, 100, 0.8))[..., None])


def brocade() -> np.ndarray:
    """Burgundy brocade with golden lozenges and blossoms."""
    y, x = np.mgrid[0:768, 0:768] / 768
    motif = np.sin(x * 12 * np.pi) * np.sin(y * 8 * np.pi) + 0.5 * np.cos(x * 36 * np.pi + 3 * np.sin(y * 16 * np.pi))
    image = mix(colour("7c2238"), colour("a83a4e"), noise(768, 768, 213, 6, 4, 0.7))
    image[motif > 0.75] = colour("d8ac55")
    image[np.abs(motif) < 0.06] = colour("4d1526")
    return byte_image(image * (0.7 + 0.5 * noise(768, 768, 214, 3, 90, 0.8))[..., None])


def records() -> np.ndarray:
    """Spines of a hundred and twenty-eight records side by side."""
    canvas, random = Image.new("RGB", (1024, 256)), np.random.default_rng(215)
    draw = ImageDraw.Draw(canvas)
    for k in range(128):
        hue, saturation, value = SPINES[random.integers(0, 5)]
        shade = hsv((hue + random.uniform(-0.04, 0.04)) % 1, saturation, value * random.uniform(0.5, 1.1))
        draw.rectangle((k * 8, int(random.integers(0, 14)), k * 8 + 6, 255), fill=shade)
        ink = (240, 225, 180) if random.random() < 0.6 else (30, 20, 20)
        start = int(random.integers(20, 90))
        for line in range(int(random.integers(6, 16))):
            draw.rectangle((k * 8 + 2, start + 9 * line, k * 8 + 4, start + 9 * line + 5), fill=ink)
    return np.asarray(canvas)


def keys() -> np.ndarray:
    """A keyboard of fifty-two white keys, seen from above."""
    canvas = Image.new("RGB", (1040, 128), (238, 230, 208))
    draw = ImageDraw.Draw(canvas)
    for k in range(52):
        draw.line((k * 20, 0, k * 20, 127), fill=(90, 80, 70), width=2)
        if k % 7 not in (2, 6):
            draw.rectangle((k * 20 + 14, 0, k * 20 + 26, 78), fill=(22, 20, 22))
    return np.asarray(canvas)


def parquetry(seed: int, dark: str, light: str) -> np.ndarray:
    """Veneer laid in fanned strips, with lines of brass."""
    grain = stretched(noise(48, SIZE, seed, 5, 6), 768, 768)
    y, x = np.mgrid[0:768, 0:768]
    strips = ((x + np.abs(y % 384 - 192)) // 96) % 3 / 3
    rings = 0.5 + 0.5 * np.sin((y / 50 + grain * 9 + strips * 4) * 2 * np.pi)
    image = mix(colour(dark), colour(light), np.clip(0.3 * rings + 0.4 * grain + 0.35 * strips, 0, 1))
    image[(x % 384 < 4) | (y % 384 < 4)] = colour("c79c48")
    return byte_image(image)


def alabaster() -> np.ndarray:
    """Veined stone with light behind it."""
    veins = np.abs(noise(256, 256, 220, 6, 4, 0.6) - 0.5) * 6
    return byte_image(mix(colour("d9a860"), colour("fff3d6"), np.clip(veins, 0, 1)))
