"""Which frames are candidates: every N-th, or so many a second."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viewbench.common.errors import UserError
from viewbench.scenes.formats.images import nominal_cameras
from viewbench.scenes.thinning import Thinning, candidates, kept
from viewbench.scenes.types import Split


def split(n, times=None):
    from pathlib import Path

    names = tuple(f"{i}.png" for i in range(n))
    return Split(names, tuple(map(Path, names)), nominal_cameras(np.full((n, 2), 8)), times)


@given(st.integers(1, 60), st.integers(1, 70))
def test_every_nth_from_the_first(n, stride):
    assert np.flatnonzero(candidates(split(n), stride)).tolist() == list(range(0, n, stride))


@given(st.lists(st.floats(0, 30), min_size=1, max_size=60), st.floats(0.05, 40), st.floats(-5, 5))
def test_no_tick_has_two_frames_and_none_that_has_some_goes_empty(times, fps, start):
    """The rule said again, tick by tick."""
    times = np.sort(times) + start
    mask = candidates(split(len(times), times), fps=fps)
    tick = np.round((times - times[0]) * fps)
    for one in np.unique(tick):
        of_tick = np.flatnonzero(tick == one)
        taken = of_tick[mask[of_tick]]
        assert len(set(times[taken])) == 1, "and others of that very moment, by another camera"
        far = np.abs((times[of_tick] - times[0]) * fps - one)
        assert far[mask[of_tick]][0] <= far.min() + 1e-6
    assert len(set(times[mask])) <= np.floor((times[-1] - times[0]) * fps + 1) + 1


@given(st.integers(2, 400), st.sampled_from([23.976, 24.0, 25.0, 29.97, 30.0, 59.94]))
def test_time_stamps_in_milliseconds_waver_and_change_nothing(n, rate):
    times = np.round(np.arange(n) / rate, 3)
    assert kept(n, times, Thinning(fps=1.1 * rate)).all()
    steps = np.diff(np.flatnonzero(kept(n, times, Thinning(fps=rate / 5))))[:-1]  # the end of the capture is no tick
    assert set(steps) <= {4, 5, 6}
    assert abs(steps.mean() - 5) < 0.5 if len(steps) > 10 else True


@pytest.mark.parametrize(
    ("stride", "fps", "times", "words"),
    [
        (0, None, True, "stride 0"),
        (1, 0.0, True, "fps 0"),
        (1, float("nan"), True, "fps nan"),
        (2, 1.0, True, "either"),
        (1, 1.0, False, "no times"),
        (1, 1.0, None, "no time"),
    ],
)
def test_what_means_nothing_is_one_sentence(stride, fps, times, words):
    given_times = {True: np.arange(5.0), False: None, None: np.array([0, 1, np.nan, 3, 4])}[times]
    with pytest.raises(UserError, match=words):
        candidates(split(5, given_times), stride, fps)
