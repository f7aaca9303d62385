"""The selectors as the paper writes them, slow and obvious: what the fast ones must equal."""

import itertools
import math

import numpy as np

from tests.conftest import known
from viewbench.selectors._types import Views

TIE = 1e-9  # `coverage` takes gains that differ by less for equal


def random_views(rng, n=40, dims=12, intrinsics=True):
    """Views at random places in [-4, 4] looking anywhere."""
    quaternions = rng.normal(size=(n, 4))
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rotations = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    positions = rng.uniform(-4, 4, size=(n, 3)) * [1, 1, rng.uniform(0.1, 1)]
    features = rng.normal(size=(n, dims)).astype(np.float32) if dims else None
    if features is not None:
        features /= np.linalg.norm(features, axis=1, keepdims=True)
    cameras = np.tile([50.0, 55.0, 31.0, 24.5, 64.0, 48.0], (n, 1)) if intrinsics else None
    return Views(positions, np.ascontiguousarray(rotations), features, cameras)


def matrix(views, alpha=0.7, beta=0.2, sigma=0.5, factors=("pos", "ang", "sem")):
    """M of the “Distance Measures” entry by entry, with the weights of the factors in use divided by their sum."""
    weights = {"pos": alpha, "ang": beta, "sem": 1 - alpha - beta}
    if views.features is None:
        factors = [name for name in factors if name != "sem"]
    total = sum(weights[name] for name in factors)
    m = np.zeros((len(views), len(views)))
    for i, j in itertools.product(range(len(views)), repeat=2):
        if "pos" in factors:
            squared = ((views.positions[i] - views.positions[j]) ** 2).sum()
            m[i, j] += weights["pos"] / total * math.exp(-squared / (2 * sigma**2))
        if "ang" in factors:
            m[i, j] += weights["ang"] / total * (np.trace(views.rotations[i].T @ views.rotations[j]) + 1) / 4
        if "sem" in factors:
            p, q = (known(views.features)[k].astype(float) for k in (i, j))
            m[i, j] += weights["sem"] / total * (p @ q) / (np.linalg.norm(p) * np.linalg.norm(q))
    return m


def greedy(gain, n, count, start=None):
    """Picks the view of largest gain(S, k) again and again; `start` is the first one where it is given."""
    chosen, gains = [], []
    for _ in range(count):
        if not chosen and start is not None:
            best = start
        else:
            best = max((k for k in range(n) if k not in chosen), key=lambda k: (gain(chosen, k), -k))
        gains.append(gain(chosen, best))
        chosen.append(best)
    return chosen, gains


def maxmin(m, count, start):
    """Max-Min Distance Function; the first gain, a minimum over nothing, is 1."""
    return greedy(lambda s, k: min((1 - m[i, k] for i in s), default=1.0), len(m), count, start)


def logdet(m, count, start, regularise=0.0):
    """log det M_{S ∪ k} − log det M_S, or the same of I + M / λ."""

    def value(s):
        part = m[np.ix_(s, s)]
        return np.linalg.slogdet(np.eye(len(s)) + part / regularise if regularise else part)[1] if s else 0.0

    return greedy(lambda s, k: value([*s, k]) - value(s), len(m), count, start)


def farthest(distance, count, start):
    """Farthest-first traversal; the first gain is the largest distance to the start."""
    return greedy(lambda s, k: min((distance[i, k] for i in s), default=distance[k].max()), len(distance), count, start)


def coverage(views, count, lam=0.05, spacing=0.5, polar=5, azimuth=10):
    """Uniform Coverage Function: its gain summed anew over all regions and bins for every candidate."""
    nodes = _grid(views.positions, spacing)
    edges = np.cos(np.linspace(0, np.pi, polar + 1))
    weight = np.repeat(1 / ((edges[:-1] - edges[1:]) * 2 * np.pi / azimuth), azimuth)
    sees = [_observe(views, k, nodes, polar, azimuth) for k in range(len(views))]

    def gain(s, k):
        counts = np.zeros((len(nodes), polar * azimuth))
        for view in [*s, k]:
            seen, bins = sees[view]
            counts[seen, bins] += 1
        n = counts.sum(axis=1)
        seen = n > 0
        mass = counts[seen] * weight
        p = mass / mass.sum(axis=1, keepdims=True)
        variation = np.abs(p - 1 / (polar * azimuth)).sum(axis=1) / 2
        return ((n[seen] / (len(s) + 1)) ** lam).sum() + (1 - variation).sum()

    chosen, gains = [], []
    for _ in range(count):
        values = [-np.inf if k in chosen else gain(chosen, k) for k in range(len(views))]
        best = next(k for k, value in enumerate(values) if value >= max(values) - TIE)
        chosen.append(best)
        gains.append(values[best])
    return chosen, gains


def _grid(positions, spacing):
    axes = []
    for values in positions.T:
        low, high = values.min(), values.max()
        low, high = low - 0.2 * (high - low), high + 0.2 * (values.max() - values.min())
        axes.append(np.linspace(low, high, max(2, round((high - low) / spacing))))
    return np.array(list(itertools.product(*axes)))


def _observe(views, k, nodes, polar, azimuth):
    fx, fy, cx, cy, width, height = views.intrinsics[k]
    seen, bins = [], []
    for x, node in enumerate(nodes):
        away = node - views.positions[k]
        right, up, back = views.rotations[k].T @ away
        if back >= 0:
            continue
        u, v = cx + fx * right / -back, cy - fy * up / -back
        if 0 <= u < width and 0 <= v < height:
            theta = math.acos(away[2] / np.linalg.norm(away))
            phi = math.atan2(away[1], away[0]) + math.pi
            row = min(int(theta / math.pi * polar), polar - 1)
            column = min(int(phi / (2 * math.pi) * azimuth), azimuth - 1)
            seen.append(x)
            bins.append(row * azimuth + column)
    return np.array(seen, dtype=int), np.array(bins, dtype=int)


def kdpp(m, count):
    """{sorted set: probability} of the k-DPP by counting all sets."""
    determinants = {s: np.linalg.det(m[np.ix_(s, s)]) for s in itertools.combinations(range(len(m)), count)}
    total = sum(determinants.values())
    return {s: value / total for s, value in determinants.items()}
