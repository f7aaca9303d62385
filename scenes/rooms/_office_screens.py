"""What the monitors of `open_office` show: code, charts, sheets, maps."""

import numpy as np
from PIL import Image, ImageDraw

from ._noise import hsv, whole
from ._office_pictures import INKS


def screens() -> np.ndarray:
    """Four by two pictures of monitors: code, charts, sheets, maps, each twice in other colours."""
    canvas = Image.new("RGB", (1280, 400))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(231)
    for k in range(8):
        left, top = k % 4 * 320, k // 4 * 200
        back = ((26, 30, 38), (236, 238, 240), (244, 246, 244), (205, 222, 214))[k % 4]
        draw.rectangle((left, top, left + 319, top + 199), fill=back)
        (_code, _charts, _cells, _map)[k % 4](draw, random, left, top)
        draw.rectangle((left, top, left + 319, top + 9), fill=hsv(0.55 + 0.05 * k, 0.4, 0.5))
    return np.asarray(canvas)


def _code(draw: ImageDraw.ImageDraw, random: np.random.Generator, left: int, top: int) -> None:
    draw.rectangle((left, top + 10, left + 50, top + 199), fill=(44, 50, 62))
    for row in range(22):
        x = left + 62 + 12 * int(random.integers(0, 5))
        for _ in range(random.integers(1, 6)):
            wide = int(random.integers(10, 46))
            draw.rectangle((x, top + 18 + row * 8, x + wide, top + 21 + row * 8), fill=hsv(random.random(), 0.45, 0.9))
            x = min(x + wide + 6, left + 260)
        draw.rectangle(
            whole((left + 6, top + 16 + row * 8, left + random.integers(16, 46), top + 19 + row * 8)),
            fill=(150, 160, 175),
        )


def _charts(draw: ImageDraw.ImageDraw, random: np.random.Generator, left: int, top: int) -> None:
    for k in range(14):
        tall = int(random.integers(10, 80))
        draw.rectangle(
            (left + 14 + 10 * k, top + 105 - tall, left + 21 + 10 * k, top + 105), fill=hsv(0.5 + k / 40, 0.7, 0.7)
        )
    for fill in INKS[:3]:
        heights = top + 185 - np.cumsum(random.normal(2, 6, 26))
        draw.line(
            [(left + 14 + 11 * k, float(np.clip(h, top + 118, top + 190))) for k, h in enumerate(heights)],
            fill=fill,
            width=2,
        )
    draw.pieslice((left + 200, top + 20, left + 290, top + 110), 0, 140, fill=(214, 160, 60))
    draw.pieslice((left + 200, top + 20, left + 290, top + 110), 140, 360, fill=(60, 110, 140))


def _cells(draw: ImageDraw.ImageDraw, random: np.random.Generator, left: int, top: int) -> None:
    for row in range(18):
        for column in range(8):
            box = (left + column * 40, top + 12 + row * 10, left + column * 40 + 39, top + 21 + row * 10)
            fill = hsv(random.random(), 0.3, 0.95) if random.random() < 0.3 else (250, 250, 250)
            draw.rectangle(box, fill=fill, outline=(190, 196, 200))
            draw.rectangle(
                whole((box[0] + 4, box[1] + 4, box[0] + random.integers(8, 34), box[1] + 6)), fill=(80, 86, 94)
            )


def _map(draw: ImageDraw.ImageDraw, random: np.random.Generator, left: int, top: int) -> None:
    for _ in range(26):
        x, y = left + int(random.integers(0, 270)), top + 12 + int(random.integers(0, 150))
        draw.rectangle(
            whole((x, y, x + random.integers(14, 48), y + random.integers(10, 36))),
            fill=hsv(random.uniform(0.1, 0.6), 0.25, 0.85),
        )
    for _ in range(9):
        y0, y1 = (top + int(value) for value in random.integers(14, 196, 2))
        draw.line((left, y0, left + 319, y1), fill=(255, 255, 255), width=int(random.integers(2, 7)))
    draw.line((left, top + 60, left + 120, top + 110, left + 319, top + 90), fill=(110, 160, 200), width=14)
