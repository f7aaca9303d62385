"""Image features of a split, computed once for each picture and kept by the picture's content.

An encoder is a module of `scenes/encoders`: `available()` says why it cannot be used or None, `version(argument)` says
what its features depend on besides the pictures, `encoder(argument, device)` loads it.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..common import bounded, limits, plugins
from ..common.errors import UserError
from ..common.files import sha256_file, whole
from ..common.sources import code_sha256
from . import shipped_features
from .image_files import open_image
from .orientation import upright
from .types import Split

ENCODERS = "scenes.encoders"
MARK = b"viewbench sha256"  # behind an array that `save` wrote, before its hash
DECODING = "upright, squeezed to a square, bicubic"  # part of what the cache is named by

Progress = Callable[[int, int | None, str], None]


def silent(done: int, total: int | None, text: str) -> None:
    """Shows no progress."""


def features(
    split: Split,
    encoder: str,
    cache: Path,
    batch: int = 16,
    progress: Progress = silent,
    device: str = "cpu",
    root: Path | None = None,
) -> np.ndarray:
    """(N, D) float32 rows of length 1, one per frame in capture order.

    `encoder` is NAME or NAME:ARGUMENT. Every picture's row is a file in `cache`, named by the hash of the picture's
    bytes, in a folder named by the encoder's version: a run that was killed goes on where it was, captures share
    pictures, and a picture that changed is embedded again. `device` is torch's, or "auto" for a GPU where there is
    one; an encoder that has no use for it ignores it. Rows that the capture in the folder `root` brings along
    (`shipped_features`) are taken before any others.

    Raises UserError for an unknown or unavailable encoder and for a picture that cannot be read.
    """
    name, _, argument = encoder.partition(":")
    module = _loaded(encoder)
    code = code_sha256(module.__name__.removeprefix("viewbench."))[:16] if hasattr(module, "__name__") else ""
    made_by = f"{name}: {module.version(argument)}; numpy {np.__version__}; {code}; {DECODING}"
    folder = Path(cache) / f"{name}-{hashlib.sha256(made_by.encode()).hexdigest()[:16]}"
    pictures = [content_hash(path) for path in split.paths]
    brought = {} if root is None or argument else shipped_features.read(root, name, lambda: of_encoder(encoder))
    files = [folder / f"{sha256}.npy" for sha256 in pictures]
    rows = [brought[sha256] if sha256 in brought else cached(folder / f"{sha256}.npy") for sha256 in pictures]
    same: dict[str, list[int]] = {}  # frames of one picture, which is embedded once
    for i, row in enumerate(rows):
        if row is None:
            same.setdefault(pictures[i], []).append(i)
    if same:
        size, encode = module.encoder(argument, device)
        missing = list(same.values())
        done = len(split) - sum(map(len, missing))
        for start in range(0, len(missing), batch):
            part = missing[start : start + batch]
            seen = np.stack([picture(split.paths[frames[0]], size) for frames in part])
            for frames, row in zip(part, encode(seen), strict=True):
                unit = (row / np.linalg.norm(row)).astype(np.float32)
                save(files[frames[0]], unit)
                for i in frames:
                    rows[i] = unit
            done += sum(map(len, part))
            progress(done, len(split), "")
    return np.stack([row for row in rows if row is not None])


def _loaded(encoder: str) -> Any:
    name = encoder.partition(":")[0]
    module = plugins.load(ENCODERS, name)
    if name == "none":
        raise UserError("encoder 'none' has no features; leave the semantic factor out or name another encoder")
    reason = module.available()
    if reason:
        raise UserError(f"encoder '{encoder}' is not available: {reason}")
    return module


def of_encoder(encoder: str) -> dict[str, str]:
    """What rows depend on besides the pictures, as a capture that brings rows along says it."""
    argument, module = encoder.partition(":")[2], _loaded(encoder)
    weights = module.weights_sha256() if hasattr(module, "weights_sha256") else ""
    return {"version": module.version(argument), "weights_sha256": weights, "decoding": DECODING}


def save(path: Path, array: np.ndarray) -> None:
    """Writes an array as float32 .npy, whole or not at all; behind it, where no reader looks, the hash of it."""
    with whole(path) as temporary:
        np.save(temporary, array.astype(np.float32))
        digest = hashlib.sha256(temporary.read_bytes()).digest()
        with open(temporary, "ab") as file:
            file.write(MARK + digest)


class AlteredError(ValueError):
    """A file that `save` wrote is not what it wrote."""


def array(path: Path) -> Any:
    """The array of a .npy file; files of others have no hash, and are taken as they are.

    Raises OSError and ValueError as `bounded.array`, AlteredError where the hash is not that of the rest.
    """
    size, end = bounded.checked(path, limits.FEATURE_BYTES), len(MARK) + hashlib.sha256().digest_size
    with open(path, "rb") as file:
        file.seek(max(0, size - end))
        tail = file.read()
        if size > end and tail.startswith(MARK):
            file.seek(0)
            if hashlib.sha256(file.read(size - end)).digest() != tail[len(MARK) :]:
                raise AlteredError(f"'{path}' was altered since it was written")
    return bounded.array(path)


def load_user_features(path: Path, n: int) -> np.ndarray:
    """(N, D) float32 features from a .npy file.

    Raises UserError for a file that is none, has another number of rows than `n`, or NaN in some row.
    """
    try:
        given = array(path)
    except AlteredError:
        raise UserError(
            f"features '{path}' were altered since they were written; delete that file and embed again"
        ) from None
    except OSError as error:
        raise UserError(f"features '{path}' cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise UserError(f"features '{path}' cannot be read: there is not enough memory for them") from None
    except (ValueError, EOFError):
        raise UserError(f"features '{path}' are not a .npy file of numbers; write them with numpy.save") from None
    if getattr(given, "ndim", 0) != 2 or given.dtype.kind not in "fiu" or len(given) != n:
        found = f"{given.dtype} of shape {given.shape}" if isinstance(given, np.ndarray) else "several arrays"
        raise UserError(f"features '{path}' are {found}, expected numbers with one row for each of {n} training views")
    with np.errstate(over="ignore", invalid="ignore"):
        rows = given.astype(np.float32)
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise UserError(f"features '{path}' have NaN or infinity in row {bad[0]} (as float32); embed that image again")
    return rows


def content_hash(path: Path) -> str:
    """Hex SHA-256 of an image file. Raises UserError when it cannot be read."""
    try:
        bounded.checked(path, limits.IMAGE_BYTES)
        return sha256_file(path)
    except OSError as error:
        raise UserError(f"image '{path}' cannot be read: {error.strerror}") from None


def picture(path: Path, size: int) -> np.ndarray:
    """(size, size, 3) float32 in [0, 1]: the whole picture, squeezed to a square as SigLIP's preprocessing does.

    It is upright where the photo says how it was held; alpha is laid on white, as for training. Raises UserError for a
    missing or broken file.
    """
    from PIL import Image

    with open_image(path) as image:
        image.draft("RGB", (2 * size, 2 * size))  # JPEG decodes at a fraction of its size where that is enough
        image = upright(image)
        if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
            white = Image.new("RGBA", image.size, "white")
            flat = Image.alpha_composite(white, image.convert("RGBA")).convert("RGB")
        else:
            flat = image.convert("RGB")
        small = flat.resize((size, size), Image.Resampling.BICUBIC, reducing_gap=3.0)
        return np.asarray(small, dtype=np.float32) / 255


def cached(file: Path) -> np.ndarray | None:
    """The row in the cache, or None where there is none or it is damaged."""
    try:
        row = array(file)
    except (OSError, ValueError):
        return None
    whole_row = isinstance(row, np.ndarray) and row.ndim == 1 and row.dtype == np.float32 and np.isfinite(row).all()
    return row if whole_row else None
