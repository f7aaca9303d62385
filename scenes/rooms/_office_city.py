"""The city outside the windows of `open_office`."""

import numpy as np
from PIL import Image, ImageDraw

from ._noise import byte_image, colour, mix, noise, stretched, whole


def city() -> np.ndarray:
    """Sky with clouds above three depths of houses and a row of trees."""
    random, wide, high = np.random.default_rng(224), 2048, 640
    clouds = np.clip(stretched(noise(512, 512, 225, 6, 4, 0.6), high, wide) * 2.2 - 0.7, 0, 1)
    canvas = Image.fromarray(byte_image(mix(colour("8fb6da"), colour("eef1f3"), clouds)))
    draw = ImageDraw.Draw(canvas)
    for depth, (base, tall) in enumerate(((385, 110), (440, 110), (520, 110))):
        left = -20
        while left < wide:
            width, top = int(random.integers(50, 150) * (1 + 0.3 * depth)), base - int(random.integers(20, tall))
            _house(draw, random, (left, top, left + width, high), depth)
            left += width + int(random.integers(0, 12))
    image = np.asarray(canvas) / 255
    y, rough = np.mgrid[0:high, 0:wide][0] / high, stretched(noise(512, 512, 226, 6, 24, 0.7), high, wide)
    trees = y > 0.8 + 0.25 * (rough - 0.5)
    image[trees] = mix(colour("2e4626"), colour("93a868"), rough)[trees]
    return byte_image(image * (0.9 + 0.15 * rough)[..., None])


def _house(draw: ImageDraw.ImageDraw, random: np.random.Generator, box: tuple, depth: int) -> None:
    left, top, right, low = box
    tones = (
        ("93a3b0", "a9b4bb", "8fa0a8", "b3aba2") if depth == 0 else ("b58a70", "8f989e", "c9c2b4", "7c5a4c", "68747d")
    )
    base = colour(tones[random.integers(0, len(tones))]) * random.uniform(0.85, 1.1)
    draw.rectangle(box, fill=whole(np.clip(base, 0, 1) * 255), outline=whole(base * 160))
    draw.rectangle((left, top, right, top + 6), fill=whole(base * 140))
    step, pane = 14 + 6 * depth, 7 + 4 * depth
    for y in range(top + 14, low, step + 4):
        for x in range(left + 6, right - pane, step):
            glass = (
                (255, 226, 160)
                if random.random() < 0.04
                else whole(random.uniform(0.25, 0.7) * np.array([150, 185, 215]))
            )
            draw.rectangle((x, y, x + pane, y + pane + 4), fill=glass)
