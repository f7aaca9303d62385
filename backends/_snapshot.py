"""The file that a killed training goes on from: arrays, and beside them what JSON can say."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..common.files import whole

FILE = "snapshot.npz"

T = TypeVar("T")


def write(folder: Path, arrays: dict[str, Any], plain: dict[str, Any]) -> None:
    """Writes the snapshot, whole or not at all."""
    with whole(folder / FILE) as temporary, open(temporary, "wb") as file:
        np.savez(file, plain=json.dumps(plain), **arrays)


def read(folder: Path, make: Callable[[dict[str, np.ndarray], dict[str, Any]], T]) -> T | None:
    """What `make` makes of arrays and rest; None where there is no snapshot that can be read, or it lacks something."""
    try:
        with np.load(folder / FILE, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return make(arrays, json.loads(str(arrays.pop("plain"))))
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
        return None


def forget(folder: Path) -> None:
    """Removes the snapshot of a run that is finished."""
    (folder / FILE).unlink(missing_ok=True)
