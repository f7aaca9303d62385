"""Pictures of `glass_living`: eight posters, the city behind the garden at evening, the rug, a chess board."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ._noise import between, byte_image, colour, mix, noise, tiled, whole

SIDE = 256  # pixels of one poster; `posters` is two rows of four
GOLD, WINE, GREEN, CREAM, NIGHT = (214, 172, 82), (122, 32, 52), (36, 92, 76), (242, 230, 204), (22, 28, 48)


def posters() -> np.ndarray:
    """A sunrise, a tower, a liner, a heron, a lady, overlapping discs, a dance bill, lilies."""
    drawn = [_sunrise(), _tower(), _liner(), _heron(), _lady(), _discs(), _bill(), _lilies()]
    pictures = []
    for k, picture in enumerate(drawn):
        paper = 0.82 + 0.3 * noise(SIDE, SIDE, 230 + k, 5, 6, 0.7)
        pictures.append(np.asarray(picture) / 255 * paper[..., None])
    return byte_image(tiled(pictures, 4))


def _canvas(fill: tuple) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    canvas = Image.new("RGB", (SIDE, SIDE), fill)
    return canvas, ImageDraw.Draw(canvas)


def _sunrise() -> Image.Image:
    canvas, draw = _canvas(NIGHT)
    for k in range(18):
        fill = (GOLD, WINE, CREAM)[k % 3]
        draw.pieslice((-160, -40, 416, 536), 180 + 10 * k, 190 + 10 * k, fill=fill)
    for k, fill in enumerate((GREEN, GOLD, (18, 52, 48), CREAM, GREEN)):
        draw.ellipse((-60 + 50 * k, 190 + 8 * k, 150 + 50 * k, 330), fill=fill, outline=NIGHT, width=3)
    draw.ellipse((78, 120, 178, 220), fill=(250, 205, 110), outline=CREAM, width=5)
    return canvas


def _tower() -> Image.Image:
    canvas, draw = _canvas((90, 140, 140))
    random = np.random.default_rng(231)
    for _ in range(14):
        left, top = int(random.integers(-20, 240)), int(random.integers(60, 190))
        draw.rectangle((left, top, left + 34, 256), fill=whole(between("24403c", "8a6a4c", random.random()) * 255))
    for k in range(5):
        draw.rectangle((88 + 9 * k, 200 - 36 * k, 168 - 9 * k, 256), fill=GOLD if k % 2 else WINE)
        for x in range(94 + 9 * k, 164 - 9 * k, 9):
            draw.line((x, 204 - 36 * k, x, 256), fill=CREAM, width=2)
    draw.polygon(((124, 56), (132, 56), (128, 6)), fill=CREAM)
    return canvas


def _liner() -> Image.Image:
    canvas, draw = _canvas((232, 190, 120))
    draw.rectangle((0, 190, 256, 256), fill=(30, 84, 92))
    draw.polygon(((30, 90), (200, 60), (250, 120), (190, 215), (70, 215)), fill=NIGHT)
    draw.polygon(((30, 90), (200, 60), (205, 78), (36, 108)), fill=CREAM)
    for k in range(3):
        draw.rectangle((80 + 40 * k, 22 - 5 * k, 104 + 40 * k, 84 - 8 * k), fill=WINE)
        draw.rectangle((80 + 40 * k, 34 - 5 * k, 104 + 40 * k, 44 - 5 * k), fill=CREAM)
    for k in range(9):
        draw.ellipse((60 + 15 * k, 124 - k, 67 + 15 * k, 131 - k), fill=GOLD)
    for k in range(12):
        draw.arc((22 * k - 12, 212, 22 * k + 12, 232), 0, 180, fill=CREAM, width=3)
    return canvas


def _heron() -> Image.Image:
    canvas, draw = _canvas(GREEN)
    draw.ellipse((120, 20, 236, 136), fill=(244, 214, 140))
    for k in range(16):
        draw.line((16 * k, 256, 16 * k + 26 * (-1) ** k, 120 + 9 * (k * 5 % 9)), fill=(120, 160, 80), width=4)
    draw.ellipse((70, 120, 170, 186), fill=CREAM, outline=NIGHT, width=4)
    draw.line((84, 140, 66, 90, 96, 60), fill=CREAM, width=12)
    draw.polygon(((90, 52), (150, 66), (92, 72)), fill=GOLD)
    draw.line((110, 184, 106, 250), fill=WINE, width=5)
    draw.line((130, 184, 134, 250), fill=WINE, width=5)
    return canvas


def _lady() -> Image.Image:
    canvas, draw = _canvas((150, 44, 60))
    for k in range(8):
        draw.ellipse((128 - 20 * (8 - k), 110 - 20 * (8 - k), 128 + 20 * (8 - k), 110 + 20 * (8 - k)), outline=GOLD)
    draw.polygon(((40, 256), (90, 190), (166, 190), (216, 256)), fill=(28, 92, 80))
    draw.rectangle((112, 150, 144, 200), fill=(226, 180, 140))
    draw.ellipse((84, 60, 172, 174), fill=(240, 200, 160))
    draw.pieslice((74, 40, 182, 160), 170, 370, fill=(24, 18, 22))
    draw.rectangle((76, 90, 180, 100), fill=GOLD)
    for x in (106, 150):
        draw.ellipse((x - 9, 112, x + 9, 120), fill=(30, 60, 60))
    draw.ellipse((116, 146, 140, 156), fill=(170, 20, 40))
    for k in range(11):
        draw.ellipse((82 + 9 * k, 194 + abs(k - 5) * -3 + 14, 90 + 9 * k, 216 - abs(k - 5) * 3), fill=CREAM)
    return canvas


def _discs() -> Image.Image:
    canvas, draw = _canvas(CREAM)
    random = np.random.default_rng(232)
    for k in range(44):
        x, y, r = random.integers(0, SIDE), random.integers(0, SIDE), random.integers(8, 46)
        fill = (GOLD, WINE, GREEN, NIGHT, (190, 120, 90))[k % 5]
        box = whole((x - r, y - r, x + r, y + r))
        if k % 2:
            draw.pieslice(box, int(random.integers(0, 360)), int(random.integers(360, 540)), fill=fill)
        else:
            draw.ellipse(box, outline=fill, width=6)
    return canvas


def _bill() -> Image.Image:
    canvas, draw = _canvas((20, 26, 30))
    for k in range(10):
        draw.line((0, 26 * k, 256, 26 * k + 40), fill=(70, 56, 30), width=3)
    lines = (("GRAND", 46, GOLD), ("BAL", 58, CREAM), ("jazz & tango", 30, (220, 120, 110)), ("31 OCT", 40, GOLD))
    for k, (text, size, fill) in enumerate(lines):
        draw.text((16 + 8 * k, 6 + 60 * k), text, font=ImageFont.load_default(size), fill=fill)
    return canvas


def _lilies() -> Image.Image:
    canvas, draw = _canvas((214, 200, 170))
    random = np.random.default_rng(233)
    for k in range(9):
        x, top = 20 + 27 * k, int(random.integers(30, 130))
        draw.line((128, 256, x, top), fill=(60, 110, 70), width=4)
        for turn in range(5):
            fill = ((245, 240, 225), (200, 80, 90), GOLD)[k % 3]
            draw.pieslice((x - 24, top - 24, x + 24, top + 24), turn * 72, turn * 72 + 44, fill=fill, outline=GREEN)
    draw.polygon(((96, 196), (160, 196), (150, 256), (106, 256)), fill=(40, 84, 110), outline=NIGHT)
    return canvas


def skyline() -> np.ndarray:
    """Evening over a city: clouds, towers with lit windows, trees, a hedge, lanterns, a paved terrace."""
    high, wide = 640, 1280
    y, x = np.mgrid[0:1:640j, 0:1:1280j]
    sky = mix(colour("7f8fc0"), colour("ffb870"), np.clip(y * 1.7, 0, 1))
    clouds = np.clip(noise(high, wide, 240, 6, 4, 0.6) * 2.4 - 1.0, 0, 1) * 0.8
    sky = sky * (1 - clouds[..., None]) + clouds[..., None] * colour("ffd9b8")
    canvas, random = Image.fromarray(byte_image(sky)), np.random.default_rng(241)
    draw = ImageDraw.Draw(canvas)
    for k in range(70):
        left, broad = int(random.integers(-30, wide)), int(random.integers(28, 80))
        top = int(random.integers(130, 330) + 60 * (k < 30))
        wall = between("5b5474", "b08478", random.random()) if k < 35 else between("39405c", "8a5a58", random.random())
        draw.rectangle((left, top, left + broad, high), fill=whole(wall * 255))
        draw.rectangle((left + broad // 3, top - 20, left + 2 * broad // 3, top), fill=whole(wall * 255))
        for px in range(left + 4, left + broad - 5, 9):
            for py in range(top + 6, 480, 12):
                if random.random() < 0.45:
                    draw.rectangle(
                        (px, py, px + 4, py + 6), fill=(255, 226, 150) if random.random() < 0.7 else (90, 110, 140)
                    )
    image = np.asarray(canvas) / 255
    rough = noise(high, wide, 242, 7, 6, 0.65)
    trees = y > 0.68 + 0.35 * (noise(high, wide, 243, 4, 8) - 0.5) + 0.1 * (rough - 0.5)
    image[trees] = mix(colour("1f3d24"), colour("8fae52"), np.clip(rough * 1.6 - 0.3, 0, 1))[trees]
    hedge = y > 0.84 + 0.02 * np.sin(x * 60)
    image[hedge] = mix(colour("274a2a"), colour("b0a04c"), noise(high, wide, 244, 5, 40, 0.8))[hedge]
    for k in range(40):
        cx, cy = random.random(), random.uniform(0.72, 0.95)
        spot = np.hypot((x - cx) * 2, y - cy) < random.uniform(0.008, 0.02)
        image[spot] = colour(("ffe6a0", "e86a7a", "f6f0e0")[k % 3])
    return byte_image(image)


def deco_rug() -> np.ndarray:
    """A carpet, four to three: stepped border, fans in the corners, a field of lozenges round a sun."""
    high, wide = 768, 1024
    y, x = np.mgrid[0:high, 0:wide]
    u, v = (x // 8 * 8 - 508) / 512 * 4 / 3, (y // 8 * 8 - 380) / 384
    palette = np.array([colour(t) for t in ("7a1f33", "e2c47c", "1e4f43", "e9dcc0", "b3662e", "2a2238", "5f8a72")])
    edge = np.minimum(4 / 3 - np.abs(u), 1 - np.abs(v))
    kind = (np.floor((np.abs(u) + np.abs(v)) * 7) + 2 * np.floor(np.abs(u - v) * 4)).astype(int) % 7
    sun = np.hypot(u, v)
    rays = np.where(np.floor(np.arctan2(v, u) / np.pi * 16) % 2 == 0, 1, 0)
    kind = np.where(sun < 0.55, rays, kind)
    kind = np.where(sun < 0.3, (np.floor(sun * 20) % 3 + 2).astype(int), kind)
    corner = np.hypot(4 / 3 - np.abs(u), 1 - np.abs(v))
    kind = np.where(corner < 0.6, (np.floor(corner * 14) % 4 + 1).astype(int), kind)
    steps = (np.floor(edge * 40) + np.floor((u + v) * 6)).astype(int) % 5
    kind = np.where(edge < 0.12, steps, kind)
    return byte_image(palette[kind] * (0.75 + 0.4 * noise(high, wide, 246, 3, 128, 0.8))[..., None])


def chess() -> np.ndarray:
    """A board of eight by eight, with a border."""
    y, x = np.mgrid[0:320, 0:320]
    light = ((x // 32 + y // 32) % 2).astype(float)
    image = mix(colour("3a1d16"), colour("e5cf9f"), light)
    image[(np.minimum(x, y) < 32) | (np.maximum(x, y) >= 288)] = colour("7c4a28")
    return byte_image(image * (0.75 + 0.4 * noise(320, 320, 247, 5, 10, 0.7))[..., None])
