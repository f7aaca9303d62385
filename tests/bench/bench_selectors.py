"""Times the selectors, beside the paper's own definitions run in the same process on the same views.

    python tests/bench/bench_selectors.py [--quick]

The slow versions are written from the paper: z_DF as three nested Python loops over the dense matrix M, z_CF summed
anew over all regions and direction bins for each candidate, z_DPP by the determinant of each candidate set. Where the
whole of one would take hours, part of it is timed and the column "slow by" says from which the total was computed.
Timings mean something on a quiet machine with one thread a process (OMP_NUM_THREADS=1, as `make bench` sets it).
Scale is measured in processes of their own, whose peak memory includes Python, the views and their features.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from viewbench.common import plugins
from viewbench.selectors._normalise import normalise
from viewbench.selectors._similarity import similarity
from viewbench.selectors._types import Choice, Views

OPENPLAN = (3212, 1152)  # N of the paper's openplan-1, and the dimensions of its features
REPEATS = 3
HEADER = ("what", "N", "K", "D", "seconds", "limit", "slow", "ratio", "limit", "GB", "limit", "slow by")


def walk(n: int, dims: int, seed: int = 0) -> Views:
    """A camera carried through a room: smooth path and turns, features that follow both with some noise."""
    rng = np.random.default_rng(seed)
    path = _smooth(rng, n, 3, 60) * [1, 1, 0.3]
    yaw, pitch = 3 * _smooth(rng, n, 1, 200)[:, 0], 0.3 * _smooth(rng, n, 1, 200)[:, 0]
    return _views(rng, path, yaw, pitch, dims)


def scatter(n: int, dims: int, seed: int = 0) -> Views:
    """Cameras all over a flat room, turned anyhow: no path to profit from."""
    rng = np.random.default_rng(seed)
    return _views(
        rng, rng.uniform(-1, 1, (n, 3)) * [1, 1, 0.3], rng.uniform(-np.pi, np.pi, n), rng.normal(size=n), dims
    )


def _smooth(rng: np.random.Generator, n: int, dims: int, waves: int) -> np.ndarray:
    """(n, dims) sums of sines, slower ones larger."""
    t = np.linspace(0, 2 * np.pi, n)[:, None]
    total = np.zeros((n, dims))
    for wave in range(1, waves + 1):
        total += rng.normal(size=dims) / wave**0.5 * np.sin(wave * t + rng.uniform(0, 2 * np.pi, dims))
    return total


def _views(rng: np.random.Generator, places: np.ndarray, yaw: np.ndarray, pitch: np.ndarray, dims: int) -> Views:
    n = len(places)
    c, s, cp, sp, o = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.zeros(n)
    rotations = np.stack([c, -s * sp, s * cp, o, cp, sp, -s, -c * sp, c * cp], axis=1).reshape(n, 3, 3)
    features = None
    if dims:
        scene = np.concatenate([places, np.stack([c, s, np.cos(2 * yaw), np.sin(2 * yaw), 2 + o], axis=1)], axis=1)
        mixing = rng.normal(size=(scene.shape[1], dims))
        features = np.empty((n, dims), dtype=np.float32)
        for part in np.array_split(np.arange(n), max(1, n // 2000)):
            noise = rng.normal(size=(len(part), dims))
            features[part] = np.maximum(scene[part] @ mixing + 0.3 * noise, 0)
            features[part] /= np.linalg.norm(features[part], axis=1, keepdims=True)
    intrinsics = np.tile([200.0, 200.0, 128.0, 96.0, 256.0, 192.0], (n, 1))
    return Views(normalise(places), rotations, features, intrinsics)


SCENES = {"walk": walk, "scatter": scatter}


def timed(views: Views, selector: str, count: int, repeats: int, **options: object) -> tuple[float, Choice]:
    """Median seconds of the selection, similarity included, and its result; the first, which compiles, is left out."""
    plugin = plugins.load("selectors", selector)
    seconds = []
    for _ in range(repeats + 1):
        begin = time.perf_counter()
        choice = plugin.select(views, count, np.random.default_rng(0), **options)
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds[1:])), choice


def slow_maxmin(views: Views, count: int, choice: Choice) -> tuple[float, str]:
    """z_DF as published: for each pick, for each candidate, for each chosen view."""
    begin = time.perf_counter()
    m = similarity(views).columns(np.arange(len(views))).tolist()
    chosen = [int(choice.indices[0])]
    rest = set(range(len(views))) - set(chosen)
    while len(chosen) < count:
        best, farthest = -1, -1.0
        for k in sorted(rest):
            row, nearest = m[k], 2.0
            for i in chosen:
                distance = 1 - row[i]
                if distance < nearest:
                    nearest = distance
            if nearest > farthest:
                best, farthest = k, nearest
        chosen.append(best)
        rest.remove(best)
    seconds = time.perf_counter() - begin
    assert chosen == choice.indices.tolist(), "the published algorithm chooses otherwise"
    return seconds, "all picks"


def slow_logdet(views: Views, count: int, choice: Choice) -> tuple[float, str]:
    """Greedy z_DPP by the definition: det M_{S ∪ k} of every candidate k, timed for 20 of them at nine sizes of S."""
    m = similarity(views).columns(np.arange(len(views)))
    sizes = np.linspace(0, count - 1, 9).astype(int)
    per_pick = []
    for size in sizes:
        chosen = choice.indices[:size]
        rest = np.setdiff1d(np.arange(len(views)), chosen)[:20]
        begin = time.perf_counter()
        for k in rest:
            some = np.append(chosen, k)
            np.linalg.slogdet(m[np.ix_(some, some)])
        per_pick.append((time.perf_counter() - begin) / len(rest) * (len(views) - size))
    return float(np.interp(np.arange(count), sizes, per_pick).sum()), "20 candidates at 9 of the picks"


def slow_coverage(views: Views, count: int, choice: Choice) -> tuple[float, str]:
    """z_CF by the definition: Eq. 5 over all regions and bins for every candidate, at three picks."""
    from viewbench.selectors import _coverage_kernels as kernels
    from viewbench.selectors import coverage

    nodes = coverage.regions(views.positions)
    weight = coverage.bin_weights(kernels.POLAR, kernels.AZIMUTH)
    seen = kernels.Seen.room(len(nodes))
    assert views.intrinsics is not None
    assert choice.gains is not None
    observed = []
    for place, rotation, camera in zip(views.positions, views.rotations, views.intrinsics, strict=True):
        size = kernels.observe(nodes, place, rotation, camera, seen)
        observed.append((seen.regions[:size].copy(), seen.bins[:size].copy()))
    picks = [0, count // 2, count - 1]
    seconds = 0.0
    for pick in picks:
        counts = np.zeros((len(nodes), kernels.BINS))
        for i in choice.indices[:pick]:
            counts[observed[i]] += 1
        begin = time.perf_counter()
        gains = np.full(len(views), -np.inf)
        for k in np.setdiff1d(np.arange(len(views)), choice.indices[:pick]):
            counts[observed[k]] += 1
            n = counts.sum(axis=1)
            mass = counts * weight
            with np.errstate(invalid="ignore"):
                p = mass / mass.sum(axis=1, keepdims=True)
            variation = np.abs(p - 1 / kernels.BINS).sum(axis=1) / 2
            gains[k] = ((n / (pick + 1)) ** 0.05).sum() + np.where(n > 0, 1 - variation, 0).sum()
            counts[observed[k]] -= 1
        seconds += time.perf_counter() - begin
        assert abs(gains.max() - choice.gains[pick]) < 1e-6, "the published algorithm chooses otherwise"
    return seconds / len(picks) * count, f"{len(picks)} of the picks"


def scale(kind: str, selector: str, n: int, count: int, dims: int) -> dict[str, float]:
    """One selection in a process of its own: {"seconds", "peak_rss_bytes"}."""
    command = [sys.executable, str(Path(__file__).resolve()), "--one", kind, selector, str(n), str(count), str(dims)]
    return json.loads(subprocess.check_output(command, text=True))


def one(kind: str, selector: str, n: int, count: int, dims: int) -> None:
    """What `scale` runs."""
    views = SCENES[kind](n, dims)
    begin = time.perf_counter()
    plugins.load("selectors", selector).select(views, count, np.random.default_rng(0))
    seconds = time.perf_counter() - begin
    print(json.dumps({"seconds": seconds, "peak_rss_bytes": peak_rss_bytes()}))


def peak_rss_bytes() -> int:
    """Peak memory of this process alone; Linux's ru_maxrss starts from that of the process which started it."""
    status = Path("/proc/self/status")
    if status.is_file():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def help_seconds() -> float:
    """Median wall time of `viewbench select --help`."""
    seconds = []
    for _ in range(5):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "viewbench", "select", "--help"], check=True, capture_output=True)
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def show(*cells: object) -> None:
    """One row of the table, short rows filled with blanks."""
    widths = (22, 8, 6, 5, 8, 6, 8, 7, 6, 5, 5, 0)
    cells += ("",) * (len(widths) - len(cells))
    texts = [f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in cells]
    print(
        "  ".join(
            f"{text:{'<' if i in (0, 11) else '>'}{w}}" for i, (text, w) in enumerate(zip(texts, widths, strict=True))
        ).rstrip()
    )
    sys.stdout.flush()


def main(quick: bool) -> None:
    """Prints the table; `quick` takes smaller scenes, to which the limits do not apply."""
    n, dims = (OPENPLAN[0] // 4, OPENPLAN[1]) if quick else OPENPLAN
    fifth, few = round(0.2 * n), 40 if quick else 160
    show(*HEADER)
    views = walk(n, dims)
    plans: list[tuple[str, int, dict, float, Callable | None]] = [
        ("maxmin", fifth, {}, 0.3, slow_maxmin),
        ("logdet", fifth, {}, 2.0, slow_logdet),
        ("coverage", few, {}, 0.5, slow_coverage),
        ("logdet", n, {}, np.inf, None),
        ("facility", fifth, {}, np.inf, None),
        ("kcenter", fifth, {}, np.inf, None),
        ("uniform", fifth, {}, np.inf, None),
        ("random", fifth, {}, np.inf, None),
    ]
    for selector, count, options, limit, slow in plans:
        seconds, choice = timed(views, selector, count, 1 if count == n else REPEATS, **options)
        row = [selector, n, count, dims, seconds, "" if quick or limit == np.inf else limit]
        if slow is not None:
            slow_s, by = slow(views, count, choice)
            row += [slow_s, slow_s / seconds, "" if quick else 300, "", "", by]
        show(*row)
    largest = [(100_000, 5_000, dims, 60.0, 1.5), (1_000_000, 10_000, 0, 300.0, 2.0)]
    for size, count, d, limit, gigabytes in [(10_000, 500, dims, 60.0, 1.5)] if quick else largest:
        for kind in SCENES:
            found = scale(kind, "maxmin", size, count, d)
            peak = found["peak_rss_bytes"] / 1e9
            show(f"maxmin, {kind}", size, count, d, found["seconds"], limit, "", "", "", peak, gigabytes)
    show("select --help", "", "", "", help_seconds(), 0.3)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n", 1)[0])
    parser.add_argument("--quick", action="store_true", help="smaller scenes, under a minute")
    parser.add_argument("--one", nargs=5, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        one(given.one[0], given.one[1], *map(int, given.one[2:]))
    else:
        main(given.quick)
