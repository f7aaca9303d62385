"""Reads files of a capture that nobody vouches for: regular ones alone, no more than a bound, nothing that waits."""

import errno
import math
import os
import stat
from pathlib import Path
from typing import Any

from . import arrays, limits
from .errors import UserError

LINKED_LEVELS = 4  # of folders above a file: captures are that deep


def checked(path: str | os.PathLike, most: int | None = None) -> int:
    """Bytes of a regular file. A named pipe would wait for its writer, a device give zeros without end.

    Raises OSError for anything that is no regular file, and for one of more than `most` bytes (EFBIG).
    """
    found = os.stat(path)  # noqa: PTH116
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe, a socket or a device and no file", str(path))
    if most is not None and found.st_size > most:
        raise OSError(errno.EFBIG, f"it has {in_words(found.st_size)}, at most {in_words(most)} are read", str(path))
    return found.st_size


def data(path: str | os.PathLike, what: str, most: int) -> bytes:
    """The bytes of a file. Raises UserError, which calls it `what`, for one that is missing, too large or no file."""
    try:
        size = checked(path, most)
        with open(path, "rb") as file:
            content = file.read(size + 1)
            while len(content) <= most and (piece := file.read(1 << 16)):  # files of /proc say that they have 0 bytes
                content += piece
    except (OSError, ValueError) as error:  # ValueError: a name that no file system takes
        reason = getattr(error, "strerror", None) or error
        raise UserError(f"{what} '{path}' cannot be read: {reason}") from None
    if len(content) > most:
        raise UserError(f"{what} '{path}' cannot be read: it has more than {in_words(most)}")
    return content


def json_text(path: str | os.PathLike, what: str) -> str:
    """The text of a JSON file, of no more lists and values than `limits` allow: what Python makes of them is larger.

    Raises UserError.
    """
    content = data(path, what, limits.JSON_BYTES)
    if content.count(b"{") + content.count(b"[") > limits.JSON_CONTAINERS or content.count(b",") > limits.JSON_VALUES:
        raise UserError(
            f"{what} '{path}' has more than {limits.JSON_CONTAINERS:,} lists and objects or {limits.JSON_VALUES:,} "
            "values; split the capture"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UserError(f"{what} '{path}' is not UTF-8 text; it should be a JSON file") from None


def array(path: str | os.PathLike) -> Any:
    """The array of a .npy file, whose head may claim no more numbers than are in it.

    Raises OSError for a file that is missing or too large, ValueError for one that holds anything else.
    """
    import numpy as np

    size = checked(path, limits.FEATURE_BYTES)
    try:
        _check_head(path, size)
        return np.load(path, allow_pickle=False)
    except arrays.DAMAGED as error:
        raise ValueError(f"it is damaged: {error}") from None


def _check_head(path: str | os.PathLike, size: int) -> None:
    """Raises ValueError, and more as the head is damaged, where it claims more numbers than the file has."""
    import numpy as np

    with open(path, "rb") as file:
        heads = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        version = np.lib.format.read_magic(file)
        if version not in heads:
            raise ValueError(f"it is of version {version} of .npy")
        shape, _, kind = heads[version](file)
        if kind.hasobject or file.tell() + math.prod(shape) * kind.itemsize > size:
            raise ValueError("its head claims more than numbers that are in it")


def linked(path: Path) -> bool:
    """Whether a file is reached through a link, its own or of a folder near above it: it may be anybody's."""
    return any(place.is_symlink() for place in (path, *list(path.parents)[:LINKED_LEVELS]))


def quoted(path: Path, text: str, most: int = 60) -> str:
    """What a message may show of a file's content: `'…'`, and nothing of one that is reached through a link."""
    return "what a link leads to" if linked(path) else f"'{text[:most]}'"


def in_words(count: int) -> str:
    """`134 MB` of a number of bytes."""
    unit, size = next((pair for pair in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)) if count >= pair[1]), ("bytes", 1))
    return f"{count / size:.3g} {unit}" if size > 1 else f"{count} {unit}"
