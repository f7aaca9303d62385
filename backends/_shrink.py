"""Smaller pictures and the cameras that took them."""

import numpy as np

from ..scenes.types import Cameras


def images_shrunk(images: np.ndarray, factor: int) -> np.ndarray:
    """(K, H // factor, W // factor, 3) means of squares of pixels."""
    k, height, width, _ = images.shape
    h, w = height // factor, width // factor
    return images[:, : h * factor, : w * factor].reshape(k, h, factor, w, factor, 3).mean(axis=(2, 4))


def cameras_shrunk(cameras: Cameras, factor: int) -> Cameras:
    """Of those pictures; what is cut off at the right and below moves no centre."""
    return Cameras(
        cameras.c2w,
        cameras.fx / factor,
        cameras.fy / factor,
        cameras.cx / factor,
        cameras.cy / factor,
        cameras.width // factor,
        cameras.height // factor,
    )
