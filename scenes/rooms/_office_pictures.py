"""What is written and drawn in `open_office`: papers, posters, binders, keys, a whiteboard; covers of lamps."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ._noise import byte_image, colour, mix, noise, whole

INKS = ((30, 60, 160), (190, 40, 40), (30, 120, 70), (40, 40, 44))
WORDS = ("queue", "model v2", "retry?", "users", "cache", "ship it!", "tests", "Q3 plan", "why?", "cost", "demo", "API")
POSTERS = (
    ("24384c", "dfe3e0", "NORD"),
    ("d9a63c", "20303f", "FORM"),
    ("dfe3e0", "2f7f7d", "LESS"),
    ("8fb0bd", "28323a", "No 11"),
    ("2f7f7d", "f1ead8", "SEA"),
    ("e9e4d6", "b2503c", "TYPE"),
    ("3f474e", "e0b658", "GRID"),
    ("c9d3d6", "25405c", "1962"),
)


def papers() -> np.ndarray:
    """Four by two sheets: letters, plans, notes."""
    canvas = Image.new("RGB", (768, 512))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(232)
    for k in range(8):
        left, top = k % 4 * 192, k // 4 * 256
        paper = ((244, 242, 234), (232, 240, 244), (250, 222, 110), (240, 236, 220))[k % 4]
        draw.rectangle((left, top, left + 191, top + 255), fill=paper, outline=(150, 150, 150), width=2)
        draw.rectangle(whole((left + 16, top + 14, left + random.integers(70, 150), top + 28)), fill=INKS[k % 4])
        for row in range(9):
            draw.rectangle(
                whole((left + 16, top + 44 + row * 10, left + random.integers(90, 176), top + 48 + row * 10)),
                fill=(90, 92, 98),
            )
        for _ in range(7):
            corners = random.integers((16, 140, 16, 140), (176, 246, 176, 246))
            low, high = np.minimum(corners[:2], corners[2:]), np.maximum(corners[:2], corners[2:])
            draw.rectangle(
                whole((*(low + (left, top)), *(high + (left, top)))), outline=INKS[random.integers(0, 4)], width=2
            )
    return np.asarray(canvas)


def posters() -> np.ndarray:
    """Four by two posters, 256 x 352 pixels: a word over shapes."""
    image = np.zeros((704, 1024, 3))
    for k, (ground, ink, word) in enumerate(POSTERS):
        image[k // 4 * 352 :, k % 4 * 256 :][:352, :256] = _poster(k, ground, ink, word)
    return byte_image(image)


def _poster(k: int, ground: str, ink: str, word: str) -> np.ndarray:
    y, x = np.mgrid[0:352, 0:256] / 256
    shapes = (
        np.abs(np.hypot(x - 0.5, y - 0.55) % 0.12) < 0.06,
        (np.floor(x * 6) + np.floor(y * 6) * 2) % 5 < 2,
        np.sin(y * 60 + 4 * np.sin(x * 9)) > 0.1,
        np.sin(noise(352, 256, 240, 5, 3) * 50) > 0,
        y > 0.5 + 0.06 * np.sin(x * 25) + 0.1 * np.sin(x * 7),
        np.abs((x - 0.5) % 0.25 - (y % 0.25)) < 0.06,
        np.hypot(x % 0.16 - 0.08, y % 0.16 - 0.08) < 0.02 + 0.06 * y / 1.4,
        np.abs(x - 0.5) + np.abs(y - 0.6) < 0.14 + 0.1 * (np.floor(y * 20) % 3),
    )
    image = mix(colour(ground), colour(ink), shapes[k].astype(float))
    image[:70] = colour(ground)
    canvas = Image.fromarray(byte_image(image * (0.88 + 0.2 * noise(352, 256, 241 + k, 4, 30, 0.8))[..., None]))
    draw = ImageDraw.Draw(canvas)
    draw.text((14, 4), word, font=ImageFont.load_default(54), fill=whole(colour(ink) * 255))
    draw.text(
        (14, 322), f"gallery {k + 3} / may - june", font=ImageFont.load_default(18), fill=whole(colour("c0503a") * 255)
    )
    return np.asarray(canvas) / 255


def binders() -> np.ndarray:
    """Sixteen backs of binders, 64 x 320 pixels: marbled board, a label, a hole for the finger."""
    shades = 0.65 + 0.6 * noise(320, 1024, 250, 4, 90, 0.9)
    image, random = np.zeros((320, 1024, 3)), np.random.default_rng(251)
    covers = [colour(text) for text in ("2a2e33", "35566f", "87959d", "2f7f7d", "c9a24a", "d5d8d6", "a1452f")]
    for k in range(16):
        image[:, k * 64 : k * 64 + 64] = covers[random.integers(0, len(covers))]
    canvas = Image.fromarray(byte_image(image * shades[..., None]))
    draw = ImageDraw.Draw(canvas)
    for k in range(16):
        left = k * 64
        draw.rectangle((left + 10, 40, left + 53, 190), fill=(238, 236, 226), outline=(40, 40, 40))
        draw.text((left + 16, 48), str(2009 + k)[2:], font=ImageFont.load_default(30), fill=INKS[k % 4])
        for row in range(8):
            draw.rectangle(
                whole((left + 16, 96 + row * 11, left + random.integers(26, 50), 101 + row * 11)), fill=(60, 60, 66)
            )
        draw.ellipse((left + 20, 240, left + 44, 264), fill=(14, 14, 14), outline=(200, 200, 200), width=3)
        draw.line((left, 0, left, 320), fill=(10, 10, 10), width=3)
    return np.asarray(canvas)


def keys() -> np.ndarray:
    """A keyboard from above."""
    canvas = Image.new("RGB", (512, 176), (46, 50, 56))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(16)
    for row in range(5):
        for k in range(15):
            left, top = 10 + 33 * k, 10 + 32 * row
            if row == 4 and 4 <= k <= 9:
                draw.rectangle((left - 4, top, left + 32, top + 27), fill=(205, 210, 212))
                continue
            fill = (
                (214, 166, 60) if (row, k) in ((0, 0), (2, 14)) else (205, 210, 212) if 0 < k < 13 else (128, 138, 146)
            )
            draw.rectangle((left, top, left + 28, top + 27), fill=fill)
            draw.text((left + 7, top + 3), chr(65 + (row * 13 + k) % 26), font=font, fill=(30, 34, 38))
    return np.asarray(canvas)


def whiteboard() -> np.ndarray:
    """Boxes with arrows, curves, lists and sticky notes on white."""
    ground = mix(colour("dfe4e6"), colour("f6f7f5"), noise(512, 1024, 260, 6, 5, 0.7))
    canvas = Image.fromarray(byte_image(ground))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(261)
    font, large = ImageFont.load_default(24), ImageFont.load_default(40)
    draw.text((30, 14), "Roadmap  spring -> autumn", font=large, fill=INKS[0])
    centres = []
    for k in range(10):
        x, y = 40 + k % 4 * 150 + int(random.integers(0, 30)), 90 + k // 4 * 130 + int(random.integers(0, 24))
        draw.rectangle((x, y, x + 112, y + 62), outline=INKS[k % 4], width=5)
        draw.text((x + 8, y + 14), WORDS[k], font=font, fill=INKS[(k + 1) % 4])
        centres.append((x + 56, y + 62))
    for first, second in ((0, 5), (1, 4), (2, 7), (3, 6), (4, 8), (5, 9), (6, 9), (7, 8)):
        draw.line((*centres[first], centres[second][0], centres[second][1] - 62), fill=INKS[(first + 2) % 4], width=4)
    for k in range(3):
        points = [(660 + 12 * j, 420 - (10 + 9 * k) * j**0.5 * 2 + 14 * np.sin(j * (0.5 + k / 3))) for j in range(26)]
        draw.line(points, fill=INKS[k], width=5)
    draw.line((650, 250, 650, 470, 1000, 470), fill=INKS[3], width=5)
    for k in range(12):
        x, y = 680 + k % 4 * 84, 30 + k // 4 * 78
        draw.rectangle(
            (x, y, x + 66, y + 62),
            fill=((250, 214, 90), (150, 206, 214), (240, 150, 120), (180, 220, 140))[(k * 5) % 4],
        )
        for row in range(4):
            draw.line(
                whole((x + 6, y + 12 + row * 12, x + random.integers(30, 60), y + 12 + row * 12)),
                fill=(40, 44, 60),
                width=3,
            )
    return np.asarray(canvas)


def pegs() -> np.ndarray:
    """A board with holes, painted in three fields."""
    y, x = np.mgrid[0:512, 0:512]
    fields = (np.floor((x + y) / 512 * 3)).astype(int) % 3
    image = np.array([colour(text) for text in ("c8b48e", "6f97a0", "e3e1d8")])[fields]
    image = image * (0.75 + 0.4 * noise(512, 512, 270, 5, 20, 0.8))[..., None]
    image[np.hypot(x % 32 - 16, y % 32 - 16) < 5] = 0.12
    return byte_image(image)


def prism() -> np.ndarray:
    """The cover of a lamp: rows of small pyramids, and the tubes behind."""
    y, x = np.mgrid[0:256, 0:512]
    facets = 0.93 + 0.07 * (((x // 8) + (y // 8)) % 2)
    tubes = 0.86 + 0.14 * np.exp(-(((y % 64) - 32) ** 2) / 250)
    return byte_image((facets * tubes)[..., None] * np.array([0.97, 0.985, 1.0]))
