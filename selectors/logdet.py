"""Views whose similarities have the largest determinant: the paper's Log Determinant Function z_DPP."""

import time

import numpy as np

from ..common.errors import UserError
from . import _kdpp
from ._cholesky import Residuals
from ._nearest import Nearest
from ._sharpness import Preference
from ._similarity import Similarity, describe, similarity
from ._types import Choice, Views

SEEDED = True
GREEDY = True
FACTORS = ("pos", "ang", "sem")
PARAMETERS = {
    "alpha": 0.7,
    "beta": 0.2,
    "sigma": 0.5,
    "factors": ["pos", "ang", "sem"],
    "regularise": 0.0,
    "sample": False,
    "sharpness": 0.0,
}
MOST_TO_SAMPLE = 20_000  # views: a k-DPP looks at all eigenvectors of M, up to 3.2 GB of them


def select(
    views: Views,
    count: int,
    rng: np.random.Generator,
    alpha: float = 0.7,
    beta: float = 0.2,
    sigma: float = 0.5,
    factors: tuple[str, ...] = FACTORS,
    regularise: float = 0.0,
    sample: bool = False,
    sharpness: float = 0.0,
) -> Choice:
    """Greedy maximiser of log det M_S: k* = argmax_k log det M_{S ∪ {k}} − log det M_S, ties to the earlier frame.

    M_kk = 1 but for rounding, so all first picks are equal and the first is drawn at random. The gain of a pick is the
    logarithm of its residual, computed by an incremental Cholesky factorisation in O(N K²) time and O(N K) memory.

    `regularise` = λ > 0 maximises log det(I + M_S / λ) instead, which is monotone. `sample` draws S from the k-DPP with
    P(S) ∝ det M_S, as the authors' code does for the published z_DPP: no greedy order, no gains, another set for
    another count. Sampled sets are less spread out than greedy ones.

    Where every residual left is below N ε, the rounding of float64, log det says nothing more about what to choose
    (the paper's "unsolvable"). From that pick on, `below_precision_from` in the notes counted from 0, the view least
    similar to those chosen is taken (the rule of `maxmin`), and the gain is reported as its bound, log N ε
    (log N ε (1 + λ) / λ with λ).

    Raises UserError for a negative λ, and for a sample of more views than MOST_TO_SAMPLE.
    """
    if not 0 <= regularise < np.inf:
        raise UserError(f"regularise = {regularise} must be 0 or a positive number; it is λ in log det(I + M / λ)")
    if sample and regularise:
        raise UserError("'logdet' either samples or regularises; leave out one of the two")
    if sample and len(views.kept):
        raise UserError("'logdet' keeps no views when it samples; leave out --keep or 'sample'")
    if sample and len(views) > MOST_TO_SAMPLE:
        raise UserError(f"'logdet' samples from at most {MOST_TO_SAMPLE} views, not {len(views)}; leave out 'sample'")
    begin = time.perf_counter()
    similar = similarity(views, alpha, beta, sigma, factors)
    prepared_s = time.perf_counter() - begin
    prefer = Preference(views.sharpness, sharpness, views.kept)
    precision = len(views) * np.finfo(float).eps * (1 + regularise)
    if sample:
        indices, gains = _sample(similar, count, precision, rng), None
    else:
        indices, gains = _greedy(similar, count, precision, regularise, prefer, rng)
    solved = len(indices)
    notes = describe(similar, alpha, beta, factors)
    if solved < count:
        notes |= {"below_precision_from": solved, "precision": precision}
        indices = _fill(similar, indices, count, prefer)
        gains = (
            None if gains is None else np.append(gains, np.full(count - solved, np.log(precision / (regularise or 1))))
        )
    return Choice(indices, gains, {"similarity": prepared_s}, notes)


def _kernel(similar: Similarity, regularise: float, capacity: int) -> Residuals:
    """Residuals of M + λ I; det(I + M_S / λ) is that determinant over λ^|S|."""

    def columns(chosen: np.ndarray) -> np.ndarray:
        m = similar.columns(chosen)
        m[np.arange(len(chosen)), chosen] += regularise
        return m

    return Residuals(columns, similar.diagonal + regularise, capacity)


def _greedy(
    similar: Similarity,
    count: int,
    precision: float,
    regularise: float,
    prefer: Preference,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """The picks and gains down to where residuals are below `precision`."""
    residuals = _kernel(similar, regularise, count)
    indices: list[int] = []
    gains: list[float] = []
    for k in range(count):
        pick = prefer.best(residuals.left) if k else prefer.any(rng, len(similar))
        if residuals.left[pick] <= precision:
            if pick in prefer.kept:  # like one chosen, and wanted all the same
                indices.append(pick)
                gains.append(float(np.log(precision / (regularise or 1))))
                prefer.take(pick)
                continue
            break
        indices.append(pick)
        gains.append(float(np.log(residuals.left[pick] / (regularise or 1))))
        prefer.take(pick)
        residuals.add(pick)
    return np.array(indices, dtype=np.int64), np.array(gains)


def _sample(similar: Similarity, count: int, precision: float, rng: np.random.Generator) -> np.ndarray:
    """A sample of the k-DPP, with k lowered to the numerical rank of M where that is less than `count`."""
    residuals = _kernel(similar, 0.0, len(similar))
    while residuals.size < len(similar) and residuals.left.max() > precision:
        residuals.add(int(residuals.left.argmax()))
    return _kdpp.sample(residuals.rows, count, rng)


def _fill(similar: Similarity, indices: np.ndarray, count: int, prefer: Preference) -> np.ndarray:
    """`indices` followed by the views farthest from them, up to `count`."""
    nearest = Nearest(similar)
    for i in indices:
        nearest.add(int(i))
    result = list(indices)
    while len(result) < count:
        pick = prefer.best(nearest.distance)
        prefer.take(pick)
        nearest.add(pick)
        result.append(pick)
    return np.array(result, dtype=np.int64)
