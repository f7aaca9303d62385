"""Frames of a video by their numbers: only what they need is decoded, and the pixels are those of a full decode.

Decoding starts at the last key frame that is not shown after the frame wanted (of an open group of pictures that is not
always the last one before it in the file) and ends with the packet of the frame itself, after which the decoder is
emptied. Between the two, packets that nothing else needs are left out: those that the container marks so, and in H.264
those of nal_ref_idc 0 (ITU-T H.264, 7.4.1), by the decoder's skip_frame. HEVC's sub-layer non-reference pictures may be
references of higher sub-layers (ITU-T H.265, 7.4.2.2), so that they are decoded.
"""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._video_packets import HIDDEN, KEY, SPARE, Packets, decoded, opened

SEEK_OVER = 50  # packets: fewer are read and thrown away, which costs less than finding a place in the file
EARLIER_S = (0, 2, 20)  # seconds before a key frame that it is looked for: MPEG-TS leads to about where one asks
FROM_FIRST = 1 << 30  # key frames back: from the first one


def frames(root: Path, packets: Packets, numbers: Sequence[int]) -> Iterator[tuple[int, Any]]:
    """(number, PyAV frame) of each of the frames `numbers` that can be decoded, mostly in their order.

    A frame is valid until the next one is asked for. Raises UserError for a file that cannot be opened.
    """
    wanted = {int(number) for number in numbers}
    if not wanted:
        return
    if packets.counted:
        with opened(root) as (container, stream):
            for number, frame in enumerate(decoded(container, stream)):
                if number in wanted:
                    yield number, frame
                if number >= max(wanted):
                    return
        return
    back = 0
    while wanted:
        try:
            for number, frame in _attempt(root, packets, sorted(wanted), back):
                if number in wanted:  # what is found is not looked for again
                    wanted.discard(number)
                    yield number, frame
            if back:
                return  # what is missing now is damaged
            back = 1
        except _NoStartError:
            if back == FROM_FIRST:
                return
            back = FROM_FIRST


class _NoStartError(Exception):
    """Decoding cannot start at some key frame: the container does not lead there, or it is none.

    (A recovery point of a gradual refresh is marked as a key frame, and the pictures after it are not whole.)
    """


def needed(packets: Packets, numbers: Sequence[int], back: int = 0) -> np.ndarray:
    """(P,) bool: packets between the key frame that each frame needs, or the `back`-th before it, and the frame's."""
    spans = np.zeros(len(packets.pts) + 1, dtype=np.int64)
    keys = np.flatnonzero(packets.flags & KEY)
    targets = packets.frames[np.asarray(numbers, dtype=np.int64)]
    for target in targets:
        starts = keys[: np.searchsorted(keys, target, side="right")]
        starts = starts[packets.pts[starts] <= packets.pts[target]]
        first = starts[max(0, len(starts) - 1 - back)] if len(starts) else 0
        spans[first] += 1
        spans[target + 1] -= 1
    return np.cumsum(spans[:-1]) > 0


def _attempt(root: Path, packets: Packets, numbers: list[int], back: int) -> Iterator[tuple[int, Any]]:
    order = packets.frames
    number_of = {int(packets.pts[packet]): number for number, packet in enumerate(order)}
    targets = set(order[numbers].tolist())
    use = needed(packets, numbers, back)
    feed = use & ~((packets.flags & SPARE > 0) & ~np.isin(np.arange(len(use)), list(targets)))
    edges = np.flatnonzero(np.diff(np.r_[0, use.astype(np.int8), 0]))
    with opened(root) as (container, stream):
        reader = _Reader(container, stream, packets)
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if not reader.go_to(int(begin)):
                raise _NoStartError
            start = number_of.get(int(packets.pts[begin])) if not packets.flags[begin] & HIDDEN else None
            for at in range(begin, end):
                packet = reader.take()
                if packet is None:
                    break
                if feed[at]:
                    for number, frame in _numbered(_decode(stream, packet, at == begin or at in targets), number_of):
                        start = _begun(start, number)
                        yield number, frame
            for number, frame in _numbered(_decode(stream, None, True), number_of):
                start = _begun(start, number)
                yield number, frame
            stream.codec_context.flush_buffers()


def _begun(start: int | None, number: int) -> int | None:
    """None when the key frame that decoding started at is among the frames given. Raises where a later one is first."""
    if start is not None and number > start:
        raise _NoStartError
    return None if number == start else start


def _decode(stream: Any, packet: Any, whole: bool) -> list[Any]:
    """Frames that the decoder gives for a packet, or for its end; `whole` False lets it leave the packet's out."""
    from av.error import FFmpegError

    context = stream.codec_context
    if context.name == "h264":
        context.skip_frame = "DEFAULT" if whole else "NONREF"
    with contextlib.suppress(FFmpegError):  # a damaged packet costs its frames
        return stream.decode(packet)
    return []


def _numbered(found: list[Any], number_of: dict[int, int]) -> Iterator[tuple[int, Any]]:
    for frame in found:
        if frame.pts in number_of:
            yield number_of[frame.pts], frame


class _Reader:
    """Gives the packets of a stream from any place of the table on."""

    def __init__(self, container: Any, stream: Any, packets: Packets):
        self.container, self.stream, self.packets = container, stream, packets
        self.place = {int(pts): at for at, pts in enumerate(packets.pts)}
        self.at = 0  # of the packet that `take` gives next
        self.ahead: Any = None
        self.source = container.demux(stream)

    def take(self) -> Any:
        """The next packet, or None where the file ends or cannot be read on."""
        from av.error import FFmpegError

        packet, self.ahead = self.ahead, None
        while packet is None:
            try:
                packet = next(self.source)
            except (StopIteration, FFmpegError):
                return None
            if not packet.size:
                return None
        self.at += 1
        return packet

    def go_to(self, at: int) -> bool:
        """Makes the packet of this place the next one; False where the file does not have it."""
        far = at < self.at or at - self.at > SEEK_OVER
        if far and not any(self._seek(at, seconds) for seconds in EARLIER_S):
            return False
        while self.at < at:
            if self.take() is None:
                return False
        return True

    def _seek(self, at: int, earlier: float) -> bool:
        """Goes to a packet at or before the place, `earlier` seconds if need be; False where that leads beyond it."""
        from av.error import FFmpegError

        try:
            self.container.seek(int(self.packets.pts[at] - earlier / self.packets.time_base), stream=self.stream)
            self.source = self.container.demux(self.stream)
            self.ahead = None
            packet = self.take()
        except FFmpegError:
            return False
        found = -1 if packet is None else self.place.get(packet.pts, -1)
        if not 0 <= found <= at:
            return False
        self.at, self.ahead = found, packet
        return True
