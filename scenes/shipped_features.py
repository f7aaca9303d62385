"""Features that a capture brings along, so that everyone chooses by the same numbers and nobody has to embed it."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..common import bounded
from ..common.errors import UserError
from ..common.files import sha256_file, whole, write_json, write_text

# Of a capture: NAME.npy has the rows, NAME.json says of which pictures and by what, NAME.sha256 ties them together, as
# `sha256sum -c` reads it.
FOLDER = "features"


def files(root: Path) -> tuple[Path, ...]:
    """What a capture's features are read from, in order; a folder of that name with anything else in it has none."""
    records = sorted((root / FOLDER).glob("*.json"))
    return tuple(file for record in records if _record(record) for file in (record, record.with_suffix(".npy")))


def write(root: Path, encoder: str, made_by: dict[str, Any], pictures: Sequence[str], rows: np.ndarray) -> Path:
    """Writes (N, D) rows of the N pictures, named by their SHA-256, as float16. Returns the .npy file."""
    folder = root / FOLDER
    check_place(root)
    folder.mkdir(exist_ok=True)
    file = folder / f"{encoder}.npy"
    with whole(file) as temporary, open(temporary, "wb") as opened:
        np.save(opened, rows.astype(np.float16))
    write_json(file.with_suffix(".json"), {"schema": 1, "encoder": encoder, **made_by, "pictures": list(pictures)})
    write_text(file.with_suffix(".sha256"), _sums(file))  # last: what a stopped run leaves is not taken
    return file


def check_place(root: Path) -> None:
    """Raises UserError where what is written into the capture would land elsewhere."""
    if (root / FOLDER).is_symlink():
        raise UserError(f"'{root / FOLDER}' is a link, and may lead anywhere; remove it")


def read(root: Path, encoder: str, made_by: Callable[[], dict[str, Any]]) -> dict[str, np.ndarray]:
    """The (D,) float32 row of length 1 of each picture, by its SHA-256; empty where the capture brings none of these.

    Rows made by another version of the encoder, or by other weights, are none of these: `made_by` is asked for what
    this one depends on, its weights' hash among it, where there are rows at all. Raises UserError for files that do
    not fit together.
    """
    file = root / FOLDER / f"{encoder}.npy"
    record = _record(file.with_suffix(".json"))
    if record is None or any(record.get(key) != value for key, value in made_by().items()):
        return {}
    mend = "delete that folder, or bring it anew"
    try:
        said = bounded.data(file.with_suffix(".sha256"), "sums", 1 << 16)
        if said.decode("utf-8") != _sums(file):
            raise UserError(f"features '{file}' or the .json beside it are not what the .sha256 says; {mend}")
        rows: Any = bounded.array(file)
    except (OSError, ValueError, EOFError, MemoryError) as error:
        raise UserError(f"features '{file}' cannot be read: {error}; {mend}") from None
    pictures = record["pictures"]
    fit = getattr(rows, "ndim", 0) == 2 and rows.dtype == np.float16 and len(rows) == len(pictures)
    with np.errstate(invalid="ignore"):
        lengths = np.linalg.norm(rows.astype(np.float32), axis=1) if fit else np.zeros(0)
    if not fit or not (np.isfinite(lengths) & (lengths > 0)).all():
        raise UserError(f"features '{file}' are not {len(pictures)} rows of float16 that are not zero; {mend}")
    return dict(zip(pictures, rows.astype(np.float32) / lengths[:, None], strict=True))


def _sums(file: Path) -> str:
    return "".join(f"{sha256_file(path)}  {path.name}\n" for path in (file.with_suffix(".json"), file))


def _record(file: Path) -> dict[str, Any] | None:
    """What the file says if it is ours: a capture may have a folder of this name for its own ends."""
    try:
        record = json.loads(bounded.json_text(file, "features"))
    except (UserError, ValueError, RecursionError):
        return None
    pictures = record.get("pictures") if isinstance(record, dict) else None
    ours = isinstance(pictures, list) and all(isinstance(one, str) for one in pictures) and "encoder" in record
    return record if ours else None
