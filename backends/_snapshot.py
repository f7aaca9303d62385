"""The file that a killed training goes on from: arrays, and beside them what JSON can say."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..common import arrays
from ..common.files import whole

FILE = "snapshot.npz"

T = TypeVar("T")


def write(folder: Path, stored: dict[str, Any], plain: dict[str, Any]) -> None:
    """Writes the snapshot, whole or not at all."""
    with whole(folder / FILE) as temporary, open(temporary, "wb") as file:
        np.savez(file, plain=json.dumps(plain), **stored)


def read(folder: Path, make: Callable[[dict[str, np.ndarray], dict[str, Any]], T]) -> T | None:
    """What `make` makes of arrays and rest; None where there is no snapshot that can be read, or it lacks something."""
    try:
        stored = arrays.npz(folder / FILE)
        return make(stored, json.loads(str(stored.pop("plain"))))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError, OverflowError):
        return None


def forget(folder: Path) -> None:
    """Removes the snapshot of a run that is finished."""
    (folder / FILE).unlink(missing_ok=True)
