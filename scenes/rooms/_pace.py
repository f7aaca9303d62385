"""How fast a camera moves and turns: percentiles to put generated paths beside those of real hands."""

from collections.abc import Mapping

import numpy as np

PERCENTILES = (5, 25, 50, 75, 95, 100)
STEP_S = 0.1  # over which motion is taken: jitter at a motion capture's 100 Hz is its noise


def spaced(times: np.ndarray) -> list[int]:
    """Of (N,) rising seconds the first, and then each that is STEP_S or more after the one before."""
    kept = [0]
    for i, time in enumerate(times):
        if time - times[kept[-1]] >= STEP_S - 1e-6:
            kept.append(i)
    return kept


def pace(times: np.ndarray, c2w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Percentiles of speed in metres a second and of turn rate in degrees a second.

    (N,) rising seconds and (N, 4, 4) poses, of which those are taken that are STEP_S or more apart. NaN for fewer than
    two.
    """
    kept = spaced(times)
    times, c2w = times[kept], c2w[kept]
    if len(times) < 2:
        return np.full(len(PERCENTILES), np.nan), np.full(len(PERCENTILES), np.nan)
    seconds = np.diff(times)
    speed = np.linalg.norm(np.diff(c2w[:, :3, 3], axis=0), axis=1) / seconds
    between = np.einsum("nji,njk->nik", c2w[:-1, :3, :3], c2w[1:, :3, :3])
    cosine = (np.trace(between, axis1=1, axis2=2) - 1) / 2
    turn = np.degrees(np.arccos(np.clip(cosine, -1, 1))) / seconds
    return np.percentile(speed, PERCENTILES), np.percentile(turn, PERCENTILES)


def table(paths: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> list[str]:
    """Lines of text: for each (times, poses) its percentiles."""
    width = max(len(name) for name in paths)
    heads = "".join(f"{f'{p} %' if p < 100 else 'most':>8}" for p in PERCENTILES)
    lines = [f"{'':{width}}  {'':6}{heads}"]
    for name, (times, c2w) in paths.items():
        speed, turn = pace(times, c2w)
        lines.append(f"{name:{width}}  {'m/s':6}" + "".join(f"{value:8.2f}" for value in speed))
        lines.append(f"{'':{width}}  {'deg/s':6}" + "".join(f"{value:8.1f}" for value in turn))
    return lines
