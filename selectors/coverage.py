"""Views that together see every region from every side: the paper's Uniform Coverage Function z_CF.

The measure is that of Kopanas and Drettakis (2023). What the paper leaves open follows its authors' own code: regions
are the nodes of a grid 0.5 apart (positions in [-4, 4]) over the cameras' bounding box grown by 20 % on each side;
directions fall in 5 × 10 bins (polar × azimuth) that count by one over their area; λ = 0.05; a region that nobody sees
has no angular term. Nothing is random.
"""

import time

import numpy as np

from ..common import extras  # no source: it says what to install
from ..common.errors import UserError
from ._types import Choice, Views

SEEDED = False
GREEDY = True
FACTORS = ()
PARAMETERS = {"lam": 0.05, "spacing": 0.5}
GROWTH = 0.2  # of the bounding box, on each side
TIE = 1e-9  # gains that differ by less are the same: many views see equally many regions, but for rounding


def available() -> str | None:
    """Why it cannot run here, or None."""
    return extras.missing("numba")


def warm() -> None:
    """Compiles the kernels into numba's cache; a second call takes a fraction of a second."""
    from . import _coverage_kernels as kernels

    kernels.warm()


def select(views: Views, count: int, rng: np.random.Generator, lam: float = 0.05, spacing: float = 0.5) -> Choice:
    """Greedy by the gain that the Uniform Coverage Function defines, ties to the earlier frame.

    The next view k maximises Σ_x c(x)^λ + (1 − TV(x)) over S ∪ {k}, with

    c(x) = n(x) / |S ∪ {k}|, so the first sum is |S ∪ {k}|^−λ Σ_x n(x)^λ. Adding k changes n and TV only in the regions
    that k sees; the change by region and bin is kept in a table, and the gain of every view as its sum over what it
    sees. After a pick only the regions that it sees, and the views that see those, are brought up to date.
    O(X + pairs) memory for X regions and the pairs (view, region) that see each other.

    Raises UserError without intrinsics and for a λ or a spacing that is not positive.
    """
    from . import _coverage_kernels as kernels

    if views.intrinsics is None:
        raise UserError("'coverage' needs the cameras' intrinsics to know what they see; use another selector")
    if not (lam > 0 and spacing > 0):
        raise UserError(f"lam = {lam} and spacing = {spacing} must be positive")
    kernels.warm()  # which is no part of choosing
    begin = time.perf_counter()
    nodes = regions(views.positions, spacing)
    positions, rotations, cameras = map(np.ascontiguousarray, (views.positions, views.rotations, views.intrinsics))
    observers = kernels.observers(nodes, positions, rotations, cameras)
    prepared = time.perf_counter()

    lam, weight = float(lam), bin_weights(kernels.POLAR, kernels.AZIMUTH)
    state, gain = kernels.Regions.unseen(len(nodes)), kernels.Gains.at_first(observers, len(views))
    gone = np.zeros(len(views))
    seen = kernels.Seen.room(len(nodes))
    chosen = np.empty(count, dtype=np.int64)
    gains = np.empty(count)
    for k in range(count):
        of_count = (state.counts[state.counts > 0] ** lam).sum() + gain.of_count
        total = (k + 1) ** -lam * of_count + state.present.sum() + gain.of_angle + gone
        pick = int(views.kept[k]) if k < len(views.kept) else int((total >= total.max() - TIE).argmax())
        chosen[k], gains[k], gone[pick] = pick, total[pick], -np.inf
        size = kernels.observe(nodes, positions[pick], rotations[pick], cameras[pick], seen)
        kernels.add(seen.first(size), lam, weight, state, observers, gain)
    seconds = {"similarity": prepared - begin, "select": time.perf_counter() - prepared}
    return Choice(chosen, gains, seconds, {"regions": len(nodes)})


def regions(positions: np.ndarray, spacing: float = 0.5) -> np.ndarray:
    """(X, 3) centres of Ω: max(2, round(extent / spacing)) nodes an axis over the cameras' grown bounding box."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    margin = GROWTH * (high - low)
    axes = [
        np.linspace(a, b, max(2, round((b - a) / spacing))) for a, b in zip(low - margin, high + margin, strict=True)
    ]
    return np.ascontiguousarray(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))


def bin_weights(polar: int, azimuth: int) -> np.ndarray:
    """(polar · azimuth,) one over the solid angle of each bin of directions, polar by polar."""
    rings = -np.diff(np.cos(np.linspace(0, np.pi, polar + 1))) * 2 * np.pi / azimuth
    return np.repeat(1 / rings, azimuth)
