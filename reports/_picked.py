"""What pictures of a choice are drawn from: the frames, those chosen, and how near the others are to them."""

from dataclasses import dataclass

import numpy as np

from ..scenes.types import Scene, Split
from ..selectors._covering import nearest_chosen
from ..selectors._similarity import Similarity

WORDS = {"pos": "position", "ang": "rotation", "sem": "image content"}


@dataclass(frozen=True)
class Picked:
    """A choice of K of N frames, and for each frame the chosen one that it is nearest to."""

    title: str
    frames: Split
    posed: bool
    chosen: np.ndarray  # (K,) indices in the order chosen
    owner: np.ndarray  # (N,) the nearest chosen frame: itself where it is chosen
    distance: np.ndarray | None  # (N,) 1 − similarity to it, 0 where it is chosen; None where nothing compares frames
    factors: str  # what the similarity is of, in words
    within: float | None = None  # the distance of --auto

    @property
    def clock(self) -> np.ndarray:
        """(N,) seconds where the capture has them and they grow, else 0, 1, 2, …"""
        times = self.frames.times
        timed = times is not None and bool(np.isfinite(times).all() and (np.diff(times) > 0).all())
        return times if times is not None and timed else np.arange(len(self.frames))

    @property
    def unit(self) -> str:
        """What `clock` counts."""
        return "training view" if self.clock.dtype.kind == "i" else "seconds"


def picked(
    scene: Scene, title: str, chosen: np.ndarray, similar: Similarity | None, within: float | None = None
) -> Picked:
    """The choice by this similarity; where there is none, frames are nearest to the chosen one next to them."""
    if similar is None:
        owner, distance, factors = _next_to(len(scene.train), chosen), None, "place in the capture"
    else:
        owner, distance = nearest_chosen(similar, chosen)
        factors = ", ".join(WORDS[name] for name in similar.weights)
    return Picked(title, scene.train, scene.posed, chosen, owner, distance, factors, within)


def _next_to(n: int, chosen: np.ndarray) -> np.ndarray:
    """(N,) the chosen frame that each is next to in the capture, the earlier of two."""
    order = np.sort(chosen)
    middles = (order[:-1] + order[1:]) // 2
    return order[np.searchsorted(middles, np.arange(n), side="left")]
