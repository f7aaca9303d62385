"""Incremental Cholesky factorisation of a chosen principal submatrix, and what is left of every other diagonal entry.

For a symmetric positive semidefinite A (N × N) and a growing set S, det A_{S ∪ {k}} = det A_S · r_k with the residual
r_k = A_kk − A_kS A_S⁻¹ A_Sk, the diagonal of the Schur complement. With A_S = L Lᵀ and one row of V per member,

    v = (A_j· − V[:, j]ᵀ V) / √r_j        r ← r − v²        (Chen, Zhang and Zhou 2018)

adds the view j in O(N |S|) time. Memory is the |S| × N numbers of V; A is only asked for by columns.
"""

from collections.abc import Callable

import numpy as np

from ._columns import BLOCK, Columns


class Residuals:
    """r over a growing S. `columns` maps view indices (B,) to rows (B, N) of A, of which `diagonal` is (N,)."""

    def __init__(self, columns: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, capacity: int):
        self.left = diagonal.copy()  # (N,) r_k ≥ 0; −∞ for the members of S
        self.size = 0
        self._columns = Columns(columns, len(diagonal))
        self._rows = np.empty((capacity, len(diagonal)))  # V

    @property
    def rows(self) -> np.ndarray:
        """(|S|, N) V, with A ≈ Vᵀ V."""
        return self._rows[: self.size]

    def add(self, j: int) -> None:
        """Adds view j, whose residual must be positive."""
        v = (self._column(j) - self.rows[:, j] @ self.rows) / np.sqrt(self.left[j])
        self._rows[self.size] = v
        self.size += 1
        gone = np.isneginf(self.left)
        self.left = np.maximum(self.left - v * v, 0)
        self.left[gone] = self.left[j] = -np.inf

    def _column(self, j: int) -> np.ndarray:
        if j not in self._columns:  # made together with those of the leading residuals, likely to be wanted next
            likely = np.argpartition(self.left, -min(BLOCK, len(self.left)))[-BLOCK:]
            self._columns.fetch([j, *likely])
        return self._columns[j]
