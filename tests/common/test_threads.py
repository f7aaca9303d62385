"""Doing the same to many things with several threads: order, errors, how much is begun ahead."""

import threading
from typing import Any

import pytest

from viewbench.common import threads


@pytest.fixture(params=[1, 2, 5], autouse=True)
def allowed(request):
    before = threads.allowed()
    threads.allow(request.param)
    yield threads.allowed()
    threads.allow(before)


def test_no_more_than_there_are_processors(allowed):
    threads.allow(10**6)
    assert threads.allowed() == threads.processors()
    threads.allow(0)
    assert threads.allowed() == 1


def test_results_come_in_order(allowed):
    assert list(threads.over(lambda number: number**2, range(40))) == [number**2 for number in range(40)]
    assert list(threads.over(str, [])) == []


def test_what_is_raised_comes_when_its_turn_does():
    def task(number):
        if number == 3:
            raise ValueError(number)
        return number

    found = threads.over(task, range(20))
    assert [next(found) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="3"):
        next(found)


def test_little_is_begun_before_its_turn(allowed):
    """Each thing that waits takes memory: of a thousand pictures a few are held."""
    asked = []
    found: Any = threads.over(lambda number: number, (asked.append(number) or number for number in range(100)))
    next(found)
    assert len(asked) <= 1 + threads.AHEAD * allowed
    found.close()  # what has begun ends, and nothing else begins
    assert len(asked) <= 1 + threads.AHEAD * allowed


def test_several_work_at_once(allowed):
    together = threading.Barrier(allowed)
    assert list(threads.over(lambda number: together.wait(60) >= 0, range(2 * allowed))) == [True] * (2 * allowed)
