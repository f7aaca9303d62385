"""Which frames of a long capture are looked at: every N-th, or so many a second."""

from dataclasses import dataclass

import numpy as np

from ..common.errors import UserError
from .types import Split


@dataclass(frozen=True)
class Thinning:
    """Every `stride`-th frame, or at most `fps` frames a second; all of them as it stands."""

    stride: int = 1
    fps: float | None = None

    def __post_init__(self) -> None:
        if self.stride < 1:
            raise UserError(f"stride {self.stride} must be 1 or more: every so many-th frame is looked at")
        if self.fps is not None and not 0 < self.fps < float("inf"):
            raise UserError(f"fps {self.fps} must be a number above 0: at most so many frames a second are looked at")
        if self.stride > 1 and self.fps is not None:
            raise UserError("give either --stride or --fps: both say which frames are looked at")

    def __bool__(self) -> bool:
        return self.stride > 1 or self.fps is not None

    def __str__(self) -> str:
        """As it is typed; empty where nothing is left out."""
        return f"--fps {self.fps:g}" if self.fps is not None else f"--stride {self.stride}" if self else ""


def candidates(split: Split, stride: int = 1, fps: float | None = None) -> np.ndarray:
    """(N,) bool: which frames of the split, in capture order, are candidates of the choice.

    Raises UserError for --fps where the capture has no times, and for numbers that mean nothing.
    """
    thinning = Thinning(stride, fps)
    if thinning.fps is not None and split.times is None:
        raise UserError("the capture has no times, so --fps cannot be obeyed; thin it by --stride N")
    if thinning.fps is None or split.times is None:
        return kept(len(split), split.times, thinning)
    if (np.diff(split.times) < 0).any():
        i = int((np.diff(split.times) < 0).argmax()) + 1
        raise UserError(
            f"the times of the capture fall at frame '{split.names[i]}' (several recordings?), so --fps cannot be "
            "obeyed; thin it by --stride N"
        )
    # The cameras of a rig share their moments: all of a moment are candidates, or none.
    return np.isin(split.times, split.times[kept(len(split), split.times, thinning)])


def kept(n: int, times: np.ndarray | None, thinning: Thinning) -> np.ndarray:
    """(N,) bool of frames 0 … n − 1 with their `times` in seconds.

    `fps` F lays ticks at t₀ + k / F and keeps, of the frames nearer to a tick than to any other, the nearest one (the
    earlier of two): time stamps that waver by a fraction of a frame, as those of a phone do, change nothing. Raises
    UserError for times that are not numbers.
    """
    mask = np.zeros(n, dtype=bool)
    if thinning.fps is None or times is None:
        mask[:: thinning.stride] = True
        return mask
    if not np.isfinite(times).all():
        raise UserError("some frames have no time, so --fps cannot be obeyed; thin the capture by --stride N")
    if not n:
        return mask
    at = (times - times.min()) * thinning.fps
    tick = np.round(at)
    # Rounded, so that of two frames as near as each other the earlier is taken and not the one that rounding favours.
    far = np.round(np.abs(at - tick), 6)
    order = np.lexsort((np.arange(n), far, tick))
    mask[order[np.r_[True, np.diff(tick[order]) > 0]]] = True
    return mask


def frame_name(number: int) -> str:
    """Name of the frame with this number in the video, from 0."""
    return f"frame_{number:06d}"


def frame_number(name: str) -> int:
    """Number in the video of the frame of this name."""
    return int(name.removeprefix("frame_"))
