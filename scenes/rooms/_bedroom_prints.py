"""Textures of the bedroom that hold pictures: posters, notes, a screen, keys, the painted wardrobe, the view."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ._noise import between, byte_image, colour, hsv, mix, noise, tiled, whole

WIDE, HIGH = 256, 352  # pixels of a poster; there are two rows of four
NOTE = 128  # pixels of a note; there are four rows of four
PAPERS = ("f3e37c", "f6f1e4", "f2b8a0", "cfe0a8", "f6f1e4", "e9d3b0")
INKS = ("26303c", "7a2b22", "2b4a2c", "3a2c52")


def posters() -> np.ndarray:
    """Eight: a map, mountains, a fern, a concert, the moon, discs, stars, a forest."""
    random = np.random.default_rng(401)
    above = [_map(), _mountains(), _fern(), _concert()]
    below = [_moons(), _discs(random), _stars(random), _forest()]
    return byte_image(tiled([*above, *below], 4))


def _grid() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[0 : HIGH / WIDE : HIGH * 1j, 0 : 1 : WIDE * 1j]
    return x, y


def _map() -> np.ndarray:
    """Heights by colour, contour lines, a grid and a red route."""
    land = noise(HIGH, WIDE, 402, 6, 3, 0.55)
    image = mix(colour("5d7a45"), colour("e8d2a0"), np.clip((land - 0.45) * 4, 0, 1))
    image[land < 0.45] = colour("a9c3c0")
    image[(land * 40) % 1 < 0.14] *= 0.72
    x, y = _grid()
    image[(np.abs(x * 6 % 1) < 0.03) | (np.abs(y * 6 % 1) < 0.03)] *= 0.8
    route = np.abs(y - 0.3 - 0.7 * x - 0.1 * np.sin(x * 14)) < 0.012
    image[route] = colour("b8281e")
    return image


def _mountains() -> np.ndarray:
    x, y = _grid()
    image = mix(colour("f2a65a"), colour("fbe3b5"), np.clip(y * 1.4, 0, 1))
    image[np.hypot(x - 0.34, y - 0.36) < 0.15] = colour("c8402c")
    for k, text in enumerate(("b98a7a", "8c5a58", "5e3b45", "33252f")):
        ridge = 0.5 + 0.2 * k + 0.3 * (noise(8, WIDE, 410 + k, 5, 3, 0.55)[0] - 0.5) * 2
        image[y > ridge[None]] = colour(text)
    return image


def _fern() -> np.ndarray:
    canvas = Image.new("RGB", (WIDE, HIGH), (240, 230, 205))
    draw = ImageDraw.Draw(canvas)
    for k in range(26):
        y, long = 320 - 11 * k, 96 * (1 - k / 28) + 8
        for side in (-1, 1):
            tip = (128 + side * long, y - 0.5 * long)
            green = whole(255 * between("2d4a22", "7d8f3e", k / 26))
            draw.polygon([whole(p) for p in ((128, y - 6), tip, (128, y + 5))], fill=green)
    draw.line((128, 340, 128, 20), fill=(70, 56, 30), width=3)
    draw.rectangle((6, 6, 249, 345), outline=(120, 90, 50), width=3)
    draw.text((70, 318), "Polypodium", font=ImageFont.load_default(20), fill=(60, 40, 20))
    return np.asarray(canvas) / 255


def _concert() -> np.ndarray:
    canvas = Image.new("RGB", (WIDE, HIGH), (178, 58, 38))
    draw = ImageDraw.Draw(canvas)
    for k in range(14):
        draw.pieslice((-60, 60, 316, 436), 180 + 13 * k, 186 + 13 * k, fill=(244, 190, 80))
    draw.ellipse((78, 190, 178, 290), fill=(40, 26, 32))
    for k, (text, big) in enumerate((("NORRSKEN", 46), ("live in the barn", 28), ("14 / 6", 44))):
        draw.text((12, (10, 60, 296)[k]), text, font=ImageFont.load_default(big), fill=(252, 238, 208))
    return np.asarray(canvas) / 255


def _moons() -> np.ndarray:
    x, y = _grid()
    image = np.tile(colour("2c2733"), (HIGH, WIDE, 1)) + 0.12 * noise(HIGH, WIDE, 403, 5, 6)[..., None]
    spots = noise(HIGH, WIDE, 404, 5, 10, 0.7)
    for k in range(12):
        cx, cy = 0.2 + 0.3 * (k % 3), 0.2 + 0.32 * (k // 3)
        lit = (np.hypot(x - cx, y - cy) < 0.115) & (np.hypot(x - cx - 0.04 * (k - 5.5), y - cy) > 0.1)
        image[lit] = mix(colour("b89a6a"), colour("fff0cc"), spots)[lit]
    return image


def _discs(random: np.random.Generator) -> np.ndarray:
    canvas = Image.new("RGB", (WIDE, HIGH), (232, 214, 176))
    draw = ImageDraw.Draw(canvas)
    for i in range(7):
        for j in range(5):
            x, y = 10 + j * 48, 10 + i * 48
            fill = whole(255 * colour(("a63d2f", "d99a3c", "5b6b3a", "3d3a36", "c9785a")[random.integers(0, 5)]))
            start = 90 * int(random.integers(0, 4))
            draw.rectangle((x, y, x + 44, y + 44), fill=whole(255 * colour(("f2e6c8", "dcbc88")[(i + j) % 2])))
            draw.pieslice((x, y, x + 44, y + 44), start, start + (180, 360, 270)[random.integers(0, 3)], fill=fill)
    return np.asarray(canvas) / 255


def _stars(random: np.random.Generator) -> np.ndarray:
    canvas = Image.new("RGB", (WIDE, HIGH), (52, 34, 44))
    draw = ImageDraw.Draw(canvas)
    for r in (40, 80, 120):
        draw.ellipse((128 - r, 160 - r, 128 + r, 160 + r), outline=(160, 120, 90), width=2)
    places = random.uniform((15, 40), (240, 290), (34, 2))
    for first, second in zip(places[::2], places[1::2], strict=True):
        if np.abs(first - second).sum() < 170:
            draw.line([whole(first), whole(second)], fill=(220, 180, 120), width=2)
    for x, y in places:
        r = random.integers(2, 7)
        draw.ellipse(whole((x - r, y - r, x + r, y + r)), fill=(255, 240, 200))
    draw.text((34, 304), "STJERNER", font=ImageFont.load_default(36), fill=(240, 200, 130))
    return np.asarray(canvas) / 255


def _forest() -> np.ndarray:
    canvas = Image.new("RGB", (WIDE, HIGH), (238, 205, 150))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(405)
    draw.ellipse((140, 40, 220, 120), fill=(214, 96, 48))
    for layer, text in enumerate(("c79a6a", "9a8050", "66683a", "3c4526", "23281a")):
        for _ in range(9):
            x, foot, high = random.integers(0, WIDE), 190 + 40 * layer, random.integers(90, 150)
            for step in range(4):
                top, wide = foot - high + step * high // 5, 8 + 7 * step
                draw.polygon(
                    [whole(p) for p in ((x, top), (x - wide, top + high // 2.6), (x + wide, top + high // 2.6))],
                    fill=whole(255 * colour(text)),
                )
        draw.rectangle((0, 186 + 40 * layer, WIDE, HIGH), fill=whole(255 * colour(text)))
    return np.asarray(canvas) / 255


def notes() -> np.ndarray:
    """Sixteen: written notes, drawings, tables and snapshots."""
    random = np.random.default_rng(420)
    made = [(_written, _snapshot, _table, _snapshot)[k % 4](random, k) for k in range(16)]
    return byte_image(tiled(made, 4))


def _written(random: np.random.Generator, k: int) -> np.ndarray:
    canvas = Image.new("RGB", (NOTE, NOTE), whole(255 * colour(PAPERS[k // 2 % 6])))
    draw, ink = ImageDraw.Draw(canvas), whole(255 * colour(INKS[k // 4 % 4]))
    draw.text((8, 4), ("Monday", "To do:", "Ring Ada", "Skis!")[k // 4 % 4], font=ImageFont.load_default(26), fill=ink)
    for line in range(5):
        x, end = 8, 8 + random.integers(60, 112)
        while x < end:
            word = random.integers(8, 26)
            draw.rectangle(whole((x, 42 + 16 * line, min(x + word, 120), 47 + 16 * line)), fill=ink)
            x += word + 7
    return np.asarray(canvas) / 255


def _snapshot(random: np.random.Generator, k: int) -> np.ndarray:
    """A landscape with a white edge."""
    y, x = np.mgrid[0 : 1 : NOTE * 1j, 0 : 1 : NOTE * 1j]
    image = mix(np.array(hsv(0.05 + 0.55 * (k % 3 == 1), 0.4, 0.95)) / 255, colour("fff4dc"), y)
    for layer in range(3):
        ridge = 0.4 + 0.18 * layer + 0.3 * (noise(8, NOTE, 430 + 3 * k + layer, 4, 2)[0] - 0.5)
        image[y > ridge[None]] = np.array(hsv(random.random(), 0.5, 0.75 - 0.2 * layer)) / 255
    image[np.hypot(x - random.uniform(0.3, 0.7), y - 0.7) < 0.1] = np.array(hsv(random.random(), 0.8, 0.8)) / 255
    image[np.maximum(np.abs(x - 0.5), np.abs(y - 0.46)) > 0.43] = colour("f7f3ea")
    return image


def _table(random: np.random.Generator, k: int) -> np.ndarray:
    """A month of days, some of them marked."""
    canvas = Image.new("RGB", (NOTE, NOTE), (247, 240, 224))
    draw = ImageDraw.Draw(canvas)
    draw.rectangle((0, 0, NOTE, 24), fill=hsv(k / 16, 0.6, 0.7))
    for i in range(5):
        for j in range(6):
            fill = hsv(random.random(), 0.5, 0.9) if random.random() < 0.35 else (232, 222, 200)
            draw.rectangle((6 + 20 * j, 30 + 19 * i, 22 + 20 * j, 45 + 19 * i), fill=fill)
    return np.asarray(canvas) / 255
