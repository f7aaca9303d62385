"""Image files of a capture: whether they are there, whether they can be read, and where their names lead."""

import contextlib
import functools
import os
import struct
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from ..common import bounded, limits
from ..common.errors import UserError
from ._quiet import hush_pillow, silenced

# Of PNG, JPEG, TIFF, BMP, GIF, WebP, JPEG 2000, PNM and PFM, .npy, OpenEXR and Radiance; HEIC and AVIF have "ftyp".
BEGINNINGS = (
    *(b"\x89PNG", b"\xff\xd8\xff", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"BM", b"GIF8", b"RIFF", b"\0\0\0\x0cjP"),
    *(b"\xff\x4f\xff\x51", *(b"P%d" % kind for kind in range(1, 8)), b"PF", b"Pf", b"\x93NUMPY", b"v/1\x01", b"#?"),
)
HEIC = {".heic", ".heif", ".hif"}  # as iPhones and some cameras write them; PIL reads them with pillow-heif
# Those that are opened, whatever the file is called. PIL knows forty more; for one of them, EPS, it runs Ghostscript.
FORMATS = ("JPEG", "PNG", "BMP", "GIF", "PPM", "TIFF", "WEBP", "JPEG2000")


def is_file(path: Path) -> bool:
    """Whether there is such a file; False, too, for a name that no file system takes (too long, lone surrogates)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


@functools.cache
def _bounded_pillow() -> None:
    """Has PIL refuse more than limits.PIXELS: it does at twice its limit, and only warns at the limit itself."""
    import warnings

    from PIL import Image

    Image.MAX_IMAGE_PIXELS = limits.PIXELS // 2
    warnings.filterwarnings("ignore", category=Image.DecompressionBombWarning)


@contextlib.contextmanager
def open_image(path: Path, head: bool = False) -> Iterator[Any]:
    """The PIL image, not decoded yet; `head` says that it will not be.

    Raises UserError, in the body too, when it is missing, cut short, no image, or beyond `limits`.
    """
    from PIL import Image

    _bounded_pillow()
    hush_pillow()
    formats = FORMATS

    if path.suffix.lower() in HEIC:
        from ..common import extras  # no source: it says what to install

        extras.need("pillow_heif")
        import pillow_heif  # pyright: ignore[reportMissingImports]: an extra

        pillow_heif.register_heif_opener()
        formats = (*FORMATS, "HEIF")
    elif path.suffix.lower() == ".avif":
        formats = (*FORMATS, "AVIF")
    try:
        bounded.checked(path, limits.IMAGE_BYTES)
        with Image.open(path, formats=formats) as image:
            if max(image.size) > limits.SIDE:
                raise OSError(f"it is {image.size[0]} x {image.size[1]}; sides of up to {limits.SIDE:,} are read")
            if not head and image.format in ("JPEG", "MPO") and "progressive" in image.info:
                _check_scans(path)
            with silenced(image.format == "TIFF"):
                yield image
    except FileNotFoundError:
        raise UserError(f"image '{path}' is missing") from None
    except Image.DecompressionBombError:
        most = f"{limits.PIXELS // 1_000_000} million"
        raise UserError(f"image '{path}' cannot be read: it has more than {most} pixels; resize it") from None
    except Image.UnidentifiedImageError:
        raise UserError(f"image '{path}' cannot be read: it is none of {', '.join(formats)}") from None
    except MemoryError:
        raise UserError(f"image '{path}' cannot be read: there is not enough memory for it") from None
    except (OSError, SyntaxError, ValueError, KeyError, EOFError, struct.error) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UserError(f"image '{path}' cannot be read: {reason}") from None
    except Exception as error:
        if not _of_pillow(error):
            raise
        raise UserError(f"image '{path}' cannot be read: it is damaged ({error})") from None


def _of_pillow(error: Exception) -> bool:
    """Whether it was raised in PIL's own code, which a damaged file makes stumble in any way."""
    at = error.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    return at is not None and f"{os.sep}PIL{os.sep}" in at.tb_frame.f_code.co_filename


def _check_scans(path: Path) -> None:
    """Raises OSError for a JPEG that is drawn over more often than limits.SCANS."""
    content = bounded.data(path, "image", limits.IMAGE_BYTES)
    scans = content.count(b"\xff\xda")  # in a picture's data 0xFF is followed by zero
    if scans > limits.SCANS:
        raise OSError(f"it is drawn in {scans:,} scans, at most {limits.SCANS} are read")


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels, from the file's head. Raises UserError for a missing file and one that is no image."""
    with open_image(path, head=True) as image:
        return image.size


def check_whole(path: Path) -> None:
    """Raises UserError for an image that is missing or whose data ends too early."""
    with open_image(path) as image:
        # An eighth of the size is enough to go through all of a JPEG's data, in half the time.
        image.draft(None, (max(1, image.width // 8), max(1, image.height // 8)))
        image.load()


def check_picture(path: Path) -> None:
    """Raises UserError for a file that does not begin as a picture, a mask or a depth image does.

    What goes into a subset may be a link of the capture to anything: to a key, say, that would be copied.
    """
    try:
        bounded.checked(path)
        with open(path, "rb") as file:
            head = file.read(16)
    except OSError as error:
        raise UserError(f"image '{path}' cannot be read: {error.strerror}") from None
    if not head.startswith(BEGINNINGS) and head[4:8] != b"ftyp":
        raise UserError(f"'{path}' is no picture and no depth image; take it out of the capture")


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
