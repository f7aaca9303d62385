"""A reduced soak: a study whose processes are killed at random, one of each kind, ends as one that was left alone."""

import random
import sys

import pytest

from tests.soak import Soak


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found in /proc")
def test_a_study_that_is_killed_again_and_again_ends_as_one_that_is_not(tmp_path):
    soak = Soak(tmp_path, random.Random(7), small=True)
    soak.script = ["train", "snakemake", "hang-up", "forked job", "Ctrl-C"]
    soak.work(len(soak.script))
    assert soak.faults == [], soak.report()
    assert sum(soak.kills.values()) >= 3, soak.report()
    assert soak.resumes >= 2
