"""The multifactor similarity M = α Dist3D + β Ang3D + γ DistSem (paper, Table 1 and Eq. 2), one row at a time."""

from dataclasses import dataclass

import numpy as np

from viewbench.common.errors import UserError, nearest
from viewbench.selectors._types import FACTORS, Views

PARAMETERS = {"alpha": 0.7, "beta": 0.2, "sigma": 0.5, "factors": list(FACTORS)}


@dataclass(frozen=True)
class Similarity:
    """Gives rows of M without ever holding M."""

    positions: np.ndarray  # (N, 3) in [-4, 4]
    rotations: np.ndarray  # (N, 9) flattened
    features: np.ndarray | None  # (N, D) unit rows
    alpha: float
    beta: float
    gamma: float
    sigma: float

    def __len__(self) -> int:
        return len(self.positions)

    def row(self, i: int) -> np.ndarray:
        """(N,) float64 of M[i, :], in [0, 1] up to rounding; M[i, i] is α + β + γ = 1."""
        total = np.zeros(len(self))
        if self.alpha:
            d2 = ((self.positions - self.positions[i]) ** 2).sum(axis=1)
            total += self.alpha * np.exp(d2 / (-2 * self.sigma**2))
        if self.beta:  # trace(RᵢᵀRⱼ) is the dot product of the flattened matrices
            total += self.beta * (self.rotations @ self.rotations[i] + 1) / 4
        if self.gamma and self.features is not None:
            total += self.gamma * (self.features @ self.features[i])
        return total


def similarity(
    views: Views, alpha: float = 0.7, beta: float = 0.2, sigma: float = 0.5, factors: list | None = None
) -> tuple[Similarity, dict]:
    """The similarity of the views, and notes on what was left out.

    γ = 1 − α − β. Weights are renormalised over the factors in use: those named, without "sem" where there are no
    features. Raises UserError for weights or factors out of range.
    """
    if not (0 <= alpha <= 1 and 0 <= beta <= 1 and alpha + beta <= 1 + 1e-9):
        raise UserError(f"weights alpha {alpha} and beta {beta} must be in [0, 1] and add up to at most 1")
    if not sigma > 0:
        raise UserError(f"sigma is {sigma}, expected a positive number")
    asked = list(factors if factors is not None else FACTORS)
    for factor in asked:
        if factor not in FACTORS:
            raise UserError(f"unknown factor '{factor}'{nearest(str(factor), FACTORS)} (known: {', '.join(FACTORS)})")
    used = [factor for factor in asked if factor != "sem" or views.features is not None]
    weights = {"pos": alpha, "ang": beta, "sem": max(0.0, 1 - alpha - beta)}
    total = sum(weights[factor] for factor in set(used))
    if total <= 0:
        raise UserError(f"the factors {', '.join(used) or 'left'} have no weight; change alpha, beta or factors")
    weight = {factor: weights[factor] / total if factor in used else 0.0 for factor in FACTORS}
    notes = {} if set(used) == set(FACTORS) else {"weights": {name: round(value, 6) for name, value in weight.items()}}
    made = Similarity(
        positions=views.positions,
        rotations=views.rotations.reshape(len(views), 9),
        features=views.features if weight["sem"] else None,
        alpha=weight["pos"],
        beta=weight["ang"],
        gamma=weight["sem"],
        sigma=sigma,
    )
    return made, notes
