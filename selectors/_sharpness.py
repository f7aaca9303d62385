"""Prefers sharp frames: blurred ones lose ties and are never the first choice within a window of the capture.

`sharpness` s is any number per frame that grows with it (viewbench takes the variance of the Laplacian). It depends on
what the frame shows, so it is compared only with the frames around it: q_i = s_i / max s over the window of i.
A greedy selector with weight w takes the view of largest gain · q^w. A frame below the median of its window is
blurred, and is not taken before some frame of its window has been.
"""

from collections.abc import Sequence

import numpy as np

WINDOW = 15  # frames, half a second of video: motion blur comes and goes within it
FLOOR = 1e-3  # of q, so that no frame is lost for good


class Preference:
    """Picks the view of largest gain; with sharpness and weight w > 0, the largest gain · q^w among those allowed.

    The views `kept` come first, in their order, whatever their gains.
    """

    def __init__(self, sharpness: np.ndarray | None, weight: float = 0.0, kept: Sequence[int] | np.ndarray = ()):
        self.kept = [int(i) for i in kept]
        self.sharpness = sharpness if weight > 0 else None
        if self.sharpness is None:
            return
        windows = _windows(self.sharpness)
        highest = np.maximum(np.nanmax(windows, axis=1), np.finfo(float).tiny)
        self.weights = np.clip(self.sharpness / highest, FLOOR, 1) ** weight  # (N,) q^w
        self.allowed = self.sharpness >= np.nanmedian(windows, axis=1)  # (N,) bool

    def best(self, gains: np.ndarray) -> int:
        """Index of the best gain (N,), −∞ for views that are gone; ties go to the sharper, then the earlier."""
        if self.kept:
            return self.kept[0]
        if self.sharpness is None:
            return int(gains.argmax())
        scores = gains * self.weights
        allowed = np.where(self.allowed, scores, -np.inf)
        if allowed.max() > -np.inf:  # a run of blurred frames only must not end the selection
            scores = allowed
        ties = np.flatnonzero(scores == scores.max())
        return int(ties[self.sharpness[ties].argmax()])

    def take(self, i: int) -> None:
        """Tells that view i was chosen: its window has had its first choice."""
        if self.kept and self.kept[0] == i:
            del self.kept[0]
        if self.sharpness is not None:
            self.allowed[max(0, i - WINDOW // 2) : i + WINDOW // 2 + 1] = True

    def any(self, rng: np.random.Generator, n: int) -> int:
        """One of the n views at random, not a blurred one."""
        if self.kept:
            return self.kept[0]
        if self.sharpness is None:
            return int(rng.integers(n))
        return int(rng.choice(np.flatnonzero(self.allowed)))


def sharpest_near(chosen: np.ndarray, sharpness: np.ndarray) -> np.ndarray:
    """For each chosen view the sharpest one of those that are nearer to it in the capture than to the others chosen.

    `chosen` is (K,) distinct and so is the result, in the same order.
    """
    order = np.argsort(chosen)
    middles = (chosen[order][:-1] + chosen[order][1:] + 1) // 2
    owners = np.split(np.arange(len(sharpness)), middles)
    result = np.empty_like(chosen)
    for position, frames in zip(order, owners, strict=True):
        result[position] = frames[sharpness[frames].argmax()]
    return result


def _windows(values: np.ndarray) -> np.ndarray:
    """(N, WINDOW) values around each frame, NaN beyond both ends of the capture."""
    padded = np.pad(values.astype(np.float64), WINDOW // 2, constant_values=np.nan)
    return np.lib.stride_tricks.sliding_window_view(padded, WINDOW)
