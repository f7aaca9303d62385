"""Points of a plane sweep of the chosen views: sure depths, guesses beside them, and rays of views without any."""

from typing import Any

import numpy as np

from .._surroundings import Surroundings
from .._types import TrainingSet
from .start import FEWEST, Start

GUESSED = 0.25  # share of the sweep's points whose depth is guessed


def swept(
    data: TrainingSet, count: int, around: Surroundings, rng: np.random.Generator
) -> tuple[list[Start], dict[str, Any]]:
    """At most `count` points, none where the sweep found too little to go by; and what a `Seeding` says of the sweep.

    Pixels that are not sure start at the depth of the nearest that is, and views without any at depths found
    elsewhere.
    """
    from .depth_maps import depth_maps

    maps = depth_maps(data, around.depths, rng)
    sure, guessed = np.flatnonzero(maps.sure), np.flatnonzero(maps.guessed)
    found: dict[str, Any] = {"sweep_views": int(maps.sure.any(axis=(1, 2)).sum()), "sweep_depths": len(sure)}
    if len(sure) < FEWEST:
        said = f"the plane sweep was left out: {len(sure)} depths to believe are fewer than {FEWEST}"
        return [], {**found, "fallback": said}
    if count < 4:
        return [], found
    # Views without a sure depth are guessed at by depths of the others.
    alone = np.flatnonzero(
        np.broadcast_to(~(maps.sure | maps.guessed).any(axis=(1, 2), keepdims=True), maps.sure.shape)
    )
    fewer = min(len(sure), round((1 - GUESSED) * count))
    rest = min(count - fewer, len(guessed) + len(alone))
    by_ray = rng.binomial(rest, len(alone) / (len(guessed) + len(alone))) if rest else 0
    by_ray, by_guess = min(by_ray, len(alone)), min(rest - by_ray, len(guessed))
    starts = [Start(*maps.points(rng.choice(sure, fewer, replace=False)), "sweep")]
    if by_guess:
        starts.append(Start(*maps.points(rng.choice(guessed, by_guess, replace=False)), "guessed"))
    if by_ray:
        depths = maps.depth.ravel()[rng.choice(sure, by_ray)]
        starts.append(Start(*maps.points(rng.choice(alone, by_ray, replace=False), depths), "ray"))
    return starts, found
