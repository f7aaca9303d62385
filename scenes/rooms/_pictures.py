"""Textures that hold several pictures: paintings and posters, spines of books, letters on blocks."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ._noise import byte_image, colour, hsv, mix, noise, tiled, whole

SIZE = 256  # pixels of one picture; `art` is two rows of four
PRIMARY = ((220, 40, 30), (30, 60, 160), (240, 200, 40), (240, 235, 220), (240, 235, 220), (20, 20, 20))
SIGN = ("KITCHEN", "open daily", "No. 42", "Bread&Tea", "FRESH")
SIGN_COLOURS = ((250, 220, 90), (240, 240, 240), (250, 120, 90), (140, 220, 200), (255, 255, 255))


def art() -> np.ndarray:
    """Eight pictures: rectangles, a mosaic, hills, waves, a sign, discs, a clock, contour lines."""
    random = np.random.default_rng(31)
    rectangles, mosaic = _rectangles(random), _mosaic(random)
    pictures = [rectangles, mosaic, _hills(), _waves(), _sign(), _discs(random), _clock(), _contours()]
    return byte_image(tiled(pictures, 4))


def _grid() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[0 : 1 : SIZE * 1j, 0 : 1 : SIZE * 1j]
    return x, y


def _rectangles(random: np.random.Generator) -> np.ndarray:
    canvas = Image.new("RGB", (SIZE, SIZE), (240, 235, 220))
    draw = ImageDraw.Draw(canvas)

    def divide(left: int, top: int, right: int, bottom: int, depth: int) -> None:
        if depth == 0 or min(right - left, bottom - top) < 30:
            fill = PRIMARY[random.integers(0, 6)]
            draw.rectangle((left, top, right, bottom), fill=fill, outline=(0, 0, 0), width=4)
        elif random.random() < 0.5:
            middle = int(left + (right - left) * random.uniform(0.3, 0.7))
            divide(left, top, middle, bottom, depth - 1)
            divide(middle, top, right, bottom, depth - 1)
        else:
            middle = int(top + (bottom - top) * random.uniform(0.3, 0.7))
            divide(left, top, right, middle, depth - 1)
            divide(left, middle, right, bottom, depth - 1)

    divide(0, 0, SIZE, SIZE, 5)
    return np.asarray(canvas) / 255


def _mosaic(random: np.random.Generator) -> np.ndarray:
    """Voronoi cells with dark joints."""
    x, y = _grid()
    centres, colours = random.random((60, 2)), random.random((60, 3))
    distances = np.hypot(x[..., None] - centres[:, 0], y[..., None] - centres[:, 1])
    nearest = np.sort(distances, -1)
    image = colours[distances.argmin(-1)]
    image[(nearest[..., 1] - nearest[..., 0]) < 0.012] = 0.05
    return image


def _hills() -> np.ndarray:
    x, y = _grid()
    image = mix(colour("f7c873"), colour("3b5f9e"), 1 - y)
    for k, text in enumerate(("6b6f8f", "4d5a63", "2e4034", "1b2a1c")):
        ridge = 0.45 + 0.13 * k + 0.12 * (noise(8, SIZE, 40 + k, 4, 3)[0] - 0.5) * 2
        image[y > ridge[None]] = colour(text)
    image[np.hypot(x - 0.7, y - 0.25) < 0.08] = colour("fff2c0")
    return image


def _waves() -> np.ndarray:
    x, y = _grid()
    phases = (40 * np.hypot(x - 0.3, y - 0.4), 33 * np.hypot(x - 0.8, y - 0.7), 25 * (x + y))
    return np.stack([0.5 + 0.5 * np.sin(phase) for phase in phases], -1)


def _sign() -> np.ndarray:
    canvas = Image.new("RGB", (SIZE, SIZE), (20, 40, 60))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(34)
    for k, (text, fill) in enumerate(zip(SIGN, SIGN_COLOURS, strict=True)):
        draw.text((14, 8 + 48 * k), text, font=font, fill=fill)
    return np.asarray(canvas) / 255


def _discs(random: np.random.Generator) -> np.ndarray:
    canvas = Image.new("RGB", (SIZE, SIZE), (236, 226, 200))
    draw = ImageDraw.Draw(canvas)
    for _ in range(70):
        x, y, r = random.integers(0, SIZE), random.integers(0, SIZE), random.integers(6, 32)
        fill = whole(random.integers(20, 240, 3))
        draw.ellipse(whole((x - r, y - r, x + r, y + r)), fill=fill, outline=(10, 10, 10), width=2)
    return np.asarray(canvas) / 255


def _clock() -> np.ndarray:
    x, y = _grid()
    image = np.ones((SIZE, SIZE, 3)) * 0.93
    image[np.hypot(x - 0.5, y - 0.5) > 0.46] = colour("222222")
    for k in range(12):
        angle = k * np.pi / 6
        dot = np.hypot(x - 0.5 - 0.38 * np.cos(angle), y - 0.5 - 0.38 * np.sin(angle)) < 0.03
        image[dot] = colour("aa2222") if k % 3 == 0 else 0.1
    for angle, long, wide in ((-0.5, 0.33, 0.015), (1.2, 0.22, 0.022)):
        along = (x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle)
        across = -(x - 0.5) * np.sin(angle) + (y - 0.5) * np.cos(angle)
        image[(np.abs(across) < wide) & (along > 0) & (along < long)] = 0.05
    return image


def _contours() -> np.ndarray:
    share = (np.sin(noise(SIZE, SIZE, 50, 6, 3, 0.6) * 40) > 0).astype(float)
    return mix(colour("f0e6d0"), colour("a03060"), share)


def books() -> np.ndarray:
    """Four rows of 32 spines, 32 x 256 pixels each."""
    canvas = Image.fromarray(np.zeros((1024, 1024, 3), np.uint8))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(60)
    for i in range(4):
        for j in range(32):
            left, top = j * 32, i * 256
            cover = hsv(random.random(), random.uniform(0.3, 0.95), random.uniform(0.25, 0.95))
            draw.rectangle((left, top, left + 31, top + 255), fill=cover)
            ink = hsv(random.random(), random.uniform(0, 0.9), random.uniform(0.1, 1))
            for _ in range(random.integers(1, 4)):
                band = top + random.integers(5, 240)
                draw.rectangle(whole((left, band, left + 31, band + random.integers(2, 14))), fill=ink)
            title = top + random.integers(40, 110)
            for k in range(random.integers(5, 12)):
                line = title + k * 9
                start, end = left + 9 + random.integers(0, 3), left + 21 + random.integers(-3, 4)
                draw.rectangle(whole((start, line, end, line + 5)), fill=ink)
    return np.asarray(canvas)


def letters() -> np.ndarray:
    """Two rows of four blocks, 128 pixels each."""
    canvas = Image.new("RGB", (512, 256))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(96)
    for k, letter in enumerate("ABC7KRX3"):
        left, top = (k % 4) * 128, (k // 4) * 128
        box = (left, top, left + 127, top + 127)
        draw.rectangle(box, fill=hsv(k / 8, 0.7, 0.85), outline=(250, 250, 240), width=10)
        draw.text((left + 32, top + 4), letter, font=font, fill=(250, 250, 240))
    return np.asarray(canvas)
