import subprocess
import sys

from viewbench.common import rng


def test_same_names_same_numbers_in_another_process():
    code = "from viewbench.common.rng import generator; print(generator('select', 'a', 3).integers(10**9))"
    drawn = {subprocess.check_output([sys.executable, "-c", code], text=True) for _ in range(2)}
    assert drawn == {f"{rng.generator('select', 'a', 3).integers(10**9)}\n"}


def test_names_are_kept_apart():
    names = [("a", "b"), ("ab",), ("a", "b", ""), ("b", "a"), ("a", 1), ("a", 11), ("a1", 1)]
    assert len({rng.seed_of(*name) for name in names}) == len(names)
