"""Loops of the `coverage` selector, compiled when this module is imported (and cached on disk by numba).

Regions are the nodes of a grid (X, 3); Θ is POLAR × AZIMUTH bins of directions. What is seen is kept region by region:
region x is seen by the views `viewers[starts[x] : starts[x + 1]]` in the bins `bins[…]`, of which there are as many as
pairs (view, region) that see each other.
"""

import math

import numba
import numpy as np

POLAR, AZIMUTH = 5, 10
BINS = POLAR * AZIMUTH

_VIEW = "float64[::1], float64[:, ::1], float64[::1]"
_NODES = "float64[:, ::1]"


@numba.njit(f"int64({_NODES}, {_VIEW}, int64[::1], uint8[::1])", cache=True)
def observe(nodes, position, rotation, camera, seen, bins):
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
        seen[count] = x
        bins[count] = min(int(polar * POLAR), POLAR - 1) * AZIMUTH + min(int(azimuth * AZIMUTH), AZIMUTH - 1)
        count += 1
    return count


@numba.njit(
    f"Tuple((int64[::1], int32[::1], uint8[::1]))({_NODES}, float64[:, ::1], float64[:, :, ::1], float64[:, ::1])",
    cache=True,
)
def observers(nodes, positions, rotations, cameras):
    """starts (X + 1,), viewers and bins (pairs,) of all views."""
    seen = np.empty(len(nodes), np.int64)
    bins = np.empty(len(nodes), np.uint8)
    starts = np.zeros(len(nodes) + 1, np.int64)
    for view in range(len(positions)):
        for item in range(observe(nodes, positions[view], rotations[view], cameras[view], seen, bins)):
            starts[seen[item] + 1] += 1
    for x in range(len(nodes)):
        starts[x + 1] += starts[x]
    viewers = np.empty(starts[-1], np.int32)
    all_bins = np.empty(starts[-1], np.uint8)
    filled = starts[:-1].copy()
    for view in range(len(positions)):
        for item in range(observe(nodes, positions[view], rotations[view], cameras[view], seen, bins)):
            x = seen[item]
            viewers[filled[x]] = view
            all_bins[filled[x]] = bins[item]
            filled[x] += 1
    return starts, viewers, all_bins


@numba.njit("float64(float64[::1], float64)", cache=True)
def distance_to_uniform(mass, total):
    """Σ_y |p(y) − u|, twice the paper's total variation, for bin masses (BINS,): p = mass / total, u = 1 / BINS."""
    distance = 0.0
    for y in range(BINS):
        distance += abs(mass[y] / total - 1 / BINS)
    return distance


@numba.njit("void(float64[::1], float64, float64[::1], float64[::1], float64[::1])", cache=True)
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


@numba.njit(
    "void(int64[::1], uint8[::1], float64, float64[::1], int64[::1], float64[:, ::1], float64[::1], float64[:, ::1],"
    " int64[::1], int32[::1], uint8[::1], float64[::1], float64[::1])",
    cache=True,
)
def add(seen, seen_bins, lam, weight, counts, mass, present, gains, starts, viewers, bins, of_count, of_angle):
    """Adds a view that sees the regions `seen` in `seen_bins` and updates the gain of every other view.

    Per region: `counts` n (X,), `mass` of the bins (X, BINS), `present` 1 − TV (X,), `gains` of 1 − TV by bin
    (X, BINS). Per view: `of_count` Σ (n + 1)^λ − n^λ and `of_angle` Σ gains over the regions it sees.
    """
    before = np.empty(BINS)
    distances = np.empty(POLAR)
    for item in range(len(seen)):
        x, y = seen[item], seen_bins[item]
        n = counts[x]
        step = (n + 2) ** lam - 2 * (n + 1) ** lam + (n**lam if n else 0.0)
        before[:] = gains[x]
        counts[x] = n + 1
        mass[x, y] += weight[y]
        present[x] = 1 - distance_to_uniform(mass[x], mass[x].sum()) / 2
        angular_gains(mass[x], present[x], weight, distances, gains[x])
        for entry in range(starts[x], starts[x + 1]):
            of_count[viewers[entry]] += step
            of_angle[viewers[entry]] += gains[x, bins[entry]] - before[bins[entry]]
