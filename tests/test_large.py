"""Thousands of frames take no more memory than is said: choosing, training, scoring, each by its formula."""

import sys
from pathlib import Path

import pytest

from tests.large import GAUSSIANS, PER_FRAME, bound_bytes, capture, peak_bytes

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is measured as Linux tells it"),
]
FRAMES, TESTED, FEW = 3000, 1500, 100  # training views, test views, and either of a capture to compare with
SIZE = 128, 96
SCORED = 64  # pixels across: scoring takes longer
DECODED = SIZE[0] * SIZE[1] * 3  # bytes of a picture


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    return capture(tmp_path_factory.mktemp("many") / "room", FRAMES, TESTED, SIZE, 8).parent


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    return capture(tmp_path_factory.mktemp("few") / "room", FEW, FEW, SIZE, 8).parent


def train(folder: Path, count: int, *how: object) -> int:
    """Peak of a training on so many views of the capture."""
    peak_bytes(folder, "select", "room", "--selector", "uniform", "--count", count, "--selection", "chosen.json")
    steps = ("--iterations", 20, "--set", f"gaussians={GAUSSIANS}", "--out", "model")
    return peak_bytes(folder, "train", "room", "--selection", "chosen.json", *steps, *how)


def test_choosing(many, few):
    command = ("select", "room", "--ratio", 0.1, "--selection", "tenth.json")
    before, after = peak_bytes(few, *command), peak_bytes(many, *command)
    assert after < bound_bytes("select", FRAMES, 0)
    assert after - before < PER_FRAME["select"] * (FRAMES - FEW)
    assert PER_FRAME["select"] < DECODED, "pictures that are held would be noticed"


def test_training(many):
    bound = bound_bytes("train", FRAMES, SIZE[0] * SIZE[1], 3)
    assert train(many, FRAMES) < bound
    assert bound < FRAMES * 12 * DECODED, "what the loss knows of all pictures would be noticed"


def test_scoring(many, few):
    peaks = []
    for folder in (few, many):
        train(folder, 20, "--width", SCORED)
        peaks.append(peak_bytes(folder, "evaluate", "model", "room", "--out", "model"))
    assert peaks[1] < bound_bytes("evaluate", TESTED, SCORED * SCORED * SIZE[1] // SIZE[0])
    assert peaks[1] - peaks[0] < PER_FRAME["evaluate"] * (TESTED - FEW)
    assert PER_FRAME["evaluate"] < DECODED * SCORED**2 / SIZE[0] ** 2, "pictures that are held would be noticed"
