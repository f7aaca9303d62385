"""How many threads this process may use for one piece of work, and doing the same to many things with them."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")
AHEAD = 2  # things a thread that are begun before their turn, each of which takes memory

_allowed = 1


def allow(count: int) -> None:
    """Says how many it may use from now on, of the processors that it has; before that it is one."""
    global _allowed
    _allowed = max(1, min(count, processors()))


def processors() -> int:
    """How many this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def allowed() -> int:
    """So many."""
    return _allowed


def over(function: Callable[[A], B], things: Iterable[A]) -> Iterator[B]:
    """function(thing) for every thing, in order, of several at once; what one raises is raised when its turn comes."""
    if _allowed == 1:
        yield from map(function, things)
        return
    with ThreadPoolExecutor(_allowed) as pool:
        begun: deque[Future[B]] = deque()
        try:
            for thing in things:
                begun.append(pool.submit(function, thing))
                if len(begun) > AHEAD * _allowed:
                    yield begun.popleft().result()
            while begun:
                yield begun.popleft().result()
        finally:
            for late in begun:
                late.cancel()
