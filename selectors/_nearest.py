"""How far every view is from the nearest one chosen, kept up to date with as little work as the answer needs."""

import numpy as np

from ._similarity import Similarity

MARGIN = 1e-9  # of the bounds below, far above the rounding of what they bound


class Nearest:
    """Distance min_{i ∈ S} (1 − M_ik) of every view k to a growing set S; −∞ for the members of S.

    A new member i changes the distance of k only if M_ik > 1 − distance_k. Since f_p is at most 1 and f_a at most
    A = (max ‖R‖² + 1) / 4 (1, but for rounded rotations), that needs α f_d > 1 − distance_k − β A − γ: a ball around
    k that shrinks with distance_k. Most views are outside theirs and are passed over after three subtractions. Of the
    rest, the semantic product is computed only where α f_d + β f_a + γ leaves the question open. The result is the
    same as without these bounds.
    """

    def __init__(self, similar: Similarity):
        n = len(similar)
        self.similar = similar
        self.distance = np.full(n, np.inf)  # (N,)
        self.owner = np.full(n, -1)  # (N,) the member that is nearest, the earlier of equal ones; −1 before any
        self.reach = np.full(n, np.inf)  # (N,) squared radius of the ball, in units of σ √2
        self.turned = similar.beta * (np.einsum("ij,ij->i", similar.turns, similar.turns).max() + 1) / 4  # β A
        self.axes = np.ascontiguousarray(similar.points.T)  # (3, N)

    def add(self, i: int) -> None:
        """Adds view i to the set."""
        m, distance = self.similar, self.distance
        near = np.flatnonzero(self._squared_distance(i) < self.reach)
        bound = m.spatial(i, near)
        if m.gamma:
            open_ = bound + m.gamma + MARGIN > 1 - distance[near]
            near, bound = near[open_], bound[open_]
            bound += m.gamma * m.semantic(i, near)
        away = 1 - bound
        nearer = away < distance[near]
        changed = near[nearer]
        distance[changed] = away[nearer]
        distance[i] = -np.inf
        self.owner[changed], self.owner[i] = i, i
        if m.alpha:
            needed = (1 - distance[changed] - self.turned - m.gamma) / m.alpha  # of f_d, to come nearer still
            with np.errstate(divide="ignore"):
                self.reach[changed] = MARGIN - np.log(np.maximum(needed, 0))
        self.reach[i] = -np.inf

    def _squared_distance(self, i: int) -> np.ndarray:
        x, y, z = self.axes
        total = x - x[i]
        total *= total
        for axis in (y, z):
            step = axis - axis[i]
            step *= step
            total += step
        return total
