"""The similarity M of views by position, rotation and semantics (the paper's “Distance Measures”), by columns.

    M_ij = α f_d(i, j) + β f_a(i, j) + γ f_p(i, j)

    f_d  Dist3D    exp(−‖v_i − v_j‖² / 2σ²)            positions v in [-4, 4]        factor "pos"
    f_a  Ang3D     (trace(R_iᵀ R_j) + 1) / 4           camera-to-world rotations R   factor "ang"
    f_p  DistSem   p_i · p_j / (‖p_i‖ ‖p_j‖)           image features p              factor "sem"

α, β and γ = 1 − α − β are divided by the sum of those whose factors are in use. All arithmetic is float64; features
are kept as float32 and converted where they are used, so that memory stays at what was given plus 12 numbers a view.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..common.errors import UserError, nearest
from ._types import FACTORS, Views

CHUNK = 1 << 20  # numbers converted to float64 at a time


@dataclass(frozen=True)
class Similarity:
    """M of N views, given out by columns."""

    alpha: float  # weights of the factors in use, which sum to 1; 0 where a factor is not
    beta: float
    gamma: float
    points: np.ndarray  # (N, 3) float64, positions / (σ √2), so that f_d = exp(−‖x_i − x_j‖²)
    turns: np.ndarray  # (N, 9) float64, rotations row by row, so that trace(R_iᵀ R_j) is a dot product
    features: np.ndarray | None  # (N, D) float32
    inverse_norms: np.ndarray | None  # (N,) float64, 1 / ‖p_i‖

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def weights(self) -> dict[str, float]:
        """Weights by factor, those in use only."""
        return {name: w for name, w in zip(FACTORS, (self.alpha, self.beta, self.gamma), strict=True) if w > 0}

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(N,) M_ii: 1, but for rotations that were rounded; M stays positive semidefinite only with its own."""
        squares = np.einsum("ij,ij->i", self.turns, self.turns)
        return self.alpha + self.beta * (squares + 1) / 4 + self.gamma

    def column(self, j: int) -> np.ndarray:
        """(N,) M_ij over all i."""
        return self.spatial(j) + self.gamma * self.semantic(j)

    def columns(self, chosen: np.ndarray) -> np.ndarray:
        """(B, N) rows M_j· for the views j in `chosen`; one pass over the features serves all of them."""
        m = np.stack([self.spatial(j) for j in chosen])
        if self.gamma:
            assert self.features is not None
            assert self.inverse_norms is not None
            p = self.features[chosen].astype(np.float64) * self.inverse_norms[chosen, None]
            rows = max(1, CHUNK // max(1, p.shape[1]))
            for start in range(0, len(self), rows):
                part = slice(start, start + rows)
                m[:, part] += self.gamma * (p @ self.features[part].astype(np.float64).T) * self.inverse_norms[part]
        return m

    def spatial(self, j: int, among: np.ndarray | None = None) -> np.ndarray:
        """α f_d + β f_a of the view j with the views `among` (all by default): M without its semantic term."""
        points, turns = (self.points, self.turns) if among is None else (self.points[among], self.turns[among])
        total = np.zeros(len(points))
        if self.alpha:
            difference = points - self.points[j]
            total += self.alpha * np.exp(-np.einsum("ij,ij->i", difference, difference))
        if self.beta:
            total += self.beta * (turns @ self.turns[j] + 1) / 4
        return total

    def semantic(self, j: int, among: np.ndarray | None = None) -> np.ndarray | float:
        """f_p of the view j with the views `among` (all by default); 0 where the factor is not in use."""
        if not self.gamma:
            return 0.0
        assert self.features is not None
        assert self.inverse_norms is not None
        p_j = self.features[j].astype(np.float64) * self.inverse_norms[j]
        count = len(self) if among is None else len(among)
        products = np.empty(count)
        rows = max(1, CHUNK // len(p_j))
        for start in range(0, count, rows):
            part = slice(start, start + rows)
            products[part] = self.features[part if among is None else among[part]].astype(np.float64) @ p_j
        return products * (self.inverse_norms if among is None else self.inverse_norms[among])


def similarity(
    views: Views, alpha: float = 0.7, beta: float = 0.2, sigma: float = 0.5, factors: Sequence[str] = FACTORS
) -> Similarity:
    """M of the views. Without features the semantic factor is left out and the other weights are renormalised.

    Raises UserError for weights outside [0, 1], σ ≤ 0, an unknown factor, and when nothing is left to weigh.
    """
    check_weights(alpha, beta, sigma, factors)
    given: dict[str, float] = dict(zip(FACTORS, (alpha, beta, max(0.0, 1 - alpha - beta)), strict=True))
    if given["sem"] < 1e-12:
        given["sem"] = 0.0  # 1 − 0.7 − 0.3 is not quite 0
    usable = [name for name in FACTORS if name in factors and (name != "sem" or views.features is not None)]
    total = sum(given[name] for name in usable)
    if total <= 0:
        raise UserError(
            f"the factors in use ({', '.join(usable) or 'none'}) have no weight: raise alpha or beta, add a factor"
            + ("" if views.features is not None else ", or give image features for 'sem'")
        )
    used = {name: given[name] / total if name in usable else 0.0 for name in FACTORS}
    features = views.features if used["sem"] else None
    return Similarity(
        alpha=used["pos"],
        beta=used["ang"],
        gamma=used["sem"],
        points=np.ascontiguousarray(views.positions / (sigma * np.sqrt(2))),
        turns=np.ascontiguousarray(views.rotations.reshape(-1, 9)),
        features=features,
        inverse_norms=None if features is None else _inverse_norms(features),
    )


def check_weights(alpha: float = 0.7, beta: float = 0.2, sigma: float = 0.5, factors: Sequence[str] = FACTORS) -> None:
    """Raises UserError for weights outside [0, 1], σ ≤ 0 and an unknown factor."""
    if not (0 <= alpha <= 1 and 0 <= beta <= 1 and alpha + beta <= 1 + 1e-12):
        raise UserError(f"alpha = {alpha} and beta = {beta} must lie in [0, 1] and sum to at most 1; gamma is the rest")
    if not 0 < sigma < np.inf:
        raise UserError(f"sigma = {sigma} must be positive; it is a length with positions scaled to [-4, 4]")
    for factor in factors:
        if factor not in FACTORS:
            raise UserError(f"unknown factor '{factor}'{nearest(factor, FACTORS)} (there are: {', '.join(FACTORS)})")


def _inverse_norms(features: np.ndarray) -> np.ndarray:
    """(N,) 1 / ‖p_i‖ in float64: rows that are of length 1 in float32 are off by 1e-8, which log det would see."""
    squares = np.empty(len(features))
    rows = max(1, CHUNK // max(1, features.shape[1]))
    for start in range(0, len(features), rows):
        part = features[start : start + rows].astype(np.float64)
        squares[start : start + rows] = np.einsum("ij,ij->i", part, part)
    return 1 / np.sqrt(squares)


def describe(similarity: Similarity, alpha: float, beta: float, factors: Sequence[str]) -> dict[str, object]:
    """What a reader must know of the weights: nothing when they are as given, otherwise what became of them."""
    missing = [name for name in FACTORS if name not in similarity.weights]
    given: dict[str, float] = dict(zip(FACTORS, (alpha, beta, 1 - alpha - beta), strict=True))
    if all(given[name] <= 1e-12 for name in missing):
        return {}
    why = "no image features" if "sem" in missing and "sem" in factors else "those in use"
    return {
        "weights": {name: round(weight, 6) for name, weight in similarity.weights.items()},
        "factors": f"{', '.join(similarity.weights)} only ({why}); their weights were divided by their sum",
    }
