"""Image features of a split, computed once for each picture and kept by the picture's content."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.files import sha256_file, whole
from viewbench.scenes.types import Split

ENCODERS = "scenes.encoders"


def features(
    split: Split,
    encoder: str,
    cache: Path,
    batch: int = 16,
    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None,
) -> np.ndarray:
    """(N, D) float32 rows of length 1, one per frame in capture order.

    `encoder` is NAME or NAME:ARGUMENT. Every picture's row is a file in `cache`, named by the hash of the picture's
    bytes and of the encoder, so that a run that was killed goes on and two captures share pictures.
    Raises UserError for an unknown or unavailable encoder and for a picture that cannot be read.
    """
    name, _, argument = encoder.partition(":")
    module = plugins.load(ENCODERS, name)
    if name == "none":
        raise UserError("encoder 'none' has no features; leave the semantic factor out or name another encoder")
    reason = module.available()
    if reason:
        raise UserError(f"encoder '{encoder}' is not available: {reason}")
    folder = cache / hashlib.sha256(encoder.encode()).hexdigest()[:16]
    files = [folder / f"{_hash(path)}.npy" for path in split.paths]
    missing = [i for i, file in enumerate(files) if not file.is_file()]
    if missing:
        size, _, encode = module.encoder(argument)
        for start in range(0, len(missing), batch):
            part = missing[start : start + batch]
            rows = encode(np.stack([_picture(split.paths[i], size) for i in part]))
            for i, row in zip(part, rows, strict=True):
                save(files[i], row / np.linalg.norm(row))
            progress(len(split) - len(missing) + start + len(part), len(split), "")
    return np.stack([np.load(file, allow_pickle=False) for file in files]).astype(np.float32)


def save(path: Path, array: np.ndarray) -> None:
    """Writes an array as .npy, whole or not at all."""
    with whole(path) as temporary:
        np.save(temporary, array.astype(np.float32))


def load_user_features(path: Path, n: int) -> np.ndarray:
    """(N, D) features from a .npy file. Raises UserError for a file that is none, or has another number of rows."""
    try:
        array: Any = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise UserError(f"features '{path}' cannot be read as .npy: {error}") from None
    if getattr(array, "ndim", 0) != 2 or not np.issubdtype(array.dtype, np.number) or len(array) != n:
        shape = getattr(array, "shape", "no array")
        raise UserError(f"features '{path}' are {shape}, expected numbers with one row for each of {n} training views")
    return array.astype(np.float32)


def _hash(path: Path) -> str:
    try:
        return sha256_file(path)
    except OSError as error:
        raise UserError(f"image '{path}' cannot be read: {error.strerror}") from None


def _picture(path: Path, size: int) -> np.ndarray:
    """(size, size, 3) float32 in [0, 1]: the whole picture, squeezed to a square as SigLIP's preprocessing does."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            image.draft("RGB", (2 * size, 2 * size))  # JPEG decodes at a fraction of its size where that is enough
            small = image.convert("RGB").resize((size, size), Image.Resampling.BICUBIC, reducing_gap=3.0)
            return np.asarray(small, dtype=np.float32) / 255
    except (OSError, SyntaxError) as error:
        raise UserError(f"image '{path}' cannot be read: {error}") from None
