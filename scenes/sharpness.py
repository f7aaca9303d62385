"""How sharp the frames of a split are: the variance of the Laplacian at a fixed size (Pech-Pacheco et al. 2000)."""

from pathlib import Path

import numpy as np

from .features import Progress, cached, content_hash, save, silent
from .image_files import open_image
from .types import Split

SIZE = 512  # pixels of the longer side: blur is judged as a share of the picture, whatever its resolution


def sharpness(split: Split, cache: Path, progress: Progress = silent) -> np.ndarray:
    """(N,) float64, larger is sharper, one per frame in capture order; kept in `cache` by the picture's content.

    Numbers compare frames that show the same things: texture counts as much as focus.
    Raises UserError for a picture that cannot be read.
    """
    folder = Path(cache) / f"sharpness-{SIZE}"
    values = np.empty(len(split))
    for i, path in enumerate(split.paths):
        file = folder / f"{content_hash(path)}.npy"
        known = cached(file)
        if known is None:
            known = np.array([laplacian_variance(_grey(path))])
            save(file, known)
        values[i] = known[0]
        progress(i + 1, len(split), "")
    return values


def laplacian_variance(grey: np.ndarray) -> float:
    """Var(∇²I) of a picture (H, W), with the five-point Laplacian on its inner pixels."""
    inner = grey[1:-1, 1:-1]
    return float((grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:] - 4 * inner).var())


def _grey(path: Path) -> np.ndarray:
    """(H, W) float32 luminance in [0, 1], the longer side SIZE pixels."""
    from PIL import Image

    with open_image(path) as image:  # turned or not is the same: ∇² has no direction
        image.draft("L", (2 * SIZE, 2 * SIZE))
        scale = SIZE / max(image.size)
        size = (max(3, round(image.width * scale)), max(3, round(image.height * scale)))
        small = image.convert("L").resize(size, Image.Resampling.BOX)
        return np.asarray(small, dtype=np.float32) / 255
