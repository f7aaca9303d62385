"""Textures of single things in the bedroom: books, basket, lantern, screen, painted wood, guitar, globe, the view."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from . import _pictures
from ._noise import byte_image, colour, hsv, mix, noise, whole


def screen() -> np.ndarray:
    """A monitor with a window of text, a chart and a picture."""
    canvas, random = Image.new("RGB", (512, 320), (38, 34, 46)), np.random.default_rng(501)
    draw = ImageDraw.Draw(canvas)
    draw.rectangle((8, 8, 300, 300), fill=(248, 243, 230))
    draw.rectangle((8, 8, 300, 28), fill=(190, 90, 54))
    draw.text((16, 8), "thesis - chapter 3", font=ImageFont.load_default(15), fill=(255, 245, 230))
    for line in range(17):
        x = 20 + 16 * int(line % 5 == 0)
        while x < 270:
            word = int(random.integers(10, 42))
            draw.rectangle((x, 40 + 15 * line, min(x + word, 288), 46 + 15 * line), fill=(70, 62, 60))
            x += word + 8
    draw.rectangle((312, 8, 504, 150), fill=(252, 248, 238))
    for k in range(9):
        high = int(random.integers(20, 120))
        draw.rectangle((322 + 20 * k, 142 - high, 336 + 20 * k, 142), fill=hsv(k / 12, 0.7, 0.8))
    image = np.asarray(canvas) / 255.0
    hills = noise(140, 192, 502, 5, 3)
    image[160:300, 312:504] = mix(colour("4a5f34"), colour("f3c67a"), hills)
    return byte_image(image)


def keys() -> np.ndarray:
    """Five rows of keys."""
    canvas, random = Image.new("RGB", (512, 192), (58, 50, 48)), np.random.default_rng(503)
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(18)
    for i in range(5):
        for j in range(15):
            left, top = 6 + 33 * j + (9 * i) % 20, 8 + 36 * i
            fill = (214, 120, 70) if (i, j) in ((0, 0), (2, 14), (4, 7)) else (228, 218, 200)
            draw.rectangle((left, top, left + 28, top + 31), fill=fill)
            draw.text((left + 8, top + 4), chr(65 + int(random.integers(0, 26))), font=font, fill=(60, 50, 46))
    return np.asarray(canvas)


def folk() -> np.ndarray:
    """A panel painted by hand: red-brown ground, scrolls, flowers and a border of dots."""
    canvas = Image.new("RGB", (512, 1024), (122, 44, 32))
    draw, random = ImageDraw.Draw(canvas), np.random.default_rng(504)
    cream, gold, moss = (240, 222, 180), (222, 164, 70), (120, 132, 70)
    draw.rectangle((22, 22, 489, 1001), outline=gold, width=8)
    for k in range(40):
        y = 48 + 24 * k
        for x in (44, 468):
            draw.ellipse((x - 6, y - 6, x + 6, y + 6), fill=cream if k % 2 else gold)
    for level in range(4):
        y = 160 + 230 * level
        for side in (-1, 1):
            for k in range(24):
                turn, out = k * 0.26, 96 - 3.4 * k
                x, up = 256 + side * (96 + out * np.cos(turn)), y + out * np.sin(turn)
                r = 15 - 0.5 * k
                draw.ellipse(whole((x - r, up - r, x + r, up + r)), fill=moss if level % 2 else cream)
        for k in range(9):
            x, up = 256 + 44 * np.cos(k * 0.7), y + 44 * np.sin(k * 0.7)
            draw.ellipse(whole((x - 22, up - 22, x + 22, up + 22)), fill=(cream, gold, (202, 96, 58))[k % 3])
        draw.ellipse((230, y - 26, 282, y + 26), fill=(64, 30, 26))
        for _ in range(14):
            x, up = random.integers(80, 432), y + random.integers(-110, 110)
            draw.polygon([whole(p) for p in ((x, up), (x + 14, up - 8), (x + 30, up), (x + 14, up + 8))], fill=gold)
    image = np.asarray(canvas) / 255.0
    return byte_image(image * (0.72 + 0.45 * noise(1024, 512, 505, 6, 12, 0.65))[..., None])


def guitar() -> np.ndarray:
    """The top of a guitar, the neck's side up: hole, ring, bridge and strings."""
    y, x = np.mgrid[0:1:512j, -0.5:0.5:384j]
    image = mix(colour("c9863c"), colour("f0c078"), noise(512, 24, 506, 4, 16, 0.8)[:, (x[0] * 20).astype(int) + 11])
    image *= (1 - 0.5 * np.clip(np.hypot(x * 1.2, y - 0.55) * 1.6 - 0.35, 0, 1))[..., None]
    away = np.hypot(x * 384, (y - 0.36) * 512)
    ring = (away < 76) & (away > 56)
    image[ring] = mix(colour("5a2418"), colour("f4e0b0"), ((x * 96 + y * 128).astype(int) % 2).astype(float))[ring]
    image[away < 54] = colour("1c1210")
    image[(np.abs(x) < 0.2) & (np.abs(y - 0.76) < 0.022)] = colour("3a1e14")
    for k in range(6):
        string = (np.abs(x - 0.016 * (k - 2.5)) < 0.0025) & (y < 0.76)
        image[string] = colour("e8e0d0")
    return byte_image(image)


def globe() -> np.ndarray:
    """Lands on a faded sea, with circles of latitude and longitude."""
    land = noise(256, 256, 507, 6, 3, 0.55)
    image = mix(colour("c08a48"), colour("e8d9a4"), noise(256, 256, 508, 5, 6))
    image[land < 0.52] = colour("8fa7a0")
    image[np.abs(land - 0.52) < 0.012] = colour("5a3a20")
    y, x = np.mgrid[0:256, 0:256]
    image[(x % 64 < 2) | (y % 32 < 2)] *= 0.72
    return byte_image(image)


def clock() -> np.ndarray:
    """A dial with twelve numbers."""
    canvas = Image.new("RGB", (256, 256), (240, 228, 196))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(34)
    draw.ellipse((6, 6, 250, 250), outline=(110, 44, 30), width=8)
    for k in range(12):
        x, y = 128 + 92 * np.sin(k * np.pi / 6), 128 - 92 * np.cos(k * np.pi / 6)
        draw.text((int(x - 10), int(y - 20)), str(k or 12), font=font, fill=(60, 30, 24))
    draw.line((128, 128, 176, 74), fill=(50, 26, 22), width=9)
    draw.line((128, 128, 62, 128), fill=(176, 60, 36), width=6)
    return np.asarray(canvas)


def fells() -> np.ndarray:
    """A morning outside: pale gold sky, fells, spruces, a lake and red cottages."""
    wide, high = 512, 512
    y, x = np.mgrid[0 : 1 : high * 1j, 0 : 1 : wide * 1j]
    clouds = np.clip(noise(high, wide, 509, 6, 3) * 2 - 0.7, 0, 1)
    image = mix(colour("c4cfe0"), colour("f6d7a8"), y * 1.5 - 0.2)
    image += 0.7 * clouds[..., None] * (colour("fff0d8") - image)
    for k, text in enumerate(("a99ab0", "85798c", "5f6048")):
        ridge = 0.4 + 0.1 * k + 0.16 * (noise(8, wide, 510 + k, 5, 3, 0.55)[0] - 0.5) * 2
        image[y > ridge[None]] = colour(text)
    water = y > 0.72
    glint = (noise(high, 16, 514, 4, 64, 0.8)[:, (x[0] * 15).astype(int)] > 0.56) & water
    image[water] = mix(colour("8a94a0"), colour("d8b890"), (y - 0.7) * 2)[water]
    image[glint] = colour("fbe6c0")
    canvas, random = Image.fromarray(byte_image(image)), np.random.default_rng(515)
    draw = ImageDraw.Draw(canvas)
    for k in range(46):
        cx, foot, tall = random.integers(0, wide), random.integers(380, 470), random.integers(60, 130)
        for step in range(5):
            top = foot - tall + step * tall // 6
            corners = [(cx, top), (cx - 6 - 5 * step, top + tall // 3), (cx + 6 + 5 * step, top + tall // 3)]
            draw.polygon([whole(p) for p in corners], fill=((38, 52, 34), (56, 70, 40), (30, 42, 34))[k % 3])
    for cx, foot in ((110, 440), (300, 462), (400, 430)):
        draw.rectangle((cx, foot - 40, cx + 62, foot), fill=(154, 48, 34), outline=(240, 230, 214), width=3)
        draw.polygon([(cx - 6, foot - 38), (cx + 31, foot - 66), (cx + 68, foot - 38)], fill=(62, 52, 50))
        draw.rectangle((cx + 22, foot - 28, cx + 38, foot - 14), fill=(250, 226, 150))
    for _ in range(900):
        cx, cy = random.integers(0, wide), random.integers(462, high)
        draw.line(whole((cx, cy, cx + random.integers(-4, 5), cy - 12)), fill=hsv(random.uniform(0.1, 0.25), 0.5, 0.7))
    return np.asarray(canvas)


def wicker() -> np.ndarray:
    """Woven willow."""
    y, x = np.mgrid[0:512, 0:512]
    bulge = np.abs(np.sin(x / 512 * 24 * np.pi + np.pi / 2 * (y // 22 % 2))) * np.abs(np.sin(y / 22 * np.pi)) ** 0.5
    image = mix(colour("4a2c14"), colour("c99458"), bulge)
    return byte_image(image * (0.75 + 0.5 * noise(512, 512, 343, 5, 16, 0.8))[..., None])


def lantern() -> np.ndarray:
    """Paper over ribs, with leaves pressed into it."""
    y = np.mgrid[0:512, 0:512][0]
    image = mix(colour("d99e58"), colour("ffe7b8"), np.abs(np.sin(y / 512 * 14 * np.pi)) ** 0.5)
    image[np.abs(noise(512, 512, 344, 4, 5) - 0.52) < 0.02] *= 0.62
    return byte_image(image * (0.75 + 0.3 * noise(512, 512, 345, 4, 12))[..., None])


def volumes() -> np.ndarray:
    """Spines of old books: those that rooms share, faded and browned."""
    image = _pictures.books() / 255.0
    faded = 0.6 * image + 0.4 * image.mean(axis=2, keepdims=True)
    return byte_image(faded * np.array([1.1, 0.92, 0.7]) + 0.07)
