"""Image files of a capture: whether they are there, whether they can be read, and where their names lead."""

import contextlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from ..common import extras  # no source: it says what to install
from ..common.errors import UserError

HEIC = {".heic", ".heif", ".hif"}  # as iPhones and some cameras write them; PIL reads them with pillow-heif


def is_file(path: Path) -> bool:
    """Whether there is such a file; False, too, for a name that no file system takes (too long, lone surrogates)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


@contextlib.contextmanager
def open_image(path: Path) -> Iterator[Any]:
    """The PIL image, not decoded yet. Raises UserError, in the body too, when it is missing, cut short or no image."""
    from PIL import Image

    if path.suffix.lower() in HEIC:
        extras.need("pillow_heif")
        import pillow_heif  # pyright: ignore[reportMissingImports]: an extra

        pillow_heif.register_heif_opener()
    try:
        with Image.open(path) as image:
            yield image
    except FileNotFoundError:
        raise UserError(f"image '{path}' is missing") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(f"image '{path}' cannot be read: {error}") from None


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels, from the file's head. Raises UserError for a missing file and one that is no image."""
    with open_image(path) as image:
        return image.size


def check_whole(path: Path) -> None:
    """Raises UserError for an image that is missing or whose data ends too early."""
    with open_image(path) as image:
        # An eighth of the size is enough to go through all of a JPEG's data, in half the time.
        image.draft(None, (max(1, image.width // 8), max(1, image.height // 8)))
        image.load()


def leaves(name: str) -> bool:
    """Whether the path `name` leads out of the folder that it starts in, by its letters: links inside are fine."""
    pure = PurePosixPath(name)
    return pure.is_absolute() or ".." in pure.parts or "\0" in name


def stored_name(name: str, source: Path, number: int) -> str:
    """The path under which frame `number` is written: its name, with the suffix of its file where the name has none.

    A name that leaves the folder becomes the file's own, after the number, which keeps it unique.
    """
    if leaves(name):
        return f"images/{number:05d}_{source.name}"
    pure = PurePosixPath(name)
    return name if pure.name == source.name else f"{name}{source.suffix}"
