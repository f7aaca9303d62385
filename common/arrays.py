"""Arrays from .npy and .npz files that may be damaged: numpy and zipfile fail at those in two dozen ways."""

import lzma
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

# What they were seen to raise; numpy parses the head of an array as Python.
DAMAGED = (
    *(ValueError, KeyError, TypeError, EOFError, IndexError, OverflowError, AttributeError, NotImplementedError),
    *(SyntaxError, RecursionError, MemoryError, RuntimeError, struct.error, zlib.error, zipfile.BadZipFile),
    *(lzma.LZMAError, tokenize.TokenError),
)


def npz(path: Path) -> "dict[str, np.ndarray]":
    """All arrays of a .npz file, by name. Raises OSError where there is none, ValueError for a damaged one."""
    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as stored:
            found = {name: stored[name] for name in stored.files}
            if not all(isinstance(array, np.ndarray) for array in found.values()):
                raise ValueError("it has something else than arrays")
            return found
    except DAMAGED as error:
        raise ValueError(f"'{path}' is damaged: {error}") from None
