"""Loops of the `coverage` selector.

Regions are the nodes of a grid (X, 3); Θ is POLAR × AZIMUTH bins of directions. Sums are made
in the order in which they are written.
"""

import math
from typing import NamedTuple

import numpy as np

from ..common.kernels import strict

POLAR, AZIMUTH = 5, 10
BINS = POLAR * AZIMUTH


class Seen(NamedTuple):
    """What one view sees."""

    regions: np.ndarray  # (X,) int64, or as many of them as it sees
    bins: np.ndarray  # (X,) uint8, of the direction to each

    @classmethod
    def room(cls, regions: int) -> "Seen":
        """For a view that sees all of so many regions."""
        return cls(np.empty(regions, np.int64), np.empty(regions, np.uint8))

    def first(self, count: int) -> "Seen":
        """The part that `observe` has written."""
        return Seen(self.regions[:count], self.bins[:count])


class Observers(NamedTuple):
    """Who sees what, region by region: x is seen by the views `viewers[starts[x] : starts[x + 1]]`."""

    starts: np.ndarray  # (X + 1,) int64
    viewers: np.ndarray  # (pairs,) int32, as many as pairs (view, region) that see each other
    bins: np.ndarray  # (pairs,) uint8, of the direction from the view to the region


class Regions(NamedTuple):
    """What is known of every region, given the views chosen so far."""

    counts: np.ndarray  # (X,) int64, n: how many of them see it
    mass: np.ndarray  # (X, BINS) float64, of its bins of directions
    present: np.ndarray  # (X,) float64, 1 − TV, 0 where nobody sees it
    gains: np.ndarray  # (X, BINS) float64, how much 1 − TV grows with a view in each bin

    @classmethod
    def unseen(cls, count: int) -> "Regions":
        """So many regions before the first choice."""
        gains = np.full((count, BINS), 1 / BINS)  # 1 − TV of a region seen once
        return cls(np.zeros(count, np.int64), np.zeros((count, BINS)), np.zeros(count), gains)


class Gains(NamedTuple):
    """What adding each of the N views would give, over the regions that it sees."""

    of_count: np.ndarray  # (N,) float64, Σ (n + 1)^λ − n^λ
    of_angle: np.ndarray  # (N,) float64, Σ of `Regions.gains`

    @classmethod
    def at_first(cls, observers: Observers, views: int) -> "Gains":
        """Before the first choice."""
        of_count = np.bincount(observers.viewers, minlength=views).astype(np.float64)  # 1^λ − 0^λ for each region
        return cls(of_count, of_count / BINS)


@strict
def observe(nodes, position, rotation, camera, seen):
    """Writes the regions that a view sees and the bin of each one's direction; returns how many they are.

    A region is seen when its centre is in front of the camera and inside the image. `camera` is fx, fy, cx, cy, width,
    height; axes are OpenGL's.
    """
    fx, fy, cx, cy, width, height = camera
    count = 0
    for x in range(len(nodes)):
        dx, dy, dz = nodes[x, 0] - position[0], nodes[x, 1] - position[1], nodes[x, 2] - position[2]
        ahead = -(rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz)
        if ahead <= 0:
            continue
        right = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
        u = fx * right / ahead + cx
        if u < 0 or u >= width:
            continue
        up = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
        v = cy - fy * up / ahead
        if v < 0 or v >= height:
            continue
        cosine = dz / math.sqrt(dx * dx + dy * dy + dz * dz)
        polar = math.acos(max(-1.0, min(1.0, cosine))) / math.pi
        azimuth = (math.atan2(dy, dx) + math.pi) / (2 * math.pi)
        seen.regions[count] = x
        seen.bins[count] = min(int(polar * POLAR), POLAR - 1) * AZIMUTH + min(int(azimuth * AZIMUTH), AZIMUTH - 1)
        count += 1
    return count


@strict
def observers(nodes, positions, rotations, cameras):
    """The Observers among all views: positions (N, 3), rotations (N, 3, 3), cameras (N, 6)."""
    seen = Seen(np.empty(len(nodes), np.int64), np.empty(len(nodes), np.uint8))
    starts = np.zeros(len(nodes) + 1, np.int64)
    for view in range(len(positions)):
        for item in range(observe(nodes, positions[view], rotations[view], cameras[view], seen)):
            starts[seen.regions[item] + 1] += 1
    for x in range(len(nodes)):
        starts[x + 1] += starts[x]
    viewers = np.empty(starts[-1], np.int32)
    bins = np.empty(starts[-1], np.uint8)
    filled = starts[:-1].copy()
    for view in range(len(positions)):
        for item in range(observe(nodes, positions[view], rotations[view], cameras[view], seen)):
            x = seen.regions[item]
            viewers[filled[x]] = view
            bins[filled[x]] = seen.bins[item]
            filled[x] += 1
    return Observers(starts, viewers, bins)


@strict
def distance_to_uniform(mass, total):
    """Σ_y |p(y) − u|, twice the paper's total variation, for bin masses (BINS,): p = mass / total, u = 1 / BINS."""
    distance = 0.0
    for y in range(BINS):
        distance += abs(mass[y] / total - 1 / BINS)
    return distance


@strict
def angular_gains(mass, present, weight, distances, gains):
    """For every bin y, how much 1 − TV of a region grows when a view is added in y; `weight` is 1 / bin area.

    The total changes with the weight of y, which is one of POLAR values: the sum over bins is made once for each.
    """
    total = mass.sum()
    for ring in range(POLAR):
        distances[ring] = distance_to_uniform(mass, total + weight[ring * AZIMUTH])
    for y in range(BINS):
        grown = total + weight[y]
        distance = distances[y // AZIMUTH]
        distance += abs((mass[y] + weight[y]) / grown - 1 / BINS) - abs(mass[y] / grown - 1 / BINS)
        gains[y] = 1 - distance / 2 - present


@strict
def add(seen, lam, weight, regions, observers, gains):
    """Adds a view to those chosen: brings regions up to date, and the gains of all views that see one of them.

    `weight` (BINS,) is 1 / bin area, `lam` the function's λ.
    """
    counts, mass, present, table = regions
    before = np.empty(BINS)
    distances = np.empty(POLAR)
    for item in range(len(seen.regions)):
        x, y = seen.regions[item], seen.bins[item]
        n = counts[x]
        step = (n + 2) ** lam - 2 * (n + 1) ** lam + (n**lam if n else 0.0)
        before[:] = table[x]
        counts[x] = n + 1
        mass[x, y] += weight[y]
        present[x] = 1 - distance_to_uniform(mass[x], mass[x].sum()) / 2
        angular_gains(mass[x], present[x], weight, distances, table[x])
        for entry in range(observers.starts[x], observers.starts[x + 1]):
            view, bin_ = observers.viewers[entry], observers.bins[entry]
            gains.of_count[view] += step
            gains.of_angle[view] += table[x, bin_] - before[bin_]


def warm() -> None:
    """Compiles or loads every kernel: one view, one region."""
    nodes, position, rotation, camera = np.zeros((1, 3)), np.zeros(3), np.eye(3), np.ones(6)
    seen = Seen.room(1)
    count = observe(nodes, position, rotation, camera, seen)
    everyone = observers(nodes, position[None], rotation[None], camera[None])
    add(seen.first(count), 0.05, np.ones(BINS), Regions.unseen(1), everyone, Gains.at_first(everyone, 1))
