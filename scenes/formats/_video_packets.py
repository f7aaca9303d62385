"""What the packets of a video say about its frames, without decoding one: numbers, times, and where decoding can start.

A frame's number is its place among the frames that a player shows, from 0. Packets lie in the file in the order of
decoding; sorted by their time stamps they are the frames. It holds for every codec that phones and cameras write
(one packet a frame); a file without time stamps, or with two packets of one time, is numbered by decoding it.
"""

import contextlib
import itertools
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ...common import bounded, limits
from ...common.errors import UserError

# The containers of the endings in `video.SUFFIXES`. By its content FFmpeg would open anything under these names, lists
# of other files and addresses (HLS, concat) too.
OPENING = {"format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts", "protocol_whitelist": "file"}
KEY, SPARE, HIDDEN = 1, 2, 4  # bits of `flags`: decoding can start here; no other frame needs it; not shown


@dataclass(frozen=True)
class Packets:
    """The packets of one video stream in the order of decoding, and the frames in that of showing."""

    pts: np.ndarray  # (P,) int64 time stamps in units of `time_base`
    flags: np.ndarray  # (P,) uint8
    time_base: Fraction  # seconds
    codec: str
    counted: bool = False  # numbered by decoding: `pts` are then of the frames, in the order of showing
    announced: int = 0  # frames that the file's head promises, 0 where it says nothing
    whole: bool = True  # False where reading ended in an error
    aspect: float = 1.0  # width of a pixel by its height, 1 but for old camcorders

    @property
    def frames(self) -> np.ndarray:
        """(N,) int64 index of the packet of each frame, by its number."""
        shown = np.flatnonzero((self.flags & HIDDEN) == 0)
        return shown if self.counted else shown[np.argsort(self.pts[shown], kind="stable")]

    @property
    def times(self) -> np.ndarray:
        """(N,) float64 seconds of each frame."""
        return self.pts[self.frames] * float(self.time_base)

    @property
    def cut(self) -> str:
        """What is missing at the end of the file, for people; empty where nothing is."""
        n = len(self.frames)
        if self.announced > len(self.pts):
            return f"the file is cut short: {n} of {self.announced} frames are in it"
        return "" if self.whole else f"the file is damaged or cut short after {n} frames"


@contextlib.contextmanager
def opened(root: Path) -> Iterator[tuple[Any, Any]]:
    """(container, video stream) of PyAV, closed afterwards.

    Raises UserError, from the body's decoding too, for a file that is no video or has none in it.
    """
    from ...common import extras  # no source: it says what to install

    extras.need("av")
    import av
    from av.error import FFmpegError

    try:
        bounded.checked(root, limits.VIDEO_BYTES)
        # An absolute path: of "concat:a.mp4" FFmpeg would take the beginning for a protocol.
        with av.open(str(root.absolute()), metadata_errors="replace", options=OPENING) as container:
            stream = _film(container, root)
            stream.thread_type = "AUTO"
            # Also of frames that are larger than the stream says: memory is taken for them before they are seen.
            stream.codec_context.options = {"max_pixels": str(limits.VIDEO_PIXELS)}
            yield container, stream
    except (FFmpegError, ValueError, OSError, OverflowError) as error:
        reason = _no_index(root) or f"cannot be decoded: {error}"
        raise UserError(f"video '{root}' {reason}") from None


def _film(container: Any, root: Path) -> Any:
    """The stream that is the film: not the cover, the default one or, of several, the one with most pixels."""
    from av.stream import Disposition

    films = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]
    films = [s for s in films if s.codec_context is not None and s.width]
    if not films:
        raise UserError(f"'{root}' has no video in it")
    film = max(films, key=lambda s: (bool(s.disposition & Disposition.default), s.width * s.height, -s.index))
    aspect = float(film.sample_aspect_ratio or 1) or 1.0
    if not 1 / limits.PIXEL_ASPECT <= aspect <= limits.PIXEL_ASPECT:
        raise UserError(f"video '{root}' says that its pixels are {aspect:.3g} times as wide as high; correct its head")
    if film.width * film.height * max(1.0, aspect) > limits.VIDEO_PIXELS:
        most = f"{limits.VIDEO_PIXELS / 1e6:.0f} million pixels"
        raise UserError(f"video '{root}' says that it is {film.width} x {film.height}, more than {most}; scale it down")
    return film


def read_packets(root: Path) -> Packets:
    """Goes through the file without decoding it. Raises UserError for a file that is no video."""
    from av.error import FFmpegError

    rows: list[tuple[int | None, int]] = []
    whole = True
    with opened(root) as (container, stream):
        base, codec, announced = stream.time_base, stream.codec_context.name, stream.frames
        aspect = float(stream.sample_aspect_ratio or 1) or 1.0
        try:
            for packet in container.demux(stream):
                if not packet.size:
                    continue
                hidden = packet.is_discard or packet.is_corrupt
                if len(rows) > limits.SAMPLES:
                    raise UserError(f"video '{root}' has more than {limits.SAMPLES:,} frames; cut it")
                rows.append((packet.pts, KEY * packet.is_keyframe | SPARE * packet.is_disposable | HIDDEN * hidden))
                whole &= not packet.is_corrupt
        except FFmpegError:  # what came before can be used
            whole = False
    stamps = [pts for pts, _ in rows]
    if None in stamps or len(set(stamps)) < len(stamps) or not rows:
        return _counted(root, codec, announced, aspect)
    pts, flags = np.array(stamps, dtype=np.int64), np.array([flags for _, flags in rows], dtype=np.uint8)
    _hide_undecodable(pts, flags)
    return Packets(pts, flags, Fraction(base), codec, announced=announced, whole=whole, aspect=aspect)


def _hide_undecodable(pts: np.ndarray, flags: np.ndarray) -> None:
    """Marks what comes before the first frame that decoding can start at, in either order: it is never shown."""
    keys = np.flatnonzero(flags & KEY)
    if len(keys):
        flags[(np.arange(len(pts)) < keys[0]) | (pts < pts[keys[0]])] |= HIDDEN


def _counted(root: Path, codec: str, announced: int, aspect: float) -> Packets:
    """The frames of a file whose packets do not tell them, found by decoding it once."""
    with opened(root) as (container, stream):
        base = Fraction(stream.time_base)
        stamps = [frame.pts for frame in decoded(container, stream)]
        rate = stream.average_rate or 30
    known = [pts for pts in stamps if pts is not None]
    if len(known) < len(stamps) or any(b <= a for a, b in itertools.pairwise(known)):
        base, stamps = 1 / Fraction(rate), list(range(len(stamps)))  # no times: equal steps
    none = np.zeros(len(stamps), np.uint8)
    pts = np.array(stamps, np.int64)
    return Packets(pts, none, base, codec, counted=True, announced=announced, aspect=aspect)


def decoded(container: Any, stream: Any) -> Iterator[Any]:
    """Every frame that can be decoded, in the order of showing; damaged packets are left out."""
    from av.error import FFmpegError

    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except (StopIteration, FFmpegError):
            break
        with contextlib.suppress(FFmpegError):
            yield from stream.decode(packet if packet.size else None)
    with contextlib.suppress(FFmpegError):
        yield from stream.decode(None)


def _no_index(root: Path) -> str:
    """What to do about an MP4 or MOV file without its index, which is written when the recording ends; or nothing."""
    boxes = []
    try:
        with root.open("rb") as file:
            end, at = root.stat().st_size, 0
            while at + 8 <= end and len(boxes) < 1000:
                file.seek(at)
                head = file.read(16)
                size, kind = struct.unpack(">I4s", head[:8])
                if size == 1 and len(head) == 16:
                    size = struct.unpack(">Q", head[8:])[0]
                boxes.append(kind)
                at += size if size >= 8 else end  # 0: to the end of the file
    except (OSError, struct.error):
        return ""
    if boxes[:1] == [b"ftyp"] and b"moov" not in boxes:
        return "has no index (moov): the recording was cut off; repair it with untrunc and a whole clip of that camera"
    return ""
