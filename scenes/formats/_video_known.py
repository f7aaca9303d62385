"""What the cache knows of a video besides its pictures; what is damaged there is found out anew."""

import contextlib
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ...common import arrays
from ...common.errors import UserError
from ...common.files import read_json, whole
from ._video_packets import Packets


def keep(file: Path, packets: Packets) -> None:
    """Writes the table of packets, whole or not at all."""
    with whole(file) as temporary, open(temporary, "wb") as stream:
        np.savez(
            stream,
            pts=packets.pts,
            flags=packets.flags,
            base=np.array([packets.time_base.numerator, packets.time_base.denominator]),
            codec=np.array(packets.codec),
            aspect=np.array(packets.aspect),
            facts=np.array([packets.counted, packets.announced, packets.whole], dtype=np.int64),
        )


def packets(file: Path) -> Packets | None:
    """The table of packets as it was kept; None where there is none, or it is damaged."""
    try:
        table = arrays.npz(file)
        counted, announced, complete = table["facts"].tolist()
        base, aspect = Fraction(*table["base"].tolist()), float(table["aspect"])
        pts, flags = table["pts"], table["flags"]
        found = Packets(pts, flags, base, str(table["codec"]), bool(counted), announced, bool(complete), aspect)
    except (OSError, ValueError, KeyError, TypeError, ArithmeticError):
        return None
    shapes = pts.ndim == 1 and pts.shape == flags.shape and pts.dtype == np.int64 and flags.dtype == np.uint8
    return found if shapes and base > 0 and 0 < aspect < np.inf and isinstance(announced, int) else None


def facts(file: Path) -> dict[str, Any] | None:
    """Size, dynamic range and turn of the frames; None where they are not known."""
    record = _read(file)
    if not isinstance(record, dict) or not isinstance(record.get("hdr"), str):
        return None
    size, turn = record.get("size") or [], record.get("turn") or []
    sound = _whole(size, 2) and _whole(turn, 4) and 1 <= min(size) <= max(size) < 1 << 31 and set(turn) <= {-1, 0, 1}
    return record if sound else None


def lost(file: Path) -> set[int]:
    """Numbers of the frames that cannot be decoded, as far as it is known."""
    record = _read(file)
    return set(record) if isinstance(record, list) and _whole(record, len(record)) else set()


def _read(file: Path) -> Any:
    with contextlib.suppress(UserError):
        return read_json(file, "cached facts") if file.is_file() else None
    return None


def _whole(values: Any, count: int) -> bool:
    """Whether it is a list of so many whole numbers."""
    kinds = isinstance(values, list) and len(values) == count
    return kinds and all(isinstance(value, int) and not isinstance(value, bool) for value in values)
