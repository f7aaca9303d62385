"""Features that a capture brings along, so that everyone chooses by the same numbers and nobody has to embed it."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError
from ..common.files import read_json, whole, write_json

FOLDER = "features"  # of a capture; NAME.npy has the rows, NAME.json says of which pictures and by what


def files(root: Path) -> tuple[Path, ...]:
    """What a capture's features are read from, in order; a folder of that name with anything else in it has none."""
    records = sorted((root / FOLDER).glob("*.json"))
    return tuple(file for record in records if _is_record(record) for file in (record, record.with_suffix(".npy")))


def write(root: Path, encoder: str, made_by: dict[str, Any], pictures: Sequence[str], rows: np.ndarray) -> Path:
    """Writes (N, D) rows of the N pictures, named by their SHA-256, as float16. Returns the .npy file."""
    folder = root / FOLDER
    folder.mkdir(exist_ok=True)
    file = folder / f"{encoder}.npy"
    with whole(file) as temporary, open(temporary, "wb") as opened:
        np.save(opened, rows.astype(np.float16))
    write_json(file.with_suffix(".json"), {"schema": 1, "encoder": encoder, **made_by, "pictures": list(pictures)})
    return file


def read(root: Path, encoder: str, made_by: dict[str, Any]) -> dict[str, np.ndarray]:
    """The (D,) float32 row of length 1 of each picture, by its SHA-256; empty where the capture brings none of these.

    Rows made by another version of the encoder, or by other weights, are none of these. Raises UserError for files
    that do not fit together.
    """
    file = root / FOLDER / f"{encoder}.npy"
    if not _is_record(file.with_suffix(".json")):
        return {}
    record = read_json(file.with_suffix(".json"), "features")
    if any(record.get(key) != value for key, value in made_by.items()):
        return {}
    try:
        rows = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise UserError(f"features '{file}' cannot be read: {error}; delete the folder, or bring it anew") from None
    pictures = record["pictures"]
    if rows.dtype != np.float16 or rows.ndim != 2 or len(rows) != len(pictures) or not np.isfinite(rows).all():
        raise UserError(f"features '{file}' are not {len(pictures)} rows of float16, one for each picture named beside")
    rows = rows.astype(np.float32)
    return dict(zip(pictures, rows / np.linalg.norm(rows, axis=1, keepdims=True), strict=True))


def _is_record(file: Path) -> bool:
    """Whether it is ours: a capture may have a folder of this name for its own ends."""
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(record, dict) and isinstance(record.get("pictures"), list) and "encoder" in record
