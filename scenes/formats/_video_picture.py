"""A decoded frame as the picture that a player shows: upright, with the file's own matrix and range, in sRGB."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ._tone import to_srgb

HLG, PQ = 18, 16  # AVColorTransferCharacteristic: ARIB STD-B67, SMPTE ST 2084
UNKNOWN, BT709, BT2020 = 2, 1, 9  # AVColorSpace and AVColorPrimaries have the same numbers for these
HD = (1280, 576)  # pixels: a larger picture that does not say its matrix is BT.709's, as players (mpv) take it


@dataclass(frozen=True)
class Look:
    """How the frames of a video are to be shown."""

    aspect: float = 1.0  # width of a pixel by its height
    turn: tuple[int, int, int, int] = (1, 0, 0, 1)  # signs of a, b, c, d of the display matrix


def look_of(frame: Any, aspect: float) -> Look:
    """The look of the video that a frame is of.

    It is asked for once a video: PyAV's side data and the frame that they are of hold each other, and 12 MB of a 4K
    frame wait for the garbage collector.
    """
    data = frame.side_data.get("DISPLAYMATRIX")
    if data is None:
        return Look(aspect)
    a, b, _, c, d = np.sign(np.round(np.frombuffer(bytes(data), np.int32)[:5] / 65536)).astype(int).tolist()
    return Look(aspect, (0, b, c, 0) if b else (a, 0, 0, d))


def picture(frame: Any, look: Look, longest: int | None = None) -> np.ndarray:
    """(H, W, 3) uint8 sRGB of a PyAV frame, upright, with `longest` at most so many pixels on its longer side.

    Pixels come out square.
    """
    from av.video.reformatter import Interpolation

    wide = frame.width * look.aspect
    scale = 1.0 if longest is None else min(1.0, longest / max(wide, frame.height))
    width, height = (max(1, round(side * scale)) for side in (wide, frame.height))
    # Without the flags swscale takes the chroma of every second pixel and rounds down.
    way = Interpolation.BICUBIC if scale == 1 else Interpolation.AREA
    way |= Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
    if hdr(frame):
        return upright(_from_hdr(frame, width, height, way), look)
    matrix = None
    if frame.colorspace == UNKNOWN and (frame.width >= HD[0] or frame.height > HD[1]):
        matrix = BT709
    small = frame.reformat(width, height, "rgb24", src_colorspace=matrix, interpolation=way)
    return upright(small.to_ndarray(), look)


def size(frame: Any, look: Look) -> tuple[int, int]:
    """(width, height) in pixels of the frame's picture."""
    width, height = round(frame.width * look.aspect), frame.height
    return (height, width) if look.turn[1] else (width, height)


def hdr(frame: Any) -> str:
    """ "HLG" or "PQ" for a frame of high dynamic range, else nothing."""
    return {HLG: "HLG", PQ: "PQ"}.get(int(frame.color_trc), "")


def _from_hdr(frame: Any, width: int, height: int, way: int) -> np.ndarray:
    planes = frame.reformat(width, height, "yuv444p16le", interpolation=way)
    y, cb, cr = (_plane(planes.planes[k], width, height) for k in range(3))
    full = frame.color_range == 2
    low, span, chroma = (0.0, 65535.0, 65535.0) if full else (4096.0, 219 * 256.0, 224 * 256.0)
    kr, kb = (0.2126, 0.0722) if frame.colorspace == BT709 else (0.2627, 0.0593)
    out = np.empty((height, width, 3), np.uint16)
    for top in range(0, height, 128):  # what is in float32 is a strip
        part = slice(top, top + 128)
        luma = (y[part] - np.float32(low)) / np.float32(span)
        blue = (cb[part] - np.float32(32768)) / np.float32(chroma) * np.float32(2 * (1 - kb))
        red = (cr[part] - np.float32(32768)) / np.float32(chroma) * np.float32(2 * (1 - kr))
        green = -(kb * blue + kr * red) / np.float32(1 - kr - kb)
        for channel, offset in enumerate((red, green, blue)):
            out[part, :, channel] = np.round(np.clip(luma + offset, 0, 1) * 65535)
    return to_srgb(out, frame.color_trc == HLG, frame.color_primaries != BT709)


def _plane(plane: Any, width: int, height: int) -> np.ndarray:
    """(H, W) uint16."""
    return np.frombuffer(plane, np.uint16).reshape(-1, plane.line_size // 2)[:height, :width]


def upright(pixels: np.ndarray, look: Look) -> np.ndarray:
    """The pixels as the file's display matrix turns and mirrors them: telephones film on their side and say so.

    The matrix (ISO/IEC 14496-12, 8.3.2) takes (x, y) to (a x + c y, b x + d y); angles are right ones.
    """
    a, b, c, d = look.turn
    if b:
        pixels = pixels.swapaxes(0, 1)
    across, down = (c, b) if b else (a, d)
    return np.ascontiguousarray(pixels[:: -1 if down < 0 else 1, :: -1 if across < 0 else 1])
