"""Small pictures of frames, and the letters beside them, by Pillow alone."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..scenes.image_files import open_image

BLANK = "#D8D8D8"  # in place of a picture that cannot be read


def thumbnail(path: Path, size: int) -> Any:
    """The picture within size × size pixels, turned as its file says, alpha on white, grey of any depth stretched to
    what it spans; a grey square where it cannot be read, which must not cost the rest."""
    from PIL import Image, ImageOps

    try:
        with open_image(path) as image:
            image.draft("RGB", (2 * size, 2 * size))  # JPEG decodes at a fraction of its size where that is enough
            upright = _rgb(ImageOps.exif_transpose(image))
            scale = size / max(upright.size)
            small = tuple(max(1, round(side * scale)) for side in upright.size)
            return upright.resize(small, Image.Resampling.BICUBIC, reducing_gap=2.0)
    except UserError:
        return Image.new("RGB", (size, size * 3 // 4), BLANK)


def _rgb(image: Any) -> Any:
    from PIL import Image

    if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
        layered = image.convert("RGBA")
        return Image.alpha_composite(Image.new("RGBA", layered.size, "white"), layered).convert("RGB")
    if image.mode.startswith("I") or image.mode == "F":  # more than 8 bits
        low, high = image.getextrema()
        scale = 255 / ((high - low) or 1)
        return image.convert("F").point(lambda value: value * scale - low * scale).convert("RGB")
    return image.convert("RGB")


def font(size: int) -> Any:
    """DejaVu Sans, which has the letters of most European scripts, where matplotlib or the system has it; else
    Pillow's own, which has Latin ones (a letter that is in neither is drawn as a box)."""
    from PIL import ImageFont

    spec = importlib.util.find_spec("matplotlib")
    shipped = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf" if spec and spec.origin else ""
    for name in (shipped, "DejaVuSans.ttf"):
        try:
            return ImageFont.truetype(str(name), size)
        except OSError:
            continue
    return ImageFont.load_default(size)


def shortened(text: str, room: float, width: Callable[[str], float]) -> str:
    """The text, without its middle where it is wider than `room`: the ends of file names tell them apart."""
    text = "".join(letter if letter.isprintable() else " " for letter in text)
    if width(text) <= room:
        return text
    for kept in range(len(text) - 1, 0, -1):
        front = kept // 3
        short = f"{text[:front]}…{text[len(text) - (kept - front) :]}"
        if width(short) <= room:
            return short
    return "…"
