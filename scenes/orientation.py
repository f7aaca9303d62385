"""Photos that say how they are to be turned (EXIF orientation), and HEIC photos: how they are seen, and how written.

Tools disagree about the tag. PIL, and with it the 3DGS authors' reader and nerfstudio's, and COLMAP read the pixels as
they are stored; OpenCV's imread, browsers and viewers turn them. A linked file with a tag is thus two pictures: poses
are found for one of them, and another program trains on the other. So only files without a tag (or with 1, "as it is")
are linked; of others the turned pixels are written, without the tag, and all tools agree. JPEG loses a little by it
(quality 95, full chroma); names and the rest of EXIF, from which COLMAP takes the focal length, stay.

A folder with photos held upright and across has two sizes when they are turned, and one as the sensor saw them: one
camera, which is also what structure-from-motion should take them for. Then the stored pixels stay, not a bit of them
changed, and the tag alone is set to 1.
"""

import shutil
import struct
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..common.files import whole
from .image_files import HEIC, open_image

ORIENTATION = 0x0112  # of EXIF 2.32, 4.6.4 A
JPEG = {".jpg", ".jpeg"}


def orientation(path: Path) -> int:
    """The EXIF orientation, 1 to 8, of an image; 1 where it has none. Raises UserError for what is no image."""
    with open_image(path, head=True) as image:
        found = image.getexif().get(ORIENTATION, 1)
    return found if found in range(1, 9) else 1


def upright_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels as the photo is seen. Raises UserError for a missing file and one that is no image."""
    with open_image(path, head=True) as image:
        found = image.getexif().get(ORIENTATION, 1)
        # PIL itself turns TIFF as it reads it, and gives the size that it will have.
        return image.size[::-1] if found in (5, 6, 7, 8) and image.format != "TIFF" else image.size


def upright(image: Any) -> Any:
    """The PIL image as it is seen; itself where it has no orientation."""
    from PIL import ImageOps

    if image.getexif().get(ORIENTATION, 1) == 1:
        return image
    image.load()  # a TIFF has no tag after that
    return ImageOps.exif_transpose(image)


def written_name(path: Path, taken: set[str]) -> str:
    """Name under which a photo is written: its own, and .jpg for HEIC, which COLMAP and trainers do not read.

    `taken` are the names of all the photos: telephones may keep a JPEG of the same name beside the HEIC.
    """
    if path.suffix.lower() not in HEIC:
        return path.name
    name = f"{path.stem}.jpg"
    return f"{path.name}.jpg" if name in taken else name


def must_be_written(path: Path) -> bool:
    """Whether a photo cannot be linked as it is."""
    return path.suffix.lower() in HEIC or orientation(path) != 1


def write_photo(source: Path, target: Path, turn: bool) -> None:
    """Writes a photo without an orientation tag: turned as it is seen, or with `turn` False as it is stored.

    Raises UserError when another photo's was written to the same place.
    """
    if target.exists():
        raise UserError(f"image '{source}' and another would both be written as '{target.name}'; rename one")
    if not turn and source.suffix.lower() in JPEG:
        data = source.read_bytes()
        at = _place_of_tag(data)
        if at is not None:
            place, order = at
            with whole(target) as temporary:
                temporary.write_bytes(data[:place] + struct.pack(order + "H", 1) + data[place + 2 :])
            return
    if not turn and source.suffix.lower() not in HEIC:
        with whole(target) as temporary:
            shutil.copyfile(source, temporary)
        return
    with open_image(source) as image:
        seen = upright(image)
        exif = seen.getexif()
        exif.pop(ORIENTATION, None)
        options: dict[str, Any] = {} if image.format == "TIFF" else {"exif": exif}
        if image.info.get("icc_profile"):
            options["icc_profile"] = image.info["icc_profile"]
        if target.suffix.lower() in JPEG:
            options |= {"quality": 95, "subsampling": 0}
            seen = seen if seen.mode in ("RGB", "L") else seen.convert("RGB")
        elif target.suffix.lower() == ".webp":
            options["lossless"] = True
        with whole(target) as temporary:
            seen.save(temporary, **options)


def _place_of_tag(data: bytes) -> tuple[int, str] | None:
    """(offset of the orientation's number, byte order) in a JPEG file's first IFD, or None (EXIF 2.32, 4.5 and 4.6)."""
    at = 2
    while data[at : at + 1] == b"\xff" and at + 4 <= len(data):
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        if data[at + 1] == 0xE1 and data[at + 4 : at + 10] == b"Exif\0\0":
            tiff = at + 10
            order = {b"II": "<", b"MM": ">"}.get(data[tiff : tiff + 2])
            if order is None:
                return None
            try:
                first = tiff + struct.unpack_from(order + "I", data, tiff + 4)[0]
                for number in range(struct.unpack_from(order + "H", data, first)[0]):
                    entry = first + 2 + 12 * number
                    if struct.unpack_from(order + "H", data, entry)[0] == ORIENTATION:
                        return entry + 8, order
            except struct.error:
                pass
            return None
        if data[at + 1] == 0xDA:
            return None
        at += 2 + length
    return None
