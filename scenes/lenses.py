"""Takes lens distortion out of pictures, with no border that the lens never saw.

OpenCV's model, x and y being a pinhole's coordinates at depth 1:

    x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
    y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y

A pinhole of the same focal length looks past the border of a pincushion lens's picture, and whatever is put there
(colour smeared from the border, black) would be trained on and scored. So the pinhole's focal lengths are larger by the
least factor that keeps every pixel within the picture: OpenCV's `getOptimalNewCameraMatrix` with alpha = 0 does so too.
"""

from dataclasses import replace

import numpy as np

from ..common.errors import UserError
from .types import Cameras

STEP = 1 / 1024  # of the factor: one that every machine rounds alike
LARGEST = 4.0  # more is no lens but a damaged file


@np.errstate(all="ignore")  # a damaged file's numbers overflow, and are found so
def zoom(camera: Cameras) -> float:
    """The least factor, from 1 to 4, of the focal lengths of the pinhole that sees nothing beyond the camera's picture.

    Raises UserError for a lens that no such pinhole fits: its formula folds the picture over, or leads out of it.
    """
    assert camera.distortion is not None
    low, high = 0, round((LARGEST - 1) / STEP)
    if not _within(camera, LARGEST):
        raise UserError(
            f"the lens distortion {camera.distortion[0].tolist()} cannot be taken out of pictures of "
            f"{camera.width[0]} x {camera.height[0]}; undistort the capture (colmap image_undistorter), or correct it"
        )
    while low < high:  # the larger the factor, the nearer to the middle every pixel looks
        middle = (low + high) // 2
        low, high = (low, middle) if _within(camera, 1 + middle * STEP) else (middle + 1, high)
    return 1 + low * STEP


def pinholes(cameras: Cameras) -> Cameras:
    """The pinholes that see what the cameras see, of the same sizes and centres, focal lengths by `zoom` as large."""
    if cameras.distortion is None:
        return cameras
    lenses = np.stack(
        [cameras.fx, cameras.fy, cameras.cx, cameras.cy, cameras.width, cameras.height, *cameras.distortion.T], axis=1
    )
    _, first, which = np.unique(lenses, axis=0, return_index=True, return_inverse=True)
    factors = np.array([zoom(cameras[int(i)]) for i in first])[which.reshape(-1)]
    return replace(cameras, fx=cameras.fx * factors, fy=cameras.fy * factors, distortion=None)


def _within(camera: Cameras, factor: float) -> bool:
    """Whether the border of a pinhole of `factor` times the focal length lies within the picture, and unfolded."""
    width, height = int(camera.width[0]), int(camera.height[0])
    u = np.concatenate([np.arange(width), np.arange(width), np.zeros(height), np.full(height, width - 1)]) + 0.5
    v = np.concatenate([np.zeros(width), np.full(width, height - 1), np.arange(height), np.arange(height)]) + 0.5
    row, column = where(camera, factor, u, v)
    if not ((row >= 0) & (row <= height - 1) & (column >= 0) & (column <= width - 1)).all():
        return False
    assert camera.distortion is not None
    k1, k2, _, _, k3 = camera.distortion[0]
    x, y = (u - camera.cx[0]) / (camera.fx[0] * factor), (v - camera.cy[0]) / (camera.fy[0] * factor)
    r2 = np.linspace(0, 1, 65) * (x * x + y * y).max()
    return bool((1 + 3 * k1 * r2 + 5 * k2 * r2**2 + 7 * k3 * r2**3 > 0).all())  # d r' / d r


def where(camera: Cameras, factor: float, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(2, …) float64 row and column, from the first pixel's centre, where the lens puts a pinhole's pixels (u, v).

    The pinhole's focal lengths are `factor` times the camera's.
    """
    assert camera.distortion is not None
    k1, k2, p1, p2, k3 = camera.distortion[0]
    fx, fy, cx, cy = camera.fx[0], camera.fy[0], camera.cx[0], camera.cy[0]
    x, y = (u - cx) / (fx * factor), (v - cy) / (fy * factor)
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([yd * fy + cy - 0.5, xd * fx + cx - 0.5])


def undistorting(camera: Cameras) -> np.ndarray:
    """(2, H, W) float64 row and column in the camera's picture of every pixel of its pinhole."""
    v, u = np.mgrid[: int(camera.height[0]), : int(camera.width[0])] + 0.5
    return where(camera, zoom(camera), u, v)


def sampled(pixels: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32 of a picture at `at` (2, H, W) rows and columns, bilinearly."""
    from scipy.ndimage import map_coordinates

    channels = [map_coordinates(pixels[..., c], at, order=1, mode="nearest") for c in range(3)]
    return np.stack(channels, axis=-1)
