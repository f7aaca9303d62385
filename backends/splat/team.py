"""Several threads for one picture: kernels run on ranges, and what they write does not depend on who takes which."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

import numpy as np

SHARES = 4  # ranges a thread, so that one that gets a hard range does not hold up the others


class Team:
    """So many threads; one needs none beside the caller's."""

    def __init__(self, threads: int = 1):
        self.threads = threads
        self.parts = 1 if threads == 1 else SHARES * threads
        self.pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def each(self, task: Callable[..., Any], ranges: Iterable[tuple]) -> None:
        """Calls task(*range) for every range, in any order."""
        if self.pool is None:
            for one in ranges:
                task(*one)
            return
        left = iter(list(ranges))  # of a list: several threads may ask it for the next

        def work() -> None:
            for one in left:
                task(*one)

        others = [self.pool.submit(work) for _ in range(self.threads - 1)]
        try:
            work()
        finally:
            wait(others)  # also after an error: they write into what the caller will use again
        for other in others:
            other.result()

    def blocks(self, count: int, size: int = 16) -> list[tuple[int, int]]:
        """Ranges of 0 to `count` that begin at multiples of `size`."""
        if self.threads == 1:
            return [(0, count)]
        blocks = -(-count // size)
        edges = [min(count, size * (blocks * part // self.parts)) for part in range(self.parts + 1)]
        return [(a, b) for a, b in pairwise(edges) if b > a]

    def rows(self, count: int) -> list[tuple[int, int]]:
        """Ranges of 0 to `count`, one a thread."""
        edges = [count * thread // self.threads for thread in range(self.threads + 1)]
        return [(a, b) for a, b in pairwise(edges) if b > a]

    def shares(self, starts: np.ndarray) -> list[tuple[int, int]]:
        """Ranges of tiles with about as many pairs each; `starts` (tiles + 1,) says where each tile's begin."""
        tiles = len(starts) - 1
        if self.threads == 1:
            return [(0, tiles)]
        wanted = np.linspace(0, starts[-1], self.parts + 1)[1:-1]
        edges = np.unique(np.concatenate([[0], np.searchsorted(starts[:-1], wanted), [tiles]]))
        return [(int(a), int(b)) for a, b in pairwise(edges)]
