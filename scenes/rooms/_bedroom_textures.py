"""Textures of the bedroom's surfaces and cloth: parquet, boards, wallpaper, quilt, knitting, carpet, cork."""

import numpy as np
from PIL import Image, ImageDraw

from ._noise import between, byte_image, colour, mix, noise, whole

SIZE = 1024
PLANK = 4  # how many times as long as wide a block of the parquet is
GARDEN = ("b4482e", "d98a3a", "8f2f3c", "e0b458")
CLOTHS = ("a63d2f", "d99a3c", "efe2c4", "5b6b3a", "7a3b52", "c9785a", "3d3a36", "8a9a6a", "e8c9a0")
WOOLS = ("7d2b22", "d59a3a", "ece0c6", "3a3330", "66703a", "b85f34")


def herringbone() -> np.ndarray:
    """Blocks of pale oak laid in a herringbone, 16 block widths across."""
    cell, random = SIZE // 16, np.random.default_rng(301)
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    i, j = x // cell, y // cell
    step = (i - j) % (2 * PLANK)
    lying = step < PLANK
    first = np.where(lying, (i - step) % 16 * 16 + j, i * 16 + (j - (2 * PLANK - 1 - step)) % 16)
    tone, turn = random.random(512), random.integers(0, SIZE, 512)
    block = first + 256 * lying
    fine, patches = noise(SIZE, 64, 302, 4, 64, 0.8), noise(SIZE, SIZE, 303, 5, 8)
    long, wide = np.where(lying, x, y), np.where(lying, y, x)
    grain = fine[(wide * 3 + turn[block]) % SIZE, (long // 14 + turn[block]) % 64]
    image = mix(colour("a8743f"), colour("e6bd84"), np.clip(0.15 + 0.75 * tone[block] + 0.5 * (grain - 0.5), 0, 1))
    along = np.where(lying, step * cell + x % cell, (2 * PLANK - 1 - step) * cell + y % cell)
    across = np.where(lying, y, x) % cell
    image[(along < 4) | (across < 4)] *= 0.5
    return byte_image(image * (0.72 + 0.35 * grain + 0.25 * (patches - 0.5))[..., None])


def boards(seed: int, dark: str, light: str, rows: int, knots: int, wear: float = 0.2) -> np.ndarray:
    """`rows` boards along the texture's width, with grain, `knots` in all and dark joints."""
    random = np.random.default_rng(seed)
    high = SIZE // rows
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    row = np.minimum(y // high, rows - 1)
    bend = (noise(SIZE, SIZE, seed + 1, 4, 4) - 0.5) * 60
    rings = np.zeros((SIZE, SIZE))
    dots = np.zeros((SIZE, SIZE))
    for _ in range(knots):
        at_x, at_y = random.integers(0, SIZE), random.integers(0, rows) * high + random.uniform(0.3, 0.7) * high
        radius = random.uniform(5, 12)
        away = ((x - at_x + SIZE // 2) % SIZE - SIZE // 2) / 2.2, y - at_y
        distance = np.sqrt(away[0] ** 2 + away[1] ** 2)
        bend += 28 * np.clip(1 - distance / (5 * radius), 0, 1) * np.sign(away[1])
        dots = np.maximum(dots, np.clip(1.4 - distance / radius, 0, 1))
    shift = random.uniform(0, 400, rows)[row]
    rings = 0.5 + 0.5 * np.sin((y + bend + shift) * (0.34 + 0.1 * (row % 3)))
    fibre = noise(SIZE, 32, seed + 2, 4, 32, 0.8)[y, x // 32]
    share = np.clip(0.4 * rings + 0.35 * fibre + random.uniform(0, 0.45, rows)[row], 0, 1)
    image = mix(colour(dark), colour(light), share)
    image = image * (1 - 0.72 * dots[..., None]) + 0.72 * dots[..., None] * colour(dark) * 0.45
    image *= (1 + wear * 2 * (noise(SIZE, SIZE, seed + 3, 6, 6, 0.6) - 0.5))[..., None]
    image[y % high < 5] *= 0.42
    return byte_image(image)


def blossom() -> np.ndarray:
    """Wallpaper of winding stems with leaves, flowers and berries on warm cream."""
    random, canvas = np.random.default_rng(310), Image.new("RGB", (SIZE, SIZE), (236, 219, 182))
    draw = ImageDraw.Draw(canvas)

    def round_shape(x: float, y: float, r: float, fill: tuple[int, ...], tall: float = 1.0) -> None:
        for dx in (-SIZE, 0, SIZE):
            for dy in (-SIZE, 0, SIZE):
                draw.ellipse(whole((x + dx - r, y + dy - r * tall, x + dx + r, y + dy + r * tall)), fill=fill)

    def leaf(x: float, y: float, angle: float, long: float, fill: tuple[int, ...]) -> None:
        way, side = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        foot = np.array([x, y])
        outline = [foot, foot + way * long * 0.5 + side * long * 0.24, foot + way * long]
        outline += [foot + way * long * 0.5 - side * long * 0.24]
        for dx in (-SIZE, 0, SIZE):
            for dy in (-SIZE, 0, SIZE):
                draw.polygon([whole(corner + [dx, dy]) for corner in outline], fill=fill)

    for k in range(1024):
        x, y = k % 32 * 32 + 16 * (k // 32 % 2), k // 32 * 32
        round_shape(x, y, 4 + 2 * (k % 3 == 0), ((214, 186, 140), (246, 234, 206), (204, 176, 120))[k % 3])
    for stem in range(5):
        for y in range(0, SIZE, 6):
            x = (stem + 0.5) * SIZE / 5 + 46 * np.sin(y / SIZE * 6 * np.pi + stem * 2.1)
            round_shape(x, y, 4, (104, 112, 62))
            if y % 54 == 0:
                side = 1 if y // 54 % 2 else -1
                green = whole(255 * between("4f5f2c", "98a25a", random.random()))
                leaf(x, y, -1.2 + side * random.uniform(0.9, 1.4), random.uniform(56, 84), green)
                round_shape(x - side * random.uniform(18, 52), y + 20, random.uniform(4, 8), (150, 52, 44))
            if (y // 6 + stem * 11) % 29 == 0:
                petals, petal = random.integers(5, 9), whole(255 * colour(GARDEN[random.integers(0, 4)]))
                for k in range(petals):
                    turn = k * 2 * np.pi / petals
                    round_shape(x + 22 * np.cos(turn), y + 22 * np.sin(turn), 14, petal)
                round_shape(x, y, 11, (244, 214, 128))
                round_shape(x, y, 5, (92, 50, 28))
    image = np.asarray(canvas) / 255.0
    return byte_image(image * (0.8 + 0.35 * noise(SIZE, SIZE, 311, 6, 8, 0.6))[..., None])


def patchwork() -> np.ndarray:
    """A quilt of eight by eight patches of nine cloths, each with a pattern, and stitches along the seams."""
    random, side = np.random.default_rng(320), 96
    y, x = np.mgrid[0:side, 0:side]
    u, v = x - side / 2 + 0.5, y - side / 2 + 0.5
    patterns = (
        (x % 16 - 8) ** 2 + (y % 16 - 8) ** 2 < 18,
        x % 16 < 6,
        (x // 12 + y // 12) % 2 == 0,
        (x + y) % 24 < 9,
        np.abs(np.hypot(u, v) % 20 - 10) < 4,
        (np.abs(u) + np.abs(v)) % 30 < 10,
        (x % 32 < 4) | (y % 32 < 4) | ((x + y) % 32 < 3),
    )
    image = np.zeros((8 * side, 8 * side, 3))
    for i in range(8):
        for j in range(8):
            base, over = random.choice(len(CLOTHS), 2, replace=False)
            patch = image[i * side : (i + 1) * side, j * side : (j + 1) * side]
            patch[:] = colour(CLOTHS[base])
            patch[patterns[random.integers(0, len(patterns))]] = colour(CLOTHS[over])
            edge = np.maximum(np.abs(u), np.abs(v))
            patch[(edge > 42) & (edge < 45) & ((x + y) % 12 < 7)] = colour("f4ecd8")
            patch[edge > 46.5] *= 0.55
    return byte_image(image * (0.78 + 0.4 * noise(8 * side, 8 * side, 321, 5, 32, 0.8))[..., None])


def knitting(seed: int, ground: str, yarn: str, third: str) -> np.ndarray:
    """Bands of stars, zigzags and dots of 32 by 48 stitches, each stitch a little V."""
    stitch = 16
    y, x = np.mgrid[0 : 48 * stitch, 0 : 32 * stitch]
    i, j = y // stitch, (x // stitch) % 16 - 8
    high = np.abs(i % 24 - 9)
    star = (
        (high <= 6) & ((np.abs(j) == high) | (np.abs(j) <= 0) | (high == 0) | (np.abs(j) + high == 6)) & (i % 24 < 16)
    )
    zigzag = (i % 24 >= 18) & (i % 24 < 22) & ((np.abs(j % 8 - 4) - i % 24) % 4 < 2)
    dots = (i % 24 == 16) & (j % 2 == 0) | (i % 24 == 23) & (j % 4 < 2)
    image = np.tile(colour(ground), (*i.shape, 1))
    image[star] = colour(yarn)
    image[zigzag] = colour(third)
    image[dots] = colour(yarn)
    v = (y + np.abs(x % stitch - stitch / 2)) % stitch / stitch
    image *= (0.72 + 0.4 * v)[..., None]
    return byte_image(image * (0.8 + 0.35 * noise(48 * stitch, 32 * stitch, seed, 4, 32, 0.8))[..., None])


def kilim() -> np.ndarray:
    """A flat-woven carpet: bands of stepped lozenges, teeth and stripes, with a border."""
    n, pixel = 96, 8
    i, j = np.mgrid[0:n, 0:n]
    band, within = i // 16, i % 16
    centre = np.abs((j + 8 * (band % 2)) % 16 - 8) + np.abs(within - 8)
    kind = np.where(centre < 3, 0, np.where(centre < 6, 1, np.where(centre < 8, 2, 3)))
    kind = (kind + 2 * band) % 6
    teeth = within < 2
    kind[teeth] = np.where((j + i) % 4 < 2, 3, 2)[teeth]
    stripes = (band % 3 == 2) & (within > 9)
    kind[stripes] = ((within // 2 + j // 6) % 6)[stripes]
    border = np.minimum(np.minimum(i, n - 1 - i), np.minimum(j, n - 1 - j))
    kind = np.where(border < 6, np.where((i + j) % 8 < 4, 0, 1), kind)
    kind = np.where(border == 6, 3, kind)
    palette = np.array([colour(text) for text in WOOLS])
    image = np.repeat(np.repeat(palette[kind], pixel, 0), pixel, 1)
    return byte_image(image * (0.7 + 0.5 * noise(n * pixel, n * pixel, 331, 4, 96, 0.85))[..., None])


def weave(seed: int, ground: str, first: str, second: str) -> np.ndarray:
    """Cloth with checks of two colours over a ground."""
    y, x = np.mgrid[0:512, 0:512]
    image = np.tile(colour(ground), (512, 512, 1))
    for axis in (x, y):
        for start, wide, text in ((10, 30, first), (58, 8, second), (76, 8, second), (100, 14, first)):
            bar = (axis - start) % 128 < wide
            image[bar] = 0.5 * image[bar] + 0.5 * colour(text)
    return byte_image(image * (0.75 + 0.45 * noise(512, 512, seed, 4, 64, 0.85))[..., None])


def cork() -> np.ndarray:
    """Crumbs of cork."""
    image = mix(colour("8a5a30"), colour("d9a86a"), noise(512, 512, 341, 5, 24, 0.8))
    image[noise(512, 512, 342, 3, 70, 0.8) > 0.66] = colour("5a361c")
    return byte_image(image)
