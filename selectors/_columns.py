"""Columns of a large symmetric matrix, asked for several at a time and kept at hand while there is room."""

from collections.abc import Callable, Iterable

import numpy as np

BLOCK = 32  # columns made together: one pass over the features serves them all
ROOM = 1 << 26  # bytes of the columns kept, at least two blocks


class Columns:
    """`make` maps view indices (B,) to rows (B, N) of the matrix; the oldest rows make way when room is short."""

    def __init__(self, make: Callable[[np.ndarray], np.ndarray], n: int):
        self._make = make
        self._most = max(2 * BLOCK, ROOM // (8 * n))
        self._kept: dict[int, np.ndarray] = {}

    def __contains__(self, j: int) -> bool:
        return j in self._kept

    def __getitem__(self, j: int) -> np.ndarray:
        """(N,) the column of view j."""
        if j not in self._kept:
            self.fetch([j])
        return self._kept[j]

    def fetch(self, wanted: Iterable[int]) -> None:
        """Makes those of the columns that are not at hand, at most a BLOCK of them, in one go."""
        missing = [j for j in map(int, wanted) if j not in self._kept][:BLOCK]
        if not missing:
            return
        while len(self._kept) + len(missing) > self._most:
            del self._kept[next(iter(self._kept))]
        rows = self._make(np.array(missing))
        self._kept |= {j: row.copy() for j, row in zip(missing, rows, strict=True)}
