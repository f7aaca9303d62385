"""Reads the tensors of a file that torch.save wrote before its version 1.6, without torch.

Such a file is five pickles (a magic number, a protocol version, facts of the machine that wrote it, the tensors, the
keys of their storages) and then, storage by storage, the number of elements (int64) and the elements, little-endian.
A pickle may call anything that it names. The reader here knows the four names that a table of tensors is made of, each
as a function of this module, and refuses any other before it is called.
"""

import collections
import pickle
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...common.errors import UserError

MAGIC = 0x1950A86A20F9469CFC6C
PROTOCOL = 1001
KINDS = {"FloatStorage": np.dtype("<f4"), "LongStorage": np.dtype("<i8")}


def tensors(path: Path) -> dict[str, np.ndarray]:
    """The arrays of the file by name, each with a memory of its own.

    Raises UserError for a file that is missing, is none of this kind, was cut short, or names anything but tensors.
    """
    try:
        with open(path, "rb") as file:
            return _read(file)
    except OSError as error:
        raise UserError(f"weights '{path}' cannot be read: {error.strerror or error}") from None
    except Exception as error:  # a pickle that is none fails in any way that there is
        raise UserError(f"weights '{path}' are not the table of tensors that was expected ({error})") from None


def _read(file: BinaryIO) -> dict[str, np.ndarray]:
    storages: dict[str, np.ndarray] = {}
    head = [Tensors(file, storages).load() for _ in range(3)]
    if head[:2] != [MAGIC, PROTOCOL] or not head[2]["little_endian"]:
        raise ValueError("another format")
    table = Tensors(file, storages).load()
    for key in Tensors(file, storages).load():
        storage = storages[key]
        (count,) = np.frombuffer(file.read(8), dtype="<i8")
        elements = file.read(storage.nbytes)
        if count != len(storage) or len(elements) != storage.nbytes:
            raise ValueError("cut short")
        storage[:] = np.frombuffer(elements, dtype=storage.dtype)
    return {name: np.array(array, order="C") for name, array in table.items()}


class Tensors(pickle.Unpickler):
    """An unpickler that makes arrays, whose elements are read later, and nothing else."""

    def __init__(self, file: BinaryIO, storages: dict[str, np.ndarray]):
        super().__init__(file)
        self.storages = storages

    def find_class(self, module: str, name: str) -> Any:
        """What a name in the file stands for. Raises ValueError for one that has no business there."""
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _tensor
        if module == "torch" and name in KINDS:
            return KINDS[name]
        raise ValueError(f"it names {module}.{name}")

    def persistent_load(self, pid: Any) -> np.ndarray:
        """The storage that ("storage", kind, key, device, number of elements, view) stands for, still empty."""
        _, kind, key, _, count, view = pid
        if view is not None:
            raise ValueError("a storage is part of another")
        return self.storages.setdefault(key, np.empty(count, dtype=kind))


def _tensor(storage: np.ndarray, offset: int, shape: tuple, strides: tuple, *unused: Any) -> np.ndarray:
    """The part of a storage that a tensor is; offset and strides count elements."""
    last = offset + sum((size - 1) * stride for size, stride in zip(shape, strides, strict=True))
    if min(offset, *shape, *strides, 0) < 0 or last >= len(storage):
        raise ValueError("a tensor is larger than its storage")
    steps = tuple(stride * storage.itemsize for stride in strides)
    return np.lib.stride_tricks.as_strided(storage[offset:], shape, steps)
