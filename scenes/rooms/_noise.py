"""What textures are made of: fractal noise, mixtures of colours, grids of coordinates."""

import colorsys
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image


def noise(height: int, width: int, seed: int, octaves: int = 5, base: int = 4, gain: float = 0.5) -> np.ndarray:
    """(height, width) in [0, 1] of repeating fractal noise: grids of `base`, 2 `base`, … cells, each times `gain`."""
    random = np.random.default_rng(seed)
    total, weight, weights = np.zeros((height, width)), 1.0, 0.0
    for octave in range(octaves):
        n = base * 2**octave
        grid = random.random((n + 1, n + 1)).astype(np.float32)
        grid[-1] = grid[0]
        grid[:, -1] = grid[:, 0]
        total += weight * resized((grid * 65535).astype(np.int32).astype(np.float32), height, width) / 65535
        weights += weight
        weight *= gain
    return np.clip(total / weights, 0, 1)


def resized(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """A grey image, float32 or uint8, resized bicubically."""
    return np.asarray(Image.fromarray(values).resize((width, height), Image.Resampling.BICUBIC))


def stretched(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """(height, width) of values in [0, 1], resized in steps of 1 / 255."""
    return resized((values * 255).astype(np.uint8), height, width) / 255.0


def colour(text: str) -> np.ndarray:
    """(3,) in [0, 1] of six hexadecimal digits."""
    return np.array([int(text[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0


def mix(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(H, W, 3): between two colours, or images, by (H, W) `share` of the second."""
    return np.asarray(first)[None, None] * (1 - share[..., None]) + np.asarray(second)[None, None] * share[..., None]


def between(first: str, second: str, share: float) -> np.ndarray:
    """(3,) colour between two."""
    return mix(colour(first), colour(second), np.full((1, 1), share))[0, 0]


def hsv(hue: float, saturation: float, value: float) -> tuple[int, int, int]:
    """RGB in 0..255, cut down to whole numbers."""
    red, green, blue = (int(255 * part) for part in colorsys.hsv_to_rgb(hue, saturation, value))
    return red, green, blue


def byte_image(values: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 of values in [0, 1], rounded."""
    return (np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8)


def whole(values: Any) -> tuple[int, ...]:
    """The values as a tuple of integers, which is what Pillow takes for colours and places."""
    return tuple(int(value) for value in values)


def tiled(pictures: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """(H, W, 3) of pictures of one size, row by row, so many in a row."""
    rows = [pictures[k : k + columns] for k in range(0, len(pictures), columns)]
    return np.concatenate([np.concatenate(row, 1) for row in rows])
