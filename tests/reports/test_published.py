"""The paper's numbers: complete, and in line with what its text says of them."""

import csv
import statistics

import pytest

from viewbench.reports import _deltas, _published
from viewbench.reports._study import load

from .fixtures import make_study


def mean_difference(model, dataset, ours, theirs):
    scores = {
        (score.selector, score.scene): score.psnr_db
        for score in _published.scores("table1_synthetic")
        if (score.model, score.dataset) == (model, dataset)
    }
    scenes = {scene for _, scene in scores}
    return statistics.mean(scores[ours, scene] - scores[theirs, scene] for scene in scenes)


def test_differences_that_the_text_names():
    """Its averages are rounded or over runs: "approximately 1.46", "2.25 drop even compared to Random"."""
    assert mean_difference("3dgs", "indoortraj", "maxmin", "uniform") == pytest.approx(1.46, abs=0.05)
    assert mean_difference("3dgs", "replica", "coverage", "random") == pytest.approx(-2.25, abs=0.06)


@pytest.mark.parametrize(("table", "rows"), [("table1_synthetic", 2 * 5 * 8), ("table2_real", 5 * 8)])
def test_tables_are_complete(table, rows):
    scores = _published.scores(table)
    assert len({(score.model, score.selector, score.scene) for score in scores}) == len(scores) == rows
    assert all((score.psnr_std_db is None) == (score.selector == "coverage") for score in scores)


def test_the_full_similarity_of_the_ablation_is_the_main_result():
    main = {(s.model, s.scene): s.psnr_db for s in _published.scores("table1_synthetic") if s.selector == "maxmin"}
    full = {(a.model, a.scene): a.psnr_db for a in _published.ablations() if a.factors == "sem+ang+pos"}
    assert full == main


def test_a_studys_differences_are_those_of_its_results(tmp_path):
    study = load(make_study(tmp_path, scenes=("room_human",)))
    deltas = {delta.selector: delta for delta in _deltas.of_study(study)}
    assert set(deltas) == set(study.selectors) - {"uniform"}
    with open(study.folder / "results.csv", newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["ratio"] == "0.05"]
    psnr = {s: [float(row["psnr_db"]) for row in rows if row["selector"] == s] for s in study.selectors}
    for selector, delta in deltas.items():
        expected = statistics.mean(psnr[selector]) - statistics.mean(psnr["uniform"])
        assert delta.mean_db == pytest.approx(expected)
        assert delta.ours
        if selector == "coverage":
            assert delta.error_db is None
        else:
            variances = statistics.variance(psnr[selector]) / 3 + statistics.variance(psnr["uniform"]) / 3
            assert delta.error_db == pytest.approx(variances**0.5)
