"""Do neighbouring frames show enough of the same: points that agree with one epipolar geometry, as SfM wants them."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..common import extras  # no source: it says what to install
from .features import Progress, silent
from .image_files import open_image
from .orientation import upright

LONGEST = 1000  # pixels of a picture's longer side: enough for SIFT to tell, a tenth of a 4K frame's work
FEATURES = 3000
RATIO = 0.8  # Lowe, IJCV 2004, 7.1
ERROR_PX = 2.0
ENOUGH = 15  # inliers: COLMAP's mapper takes no pair with fewer (min_num_inliers, two_view_geometry)


def inliers_along(pictures: Iterable[np.ndarray], count: int, progress: Progress = silent) -> np.ndarray:
    """(2, K) int64 inliers between frame k and frame k + 1, and k + 2; 0 where there is no such frame.

    `pictures` are K greyscale ones (H, W) uint8, in capture order; features of three are in memory. SIFT, Lowe's
    ratio test, matches that are mutual (both as COLMAP does), and the fundamental matrix by MAGSAC++ (Barath et al.,
    CVPR 2020) in OpenCV, the same numbers every time. Raises UserError where OpenCV is not installed.
    """
    extras.need("cv2")
    import cv2  # pyright: ignore[reportMissingImports]: an extra

    opencv: Any = cv2  # whose stubs lack half of it
    sift = opencv.SIFT_create(nfeatures=FEATURES)
    found = np.zeros((2, count), dtype=np.int64)
    before: list[tuple[np.ndarray, np.ndarray]] = []
    for k, grey in enumerate(pictures):
        points, descriptors = sift.detectAndCompute(grey, None)
        now = (np.array([point.pt for point in points]), np.zeros((0, 128)) if descriptors is None else descriptors)
        for back, other in enumerate(reversed(before)):
            found[back, k - back - 1] = _inliers(opencv, other, now)
        before = [*before[-1:], now]
        progress(k + 1, count, "")
    return found


def _inliers(cv2: Any, one: tuple[np.ndarray, np.ndarray], two: tuple[np.ndarray, np.ndarray]) -> int:
    if min(len(one[1]), len(two[1])) < 8:
        return 0
    forward, backward = _ratio_tested(cv2, one[1], two[1]), _ratio_tested(cv2, two[1], one[1])
    good = [(i, j) for i, j in forward.items() if backward.get(j) == i]
    if len(good) < 8:
        return 0
    here, there = one[0][[i for i, _ in good]], two[0][[j for _, j in good]]
    try:
        _, mask = cv2.findFundamentalMat(here, there, cv2.USAC_MAGSAC, ERROR_PX, 0.999, 5000)
    except cv2.error:  # no model at all, as of points on one line
        return 0
    return 0 if mask is None else int(mask.sum())


def _ratio_tested(cv2: Any, one: np.ndarray, two: np.ndarray) -> dict[int, int]:
    pairs = cv2.BFMatcher().knnMatch(one, two, k=2)
    return {
        pair[0].queryIdx: pair[0].trainIdx
        for pair in pairs
        if len(pair) == 2 and pair[0].distance < RATIO * pair[1].distance
    }


def breaks(inliers: np.ndarray) -> np.ndarray:
    """Positions k, in capture order, after which no pair that matches leads on: not k, k + 1 nor one around them."""
    match = inliers >= ENOUGH
    gone = ~match[0, :-1] & ~match[1, :-1]
    gone[1:] &= ~match[1, :-2]
    return np.flatnonzero(gone)


def grey_pictures(paths: Iterable[Path]) -> Iterator[np.ndarray]:
    """(H, W) uint8 of image files, upright, at most LONGEST pixels a side. Raises UserError for one that is broken."""
    for path in paths:
        with open_image(path) as image:
            image.draft("L", (2 * LONGEST, 2 * LONGEST))
            small = upright(image).convert("L")
            small.thumbnail((LONGEST, LONGEST))
            yield np.asarray(small)
