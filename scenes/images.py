"""Reads the pictures of a split at the size that training and scoring use."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..common import limits
from ..common.errors import UserError
from .image_files import open_image
from .lenses import pinholes, sampled, undistorting
from .types import UNCALIBRATED, Cameras, Split


class Picture(NamedTuple):
    """A picture in the smallest numbers that hold it exactly: 3 bytes a pixel as it was, 6 as a mean of blocks."""

    numbers: np.ndarray  # (H, W, 3) uint8, uint16 or float32
    one: int  # the number that stands for 1

    def pixels(self) -> np.ndarray:
        """(H, W, 3) float32 RGB in [0, 1], new."""
        return self.numbers / np.float32(self.one) if self.one > 1 else self.numbers.copy()


def load_images(split: Split, indices: np.ndarray, width: int | None) -> tuple[np.ndarray, Cameras]:
    """(K, H, W, 3) float32 RGB in [0, 1] of the frames at `indices`, all at once, and their cameras.

    See `read_images`.
    """
    read, cameras = read_images(split, indices, width)
    shape = (len(cameras), int(cameras.height[0]), int(cameras.width[0]), 3)
    try:
        images = np.empty(shape, np.float32)
    except MemoryError:
        raise UserError(f"{shape[0]} pictures of {shape[2]} x {shape[1]} need more memory than there is") from None
    for image, picture in zip(images, read, strict=True):
        image[:] = picture.pixels()
    return images, cameras


def read_images(split: Split, indices: np.ndarray, width: int | None) -> tuple[Iterator[Picture], Cameras]:
    """The frames at `indices`, each read when its turn comes, and their pinhole cameras at that size.

    `width` in pixels resizes by area average; None keeps the size. Lens distortion is taken out (`lenses`: nothing is
    seen past the border of the picture), alpha is laid on white. Raises UserError for mixed sizes and a lens that is
    not OpenCV's, and as it reads for a missing or broken file and a size that is not the camera's.
    """
    if split.lens == UNCALIBRATED:
        raise UserError("the cameras' intrinsics are not known; give --intrinsics fx,fy,cx,cy or write a camera.txt")
    if split.lens:
        raise UserError(f"cameras are {split.lens}, not pinholes; undistort the capture (colmap image_undistorter)")
    if width is not None and not 1 <= width <= limits.SIDE:
        raise UserError(f"width {str(width)[:40]} must be in [1, {limits.SIDE}]: it is the pixels that a picture has")
    indices = np.asarray(indices, dtype=np.int64)
    full = split.cameras[indices]
    cameras = full if width is None else full.scaled(width)
    sizes = set(zip(cameras.width.tolist(), cameras.height.tolist(), strict=True))
    if any(not 0 < w * h <= limits.PIXELS for w, h in sizes):
        raise UserError(f"pictures of {max(sizes)[0]} x {max(sizes)[1]} are too large; give a smaller --width")
    if len(sizes) > 1:
        raise UserError(f"frames have different sizes, {sorted(sizes)}; resize the images of the capture to one")
    return _read_all([split.paths[index] for index in indices], full, cameras), pinholes(cameras)


def _read_all(paths: list[Path], full: Cameras, cameras: Cameras) -> Iterator[Picture]:
    lens, where = b"", np.zeros(0)
    for path, before, camera in zip(paths, full, cameras, strict=True):
        size = (int(camera.width[0]), int(camera.height[0]))
        try:
            picture = _shrunk(_read(path, (int(before.width[0]), int(before.height[0]))), size)
        except MemoryError:
            raise UserError(f"image '{path}' needs more memory than there is; resize the images") from None
        if camera.distortion is not None:
            # Most captures have one camera, and finding where its lens looks takes as long as the rest.
            same = b"".join(value.tobytes() for name, value in vars(camera).items() if name != "c2w")
            if same != lens:
                lens, where = same, undistorting(camera)
            picture = Picture(sampled(picture.pixels(), where), 1)
        yield picture


def _read(path: Path, expected: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8."""
    from PIL import Image

    with open_image(path) as image:
        if image.size != expected:
            raise UserError(f"image '{path}' is {image.size[0]} x {image.size[1]}, its camera says {expected}")
        if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
            layered = image.convert("RGBA")
            image_rgb = Image.new("RGB", layered.size, "white")
            image_rgb.paste(layered, mask=layered.getchannel("A"))
        else:
            image_rgb = image if image.mode == "RGB" else image.convert("RGB")  # which copies
        return np.asarray(image_rgb)


def _shrunk(rgb: np.ndarray, size: tuple[int, int]) -> Picture:
    """A picture (H, W, 3) uint8 averaged over the area of each new pixel, not rounded to 8 bits on the way."""
    from PIL import Image

    height, width = rgb.shape[:2]
    if (width, height) == size:
        return Picture(rgb, 255)
    if width % size[0] == 0 and height % size[1] == 0:
        return _sums(rgb, width // size[0], height // size[1])
    pixels = rgb / np.float32(255)
    channels = [Image.fromarray(pixels[..., c]).resize(size, Image.Resampling.BOX) for c in range(3)]
    return Picture(np.stack([np.asarray(channel) for channel in channels], axis=-1), 1)


def _sums(rgb: np.ndarray, across: int, down: int) -> Picture:
    """Means of blocks of pixels, as their sums: whole numbers, in whatever order they are added."""
    one = 255 * across * down
    kind = np.uint16 if one < 1 << 16 else np.uint32
    rows = rgb[::down].astype(kind)
    for k in range(1, down):
        rows += rgb[k::down]
    sums = np.empty((rows.shape[0], rows.shape[1] // across, 3), kind)
    for channel in range(3):  # one by one: numpy is slow where the innermost axis is of length 3
        plane = rows[..., channel]
        sums[..., channel] = plane[:, ::across]
        for k in range(1, across):
            sums[..., channel] += plane[:, k::across]
    return Picture(sums, one) if kind is np.uint16 else Picture((sums / one).astype(np.float32), 1)
