"""Image files of a capture: whether they are there, whether they can be read, and where their names lead."""

import contextlib
import functools
import os
import re
import struct
import zipfile
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
COLMAP_DEPTH = re.compile(rb"\d+&\d+&\d+&")  # width, height and channels of its dense depth maps
HEIF_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")  # ISO/IEC 23008-12
AVIF_BRANDS = (b"avif", b"avis")
HEIC = {".heic", ".heif", ".hif"}  # as iPhones and some cameras write them; PIL reads them with pillow-heif
# Of JPEG: what is no byte of the picture's data, in which 0xFF is followed by zero or the number of a restart.
MARKER, START_OF_SCAN, END_OF_IMAGE = re.compile(rb"\xff[^\x00\x01\xd0-\xd7\xff]"), 0xDA, 0xD9
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
    try:
        bounded.checked(path, limits.IMAGE_BYTES)
        formats = _formats(path)
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


def _formats(path: Path) -> tuple[str, ...]:
    """The formats that the file may be in: those that need a library or have no mark of their own only where it says
    so, by its first bytes or its name. Raises UserError where the library is not installed."""
    with open(path, "rb") as file:
        head = file.read(12)
    brand = head[8:12] if head[4:8] == b"ftyp" else b""
    if brand in HEIF_BRANDS or path.suffix.lower() in HEIC:
        from ..common import extras  # no source: it says what to install

        extras.need("pillow_heif")
        import pillow_heif  # pyright: ignore[reportMissingImports]: an extra

        pillow_heif.register_heif_opener()
        return (*FORMATS, "HEIF")
    if brand in AVIF_BRANDS or path.suffix.lower() == ".avif":
        return (*FORMATS, "AVIF")
    return (*FORMATS, "TGA") if path.suffix.lower() == ".tga" else FORMATS


def _of_pillow(error: Exception) -> bool:
    """Whether it was raised in PIL's own code, which a damaged file makes stumble in any way."""
    at = error.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    return at is not None and f"{os.sep}PIL{os.sep}" in at.tb_frame.f_code.co_filename


def _check_scans(path: Path) -> None:
    """Raises OSError for a JPEG that is drawn over more often than limits.SCANS."""
    content = bounded.data(path, "image", limits.IMAGE_BYTES)
    scans, at = 0, 2
    while found := MARKER.search(content, at):  # up to the end of the picture: a phone may append a video
        marker, at = content[found.end() - 1], found.end()
        if marker == END_OF_IMAGE:
            break
        scans += marker == START_OF_SCAN
        at += int.from_bytes(content[at : at + 2], "big")  # the length of a segment counts itself
        if scans > limits.SCANS:
            raise OSError(f"it is drawn in more than {limits.SCANS} scans, which is all that are read")


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
    """Raises UserError for a file behind a link that does not begin as a picture, a mask or a depth image does.

    What goes into a subset may be a link of the capture to anything: to a key, say, that would be copied.
    """
    if not bounded.linked(path):
        return
    try:
        bounded.checked(path)
        with open(path, "rb") as file:
            head = file.read(16)
    except OSError as error:
        raise UserError(f"image '{path}' cannot be read: {error.strerror}") from None
    if head.startswith(BEGINNINGS) or head[4:8] == b"ftyp" or COLMAP_DEPTH.match(head) or _is_npz(path, head):
        return
    if path.suffix.lower() == ".tga":
        image_size(path)
        return
    raise UserError(f"'{path}' leads to what is no picture and no depth image; take it out of the capture")


def _is_npz(path: Path, head: bytes) -> bool:
    """Whether it is an archive of arrays and nothing else."""
    try:
        with zipfile.ZipFile(path) as archive:
            return head.startswith(b"PK") and all(name.endswith(".npy") for name in archive.namelist())
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError):
        return False


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
