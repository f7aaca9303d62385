"""Textures of cloth: a rug, a plaid, a cushion."""

import numpy as np

from ._noise import byte_image, colour, mix, noise

SIZE = 768


def _cells() -> tuple[np.ndarray, np.ndarray]:
    """(SIZE, SIZE) coordinates in [-1, 1) that are constant over stitches of 16 pixels."""
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    return (x // 16) * 16 / SIZE * 2 - 1, (y // 16) * 16 / SIZE * 2 - 1


def rug() -> np.ndarray:
    """A woven rug of diamonds with a border."""
    u, v = _cells()
    palette = np.array([colour(text) for text in ("8c1c2b", "e6c678", "1f3a5f", "d9d2c0", "c4622d", "2f5d3a")])
    border = 2 * (np.maximum(np.abs(u), np.abs(v)) > 0.82)
    kind = (np.floor((np.abs(u) + np.abs(v)) * 6) + np.floor(np.abs(u * v) * 9) + border).astype(int) % 6
    return byte_image(palette[kind] * (0.75 + 0.4 * noise(SIZE, SIZE, 27, 3, 128, 0.8))[..., None])


def plaid() -> np.ndarray:
    """Blue plaid with yellow and red threads."""
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    across, along = (0.5 + 0.5 * np.sign(np.sin(axis / SIZE * 24 * np.pi)) for axis in (x, y))
    image = mix(colour("3c4f76"), colour("5b7aa8"), (across + along) / 2)
    image[x % 64 < 6] = colour("d8c15a")
    red = y % 64 < 6
    image[red] = image[red] * 0.4 + 0.6 * colour("b03a3a")
    return byte_image(image * (0.7 + 0.5 * noise(SIZE, SIZE, 28, 3, 150, 0.9))[..., None])


def cushion() -> np.ndarray:
    """Rings of two colours."""
    u, v = _cells()
    image = mix(colour("8b3a2a"), colour("e09a5a"), (np.sin((u * u + v * v) * 20) > 0).astype(float))
    return byte_image(image * (0.7 + 0.5 * noise(SIZE, SIZE, 29, 4, 40, 0.8))[..., None])
