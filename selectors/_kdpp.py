"""An exact sample of a k-DPP: a set S of k views with probability proportional to det M_S (Kulesza and Taskar 2011)."""

import numpy as np

from ._cholesky import Residuals


def sample(rows: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(k,) indices for the kernel M = VᵀV given by its rows V (r, N); fewer where M has a smaller rank.

    The eigenvectors of M come from those of V Vᵀ (r × r), with r the numerical rank of M. k of them are drawn
    with probability proportional to the product of their eigenvalues λ, by the elementary symmetric polynomials
    e_k(λ_1 … λ_n); then one view after the other from the projection onto their span. O(N r k + r³) time.
    """
    values, vectors = np.linalg.eigh(rows @ rows.T)
    trusted = values > len(values) * np.finfo(float).eps * values[-1]  # rounding makes others, some of them negative
    values, vectors, count = values[trusted], vectors[:, trusted], min(count, int(trusted.sum()))
    kept = _eigenvectors(np.log(values), count, rng)
    basis = np.linalg.qr(rows.T @ vectors[:, kept])[0]  # (N, k), orthonormal columns
    span = Residuals(lambda chosen: basis[chosen] @ basis.T, np.einsum("ij,ij->i", basis, basis), count)
    chosen = np.empty(count, dtype=np.int64)
    for k in range(count):
        heap = np.cumsum(np.maximum(span.left, 0))
        chosen[k] = pick = int(np.searchsorted(heap, rng.random() * heap[-1], side="right"))
        span.add(pick)
    return chosen


def _eigenvectors(logs: np.ndarray, count: int, rng: np.random.Generator) -> list[int]:
    """`count` of the r eigenvectors, from the logarithms of their eigenvalues; logarithms because e_k overflows."""
    r = len(logs)
    table = np.full((r + 1, count + 1), -np.inf)  # log e_k(λ_1 … λ_n) at [n, k]
    table[:, 0] = 0
    for n in range(1, r + 1):
        table[n, 1:] = np.logaddexp(table[n - 1, 1:], logs[n - 1] + table[n - 1, :-1])
    kept: list[int] = []
    for n in range(r, 0, -1):
        wanted = count - len(kept)
        if wanted and np.log(rng.random()) < logs[n - 1] + table[n - 1, wanted - 1] - table[n, wanted]:
            kept.append(n - 1)
    return kept
