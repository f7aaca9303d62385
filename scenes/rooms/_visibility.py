"""Is a test view fair? The share of its pixels that show what some training view saw, by casting rays."""

from typing import Any

import numpy as np

from ..types import OPENCV
from ._rendering import FIELD_OF_VIEW, NEAREST_M
from ._tracing import Tracer, grid
from ._types import Room

SIDE = 24  # squared, the rays of a test view
SLACK_M = 0.02  # how far before a place something may be that is taken for the place's own surface


def seen_shares(room: Room, test: np.ndarray, train: np.ndarray, side: int = SIDE, tracer: Any = None) -> np.ndarray:
    """(M,) shares in [0, 1] of the pixels of (M, 4, 4) test poses that some of (N, 4, 4) training poses sees.

    Both have OpenGL axes. A pixel counts where the first surface behind it, glass aside, lies within a training
    view's picture with nothing in between; what a mirror shows is not followed, its own surface is. Pixels that
    look out of the room count as not seen. The room is cast by `tracer` if given, else by one without its glass.
    """
    tracer = tracer or Tracer(room, without=("glass",))
    rays, shares = grid(side), np.zeros(len(test))
    cameras = train @ OPENCV
    for i, pose in enumerate(test @ OPENCV):
        _, places, _ = tracer.first_hits(pose, rays)
        # Near cameras that look the same way are the likeliest to see it, and a place is looked at until one does.
        distance = np.linalg.norm(cameras[:, :3, 3] - pose[:3, 3], axis=1) - cameras[:, :3, 2] @ pose[:3, 2]
        for camera in cameras[np.argsort(distance, kind="stable")]:
            if not len(places):
                break
            shown = np.flatnonzero(_within(camera, places))
            seen = shown[tracer.sees(camera[:3, 3], places[shown], SLACK_M)]
            places = np.delete(places, seen, axis=0)
            shares[i] += len(seen) / len(rays)
    return shares


def _within(camera: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(P,) bool, whether (P, 3) places are within the picture of a camera with OpenCV axes."""
    x, y, z = ((places - camera[:3, 3]) @ camera[:3, :3]).T
    return (z > NEAREST_M) & (np.maximum(np.abs(x), np.abs(y)) < z * np.tan(FIELD_OF_VIEW / 2))


def is_of(found: Any, of: dict[str, Any]) -> bool:
    """Whether the content of a seen_test.json is of the room and the poses whose hashes `of` has."""
    return isinstance(found, dict) and all(found.get(key) == value for key, value in of.items())


def record(names: list[str], shares: np.ndarray) -> dict[str, Any]:
    """The content of seen_test.json: of each test view the share of its pixels that some training view sees."""
    views = {name: round(float(share), 4) for name, share in zip(names, shares, strict=True)}
    return {"schema": 1, "rays_per_view": SIDE**2, "seen": views}
