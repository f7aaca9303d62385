"""Smaller pictures and the cameras that took them."""

from collections.abc import Iterable

import numpy as np

from ..scenes.types import Cameras


def image_shrunk(image: np.ndarray, factor: int) -> np.ndarray:
    """(H // factor, W // factor, 3) float32 means of squares of pixels of an image (H, W, 3)."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    rows = image[: height * factor : factor].copy()
    for k in range(1, factor):
        rows += image[k : height * factor : factor]
    small = np.empty((height, width, 3), np.float32)
    for channel in range(3):  # one by one: numpy is slow where the innermost axis is of length 3
        plane = rows[:, : width * factor, channel]
        small[..., channel] = plane[:, ::factor]
        for k in range(1, factor):
            small[..., channel] += plane[:, k::factor]
    small *= np.float32(1 / (factor * factor))
    return small


def images_shrunk(images: Iterable[np.ndarray], factor: int) -> np.ndarray:
    """(K, H // factor, W // factor, 3) of all of them."""
    return np.stack([image_shrunk(image, factor) for image in images])


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
