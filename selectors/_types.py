"""What a selector is given and what it gives back.

A selector is one module of this folder: its docstring's first line is its summary, `SEEDED` says whether the seed
changes the result, `GREEDY` (False where it is left out) whether the views of a smaller count are the first of those of
a larger one, so that one run serves every ratio, `FACTORS` names the factors of the similarity it uses ("pos", "ang",
"sem"), `PARAMETERS` holds its parameters with their defaults, and

    select(views: Views, count: int, rng: numpy.random.Generator, **parameters) -> Choice

chooses. It may raise UserError. Everything else (normalisation, features, the count) is decided before it is called.
A greedy one whose `select` takes `within` stops by itself once every view left is so near to a chosen one, by
1 − M, and says under `uncovered` in its notes how near (as `maxmin` does). The others are asked for larger and larger
counts until that is so.

A selector that compiles something may have

    warm() -> None

which does so, into a cache: a study calls it once before several jobs choose by it.

One that needs more than is always installed says by `available() -> str | None` why it cannot run here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

FACTORS = ("pos", "ang", "sem")  # Dist3D, Ang3D and DistSem of the paper's “Distance Measures”, in this order


@dataclass(frozen=True)
class Views:
    """The N training views as selection sees them."""

    positions: np.ndarray  # (N, 3) float64, scaled to [-4, 4]
    rotations: np.ndarray  # (N, 3, 3) float64, camera-to-world
    features: np.ndarray | None = None  # (N, D) float32 rows of length 1
    intrinsics: np.ndarray | None = None  # (N, 6) float64: fx, fy, cx, cy, width, height in pixels
    times: np.ndarray | None = None  # (N,) float64 seconds
    sharpness: np.ndarray | None = None  # (N,) float64, larger is sharper
    kept: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))  # (J,) views to be chosen first, in order

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True)
class Choice:
    """K chosen views in the order chosen."""

    indices: np.ndarray  # (K,) int64, distinct, into the training views
    gains: np.ndarray | None = None  # (K,) float64 marginal gain of each pick; None where the selector has none
    seconds: Mapping[str, float] = field(default_factory=dict)  # {"similarity": ...} where it was timed apart
    notes: Mapping[str, Any] = field(default_factory=dict)  # what a reader of the result must know, as JSON
