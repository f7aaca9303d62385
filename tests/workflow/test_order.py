"""In which order a study's jobs are done: what others wait for first, then what is nearest to a result."""

from pathlib import Path

import pytest

from tests.workflow.clones import Clone

STUDY = """
scenes: [room_human]
selectors: [uniform, maxmin, coverage]
ratios: [0.01, 0.02]
seeds: 1
backends:
  - splat
  - {name: again, backend: splat, options: {points: random}}
width: 16
budget: {iterations: 1}
reference: false
reports: [table_psnr]
"""


class Ends:
    """When jobs ended, earliest first, by what they wrote: a study that one core ran."""

    def __init__(self, results: Path):
        self.results = results

    def __getitem__(self, files: str) -> list[int]:
        found = sorted(path.stat().st_mtime_ns for path in self.results.glob(files))
        assert found
        return found


@pytest.fixture(scope="module")
def ends(tmp_path_factory) -> Ends:
    clone = Clone(tmp_path_factory.mktemp("order"), STUDY)
    done = clone.call("snakemake", "-j1", "--config", "study=mini", "--", "reports")
    assert done.returncode == 0, done.stdout + done.stderr
    return Ends(clone.results)


def test_kernels_are_prepared_first_and_once_for_a_backend_of_two_names(ends):
    assert len(ends["warm/*"]) == len(ends["warm_selectors/*"]) == 1
    others = ("selections/**/*.json", "features/*.npy", "scenes/*.json", "cells/**/train.json")
    assert max(ends["warm*/*"]) < min(ends[files][0] for files in others)


def test_models_are_trained_before_the_second_choice_is_made(ends):
    assert ends["cells/**/train.json"][0] < ends["selections/**/*.json"][1]


def test_a_model_is_scored_before_the_next_one_is_trained(ends):
    trained, scored = ends["cells/**/train.json"], ends["cells/**/metrics.json"]
    assert all(score < following for score, following in zip(scored[:-1], trained[1:], strict=True))


def test_what_needs_no_features_does_not_wait_for_them(ends):
    for selector in ("uniform", "coverage"):
        assert ends[f"cells/*/*/{selector}/*/*/metrics.json"][-1] < ends["features/*.npy"][0]
    assert ends["features/*.npy"][0] < ends["cells/*/*/maxmin/*/*/train.json"][0]


def test_what_a_study_that_is_stopped_is_reported_with_is_there_early(ends):
    assert max(*ends["study.json"], *ends["scenes/*.json"]) < ends["cells/**/train.json"][0]
