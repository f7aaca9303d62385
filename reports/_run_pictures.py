"""The test views of one cell as pictures that a browser shows: the truth, the render and how far they are apart.

By Pillow alone, in milliseconds: a tracker draws them while the study runs.
"""

import functools
import io
import math
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..scenes.image_files import is_file, leaves, open_image
from ._thumbnails import font, shortened

GAIN = 4  # of the difference: at 30 dB it is dark grey, at 20 dB light; always the same, so that runs can be compared
LARGEST = 640  # pixels of a picture's longer side; a larger one is reduced
ENLARGED = 256  # and a smaller one enlarged by as many whole times as stay within this: three fit into MLflow's viewer
NARROWEST = 480  # pixels of a strip, which has words below it
GAP, LINE, LETTERS = 6, 20, 13  # pixels between pictures, of a line of words, and of its letters
INK, GREY, PAPER = "#1F1F1F", "#6A6A6A", "white"
PIXELS = 40_000_000  # of a render that is drawn: 8K has 33 million
BYTES = 1_000_000  # of a picture as it is written
LONGEST = 240  # letters of a line: no strip has room for more
SHAPE = 0.02  # share by which a truth's width to height may be another than the render's: sizes are whole pixels
QUALITIES = (80, 60, 40, 15)  # of JPEG, tried until the picture is within BYTES
# MLflow shows .jpg, .jpeg, .png, .gif, .bmp and .svg as pictures, and offers .webp for download.
JPEG, PNG = ".jpg", ".png"


def views_to_show(metrics: Any, count: int) -> list[dict[str, Any]]:
    """`count` of the views of metrics.json at equal steps from the first to the last, or the middle one; all where
    there are no more. They depend on the length of the test split alone: all cells of a scene show the same.

    One that has no name or file as viewbench writes it is left out, and no other takes its place. Raises UserError
    where there is no list of views.
    """
    views = metrics.get("views") if isinstance(metrics, dict) else None
    if not isinstance(views, list):
        raise UserError("the metrics of the cell have no list of views; evaluate it again")
    last, count = len(views) - 1, min(count, len(views))
    if count < 2:
        places = [last // 2] * max(0, count)
    else:
        places = [(2 * k * last + count - 1) // (2 * (count - 1)) for k in range(count)]  # rounded, halves upwards
    shown = [views[place] for place in places]
    return [view for view in shown if isinstance(view, dict) and all(_is_text(view.get(k)) for k in ("name", "file"))]


def files_of(view: dict[str, Any], cell: Path, truths: Path) -> tuple[Path, Path | None]:
    """The render of a view in the cell's folder, and its truth in results/STUDY/scenes/SCENE where that has one.

    Raises UserError for a file that the record places outside of the cell's folder.
    """
    if leaves(view["file"]):
        raise UserError(f"view '{view['name']}' of '{cell}' is said to be in '{view['file']}'; evaluate the cell again")
    truth = truths / Path(view["file"]).name
    return cell / view["file"], truth if is_file(truth) else None


def words_of(view: dict[str, Any]) -> str:
    """`NAME · 25.7 dB PSNR · SSIM 0.884` of a view; of a score that is missing nothing is said."""
    psnr, ssim = (_figure(view.get(key)) for key in ("psnr_db", "ssim"))
    parts = [f"PSNR {psnr:.1f} dB"] if psnr is not None else []
    parts += [f"SSIM {ssim:.3f}"] if ssim is not None else []
    return " · ".join([view["name"], *parts])


def strip(render: Path, truth: Path | None, words: str) -> Any:
    """A PIL image, RGB: the truth, the render and GAIN times their absolute difference (the mean over the colours,
    white where they are 64 or more of 255 apart), with what each is and `words` below. At most 1,932 x 680 pixels.

    Small pictures are enlarged by a whole number of times, each pixel becoming a square: a smooth enlargement would
    invent detail that no score has seen. Large ones are reduced to the means of what each pixel covers. A truth of
    another size is brought to the render's. Where it is missing, cannot be read or has another shape, the render
    stands alone and the strip says so.

    Raises UserError for a render that cannot be read or has more than PIXELS pixels.
    """
    drawn = _picture(render)
    compared, why = _compared(truth, drawn.size)
    if compared is None:
        panels = [(_shown(drawn), f"render; {why}")]
    else:
        panels = [
            (_shown(compared), why),
            (_shown(drawn), "render"),
            (_apart(compared, drawn), f"absolute difference x {GAIN}"),
        ]
    return _laid_out(panels, words)


def encoded(image: Any, ending: str = JPEG) -> bytes:
    """The image as a file with this ending, JPEG or PNG: at most BYTES as JPEG. The same image gives the same bytes.

    JPEG, for photographs: it takes a quarter of PNG's time. PNG for drawings.
    """
    if ending == PNG:
        return _saved(image, "PNG", compress_level=3)
    content = b""
    for quality in QUALITIES:
        # 4:2:2: a third of the time that full colour takes, and squares of enlarged pixels are two wide at least.
        content = _saved(image, "JPEG", quality=quality, subsampling=1)
        if len(content) <= BYTES:
            break
    return content


def _saved(image: Any, kind: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and bool(value)


def _figure(value: Any) -> float | None:
    known = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e6
    return float(value) if known and math.isfinite(value) else None


def _picture(path: Path) -> Any:
    """RGB. Raises UserError."""
    with open_image(path) as image:
        if not 0 < image.width * image.height <= PIXELS:
            size = f"{image.width} x {image.height}"
            raise UserError(f"image '{path}' has {size} pixels; a strip is drawn of up to {PIXELS // 10**6} million")
        return image.convert("RGB")


def _compared(truth: Path | None, size: tuple[int, int]) -> tuple[Any, str]:
    """The truth at this size and its caption, or None and why there is none."""
    from PIL import Image

    if truth is None:
        return None, "there is no ground truth to compare it with"
    try:
        image = _picture(truth)
    except UserError:
        return None, "the ground truth cannot be read"
    if image.size == size:
        return image, "ground truth"
    shape = f"{image.width} x {image.height}"
    if abs(image.width * size[1] / (image.height * size[0]) - 1) > SHAPE:
        return None, f"the ground truth is {shape} and the render {size[0]} x {size[1]}"
    return image.resize(size, Image.Resampling.BICUBIC, reducing_gap=2.0), f"ground truth, resized from {shape}"


def _shown(image: Any) -> Any:
    """As large as it is shown."""
    from PIL import Image

    longest = max(image.size)
    times = ENLARGED // longest
    if times > 1:
        return image.resize((times * image.width, times * image.height), Image.Resampling.NEAREST)
    if longest <= LARGEST:
        return image
    small = tuple(max(1, round(side * LARGEST / longest)) for side in image.size)
    return image.resize(small, Image.Resampling.BOX)


def _apart(truth: Any, drawn: Any) -> Any:
    from PIL import ImageChops

    share = GAIN / 3
    # First shown, then amplified: what is amplified first is cut off at white, and its means come out too small.
    return _shown(ImageChops.difference(truth, drawn)).convert("L", (share, share, share, 0)).convert("RGB")


def _laid_out(panels: list[tuple[Any, str]], words: str) -> Any:
    from PIL import Image, ImageDraw

    (wide, tall), count = panels[0][0].size, len(panels)
    width = max(NARROWEST, count * (wide + GAP) - GAP)
    image = Image.new("RGB", (width, tall + 2 * LINE), PAPER)
    pen = ImageDraw.Draw(image)
    for place, (picture, label) in enumerate(panels):
        at = place * (wide + GAP)
        image.paste(picture, (at, 0))
        room = wide if count > 1 else width
        write(pen, (at, tall + 2), label, room, GREY)
    write(pen, (0, tall + LINE), words, width, INK)
    return image


def write(pen: Any, at: tuple[float, float], text: str, room: float, colour: str, size: int = LETTERS) -> None:
    """One line of text, its middle left out where it is wider than `room` pixels."""
    letters = letters_of(size)
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 3]}…{text[-2 * LONGEST // 3 :]}"
    pen.text(at, shortened(text, room, letters.getlength), font=letters, fill=colour)


@functools.cache
def letters_of(size: int) -> Any:
    """The font of this size, looked up once in a process."""
    return font(size)
