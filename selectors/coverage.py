"""Regions of the room covered often and from all sides (the paper's z_CF, after Kopanas and Drettakis 2023)."""

import numpy as np

from viewbench.common.errors import UserError
from viewbench.selectors._types import Choice, Views

SEEDED = False
FACTORS = ()
PARAMETERS = {"step": 0.5, "margin": 0.2, "lam": 0.05}
POLAR, AZIMUTH = 5, 10


def select(
    views: Views, count: int, rng: np.random.Generator, step: float = 0.5, margin: float = 0.2, lam: float = 0.05
) -> Choice:
    """Greedy argmax of Σₓ c(x)^λ + (1 − TV(x)) after adding the view (paper, Eqs. 6–8), ties to the lower index.

    Regions are the nodes of a grid about `step` apart over the cameras' bounding box grown by `margin` on each side;
    a view covers those in front of it and inside its image. c is the share of the chosen views that cover a region,
    TV the total variation between the directions it was seen from, in 5 × 10 bins weighted by 1 / area, and uniform;
    a region that was never seen counts 0. There is no randomness.
    """
    if views.intrinsics is None:
        raise UserError("coverage needs the cameras' intrinsics, which this capture does not have")
    if not (step > 0 and margin >= 0 and lam > 0):
        raise UserError(f"coverage: step {step} and lam {lam} must be positive, margin {margin} not negative")
    seen = _visible_bins(views, _regions(views.positions, step, margin))
    weight = 1 / _bin_areas()
    n, n_regions = seen.shape
    covered = seen >= 0
    views_of = covered.astype(np.int64)
    counts = np.zeros(n_regions)
    histogram = np.zeros((n_regions, POLAR * AZIMUTH))
    free = np.ones(n, dtype=bool)
    indices, gains = np.empty(count, dtype=np.int64), np.empty(count)
    for rank in range(count):
        size = rank + 1
        # A region's term depends only on whether the new view covers it, and through which bin.
        without = (counts / size) ** lam * (counts > 0) + _uniformity(histogram, weight)
        gain_if = np.empty((n_regions, POLAR * AZIMUTH))
        for b in range(POLAR * AZIMUTH):
            histogram[:, b] += 1
            gain_if[:, b] = ((counts + 1) / size) ** lam + _uniformity(histogram, weight)
            histogram[:, b] -= 1
        change = gain_if - without[:, None]
        picked = np.where(covered, change[np.arange(n_regions), np.maximum(seen, 0)], 0.0)
        utility = without.sum() + picked.sum(axis=1)
        pick = int(np.argmax(np.where(free, utility, -np.inf)))
        indices[rank], gains[rank] = pick, utility[pick]
        free[pick] = False
        hit = np.flatnonzero(covered[pick])
        counts += views_of[pick]
        histogram[hit, seen[pick, hit]] += 1
    return Choice(indices, gains)


def _regions(positions: np.ndarray, step: float, margin: float) -> np.ndarray:
    """(X, 3) nodes: per axis max(2, round(extent / step)) of them, both ends included."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    grown = margin * (high - low)
    low, high = low - grown, high + grown
    numbers = np.maximum(2, np.round((high - low) / step)).astype(int)
    axes = [np.linspace(low[a], high[a], numbers[a]) for a in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _bin_areas() -> np.ndarray:
    """(50,) solid angle of each direction bin, polar × azimuth."""
    edges = np.linspace(0, np.pi, POLAR + 1)
    band = np.cos(edges[:-1]) - np.cos(edges[1:])
    return np.repeat(band * 2 * np.pi / AZIMUTH, AZIMUTH)


def _visible_bins(views: Views, regions: np.ndarray) -> np.ndarray:
    """(N, X) direction bin through which each view sees each region, −1 where it does not."""
    bins = np.full((len(views), len(regions)), -1, dtype=np.int16)
    assert views.intrinsics is not None
    for i, (fx, fy, cx, cy, width, height) in enumerate(views.intrinsics):
        ray = regions - views.positions[i]
        x, y, z = (ray @ views.rotations[i]).T
        depth = np.where(z < 0, -z, 1.0)
        u, v = fx * x / depth + cx, -fy * y / depth + cy
        inside = (z < -1e-9) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        direction = ray[inside] / np.linalg.norm(ray[inside], axis=1, keepdims=True)
        polar = np.arccos(np.clip(direction[:, 2], -1, 1)) / np.pi * POLAR
        azimuth = (np.arctan2(direction[:, 1], direction[:, 0]) / (2 * np.pi) % 1) * AZIMUTH
        row = np.minimum(polar.astype(int), POLAR - 1) * AZIMUTH + np.minimum(azimuth.astype(int), AZIMUTH - 1)
        bins[i, inside] = row
    return bins


def _uniformity(histogram: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(X,) 1 − TV between each region's weighted directions and uniform; 0 where it was never seen."""
    density = histogram * weight
    total = density.sum(axis=1, keepdims=True)
    share = density / np.where(total > 0, total, 1)
    flat = 1 / len(weight)
    return np.where(total[:, 0] > 0, 1 - 0.5 * np.abs(share - flat).sum(axis=1), 0.0)
