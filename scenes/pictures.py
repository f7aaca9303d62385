"""Pictures that viewbench writes: 8-bit PNG files of test views, true and rendered."""

from pathlib import Path

import numpy as np

from ..common.errors import UserError
from ..common.files import whole


def to_uint8(image: np.ndarray, shape: tuple[int, ...], name: str) -> np.ndarray:
    """(H, W, 3) uint8 of an image in [0, 1], rounded. Raises UserError for another shape or NaN."""
    if image.shape != shape:
        raise UserError(f"test view '{name}' was rendered as {image.shape}, expected {shape}")
    if not np.isfinite(image).all():
        raise UserError(f"the render of test view '{name}' has NaN or infinite pixels")
    return np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)


def save_png(pixels: np.ndarray, path: Path) -> None:
    """Writes (H, W, 3) uint8 as PNG, whole or not at all."""
    from PIL import Image

    with whole(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG", compress_level=4)


def picture_name(number: int, name: str) -> str:
    """File name of the picture of test view `number`: the frame's name without what a file system might mind."""
    stem = name.rsplit(".", 1)[0] if "." in name.rsplit("/", 1)[-1] else name
    readable = "".join(c if c.isalnum() or c in "-_" else "_" for c in stem)
    return f"{number:04d}_{readable[-100:]}.png"
