"""Tables: escaping in each of their forms, and what counts as best."""

import csv

import pytest

from viewbench.reports._tables import Entry, Table, best, latex, markdown, save

NASTY = "a|b_c & 50% $x$ #1 {y} \\z <i> ~^"


@pytest.fixture
def table():
    rows = ((Entry(NASTY), Entry("21.00 ± 0.10", 21.0, True)), (Entry("two\nlines"), Entry("−1.50", -1.5)))
    return Table(("name", "PSNR"), rows)


def test_markdown_has_one_line_a_row_and_as_many_bars(table):
    lines = markdown(table).splitlines()
    assert len(lines) == 4
    assert all(line.replace("\\|", "").count("|") == 3 for line in lines)
    assert "**21.00 ± 0.10**" in lines[2]


def test_latex_leaves_no_special_character_bare(table):
    text = latex(table)
    name = next(line for line in text.splitlines() if line.startswith("a|b"))
    cell = name.rsplit(" & ", 1)[0]
    for character in "&%#_{}$":
        bare = cell.replace("\\" + character, "").replace("\\textbackslash{}", "").replace("$<$", "").replace("$>$", "")
        bare = bare.replace("\\textasciitilde{}", "").replace("\\textasciicircum{}", "")
        assert character not in bare
    assert r"\textbf{21.00 $\pm$ 0.10}" in text
    assert text.count(r"\\") == 3  # the head and two rows


def test_save_writes_three_files(table, tmp_path):
    files = save(table, tmp_path, "scores", [{"name": NASTY, "psnr_db": 21.0}, {"name": "b", "psnr_db": None}])
    assert files == ("scores.csv", "scores.md", "scores.tex")
    with open(tmp_path / "scores.csv", newline="", encoding="utf-8") as file:
        assert list(csv.DictReader(file)) == [{"name": NASTY, "psnr_db": "21"}, {"name": "b", "psnr_db": ""}]


def test_best_goes_by_the_printed_figure():
    assert best([1.001, 1.004, 0.5, None], 2) == [True, True, False, False]
    assert best([0.3, 0.2], 3, lowest=True) == [False, True]
    assert best([1.0, None], 2) == [False, False]  # nothing to be better than
