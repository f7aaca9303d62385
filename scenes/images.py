"""Loads the pictures of a split at the size that training and scoring use."""

from pathlib import Path

import numpy as np

from ..common.errors import UserError
from .image_files import open_image
from .types import Cameras, Split


def load_images(split: Split, indices: np.ndarray, width: int | None) -> tuple[np.ndarray, Cameras]:
    """(K, H, W, 3) float32 RGB in [0, 1] of the frames at `indices`, and their pinhole cameras at that size.

    `width` in pixels resizes by area average; None keeps the size. Lens distortion is taken out, alpha is laid on
    white. Raises UserError for a missing or broken file, a size that is not the camera's, mixed sizes, and a lens
    that is not OpenCV's.
    """
    if split.lens:
        raise UserError(f"cameras are {split.lens}, not pinholes; undistort the capture (colmap image_undistorter)")
    indices = np.asarray(indices, dtype=np.int64)
    full = split.cameras[indices]
    cameras = full if width is None else full.scaled(width)
    sizes = set(zip(cameras.width.tolist(), cameras.height.tolist(), strict=True))
    if len(sizes) > 1:
        raise UserError(f"frames have different sizes, {sorted(sizes)}; resize the images of the capture to one")
    images = []
    for place, index in enumerate(indices):
        size = (int(cameras.width[place]), int(cameras.height[place]))
        pixels = _read(split.paths[index], (int(full.width[place]), int(full.height[place])), size)
        if cameras.distortion is not None:
            pixels = _undistorted(pixels, cameras[place])
        images.append(pixels)
    from dataclasses import replace

    return np.stack(images), replace(cameras, distortion=None)


def _read(path: Path, expected: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    from PIL import Image

    with open_image(path) as image:
        if image.size != expected:
            raise UserError(f"image '{path}' is {image.size[0]} x {image.size[1]}, its camera says {expected}")
        if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
            layered = image.convert("RGBA")
            image_rgb = Image.new("RGB", layered.size, "white")
            image_rgb.paste(layered, mask=layered.getchannel("A"))
        else:
            image_rgb = image.convert("RGB")
        return _area_average(np.asarray(image_rgb, dtype=np.float32) / 255, size)


def _area_average(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) averaged over the area of each new pixel, not rounded to 8 bits on the way."""
    from PIL import Image

    height, width = pixels.shape[:2]
    if (width, height) == size:
        return pixels
    if width % size[0] == 0 and height % size[1] == 0:
        blocks = pixels.reshape(size[1], height // size[1], size[0], width // size[0], 3)
        return blocks.mean(axis=(1, 3))
    channels = [Image.fromarray(pixels[..., c]).resize(size, Image.Resampling.BOX) for c in range(3)]
    return np.stack([np.asarray(channel) for channel in channels], axis=-1)


def _undistorted(pixels: np.ndarray, camera: Cameras) -> np.ndarray:
    """The picture that a pinhole with the same focal lengths and centre would see.

    OpenCV's model: x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²), y' likewise; sampled bilinearly.
    """
    from scipy.ndimage import map_coordinates

    assert camera.distortion is not None
    k1, k2, p1, p2, k3 = camera.distortion[0]
    fx, fy, cx, cy = camera.fx[0], camera.fy[0], camera.cx[0], camera.cy[0]
    v, u = np.mgrid[: pixels.shape[0], : pixels.shape[1]] + 0.5
    x, y = (u - cx) / fx, (v - cy) / fy
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    where = np.stack([yd * fy + cy - 0.5, xd * fx + cx - 0.5])
    channels = [map_coordinates(pixels[..., c], where, order=1, mode="nearest") for c in range(3)]
    return np.stack(channels, axis=-1)
