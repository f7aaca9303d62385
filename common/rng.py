"""Random generators named by what they are for, so that the same cell always draws the same numbers."""

import hashlib

import numpy as np


def seed_of(*names: object) -> int:
    """A 128-bit seed from the names, stable over machines and Python versions (Python's `hash` is not)."""
    text = "\x1f".join(str(name) for name in names)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "little")


def generator(*names: object) -> np.random.Generator:
    """`numpy.random.default_rng` for the cell's names, e.g. `generator("select", scene, selector, seed)`."""
    return np.random.default_rng(seed_of(*names))
