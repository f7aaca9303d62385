"""Every report on whole studies: complete files, right numbers, equal bytes."""

import csv
import importlib
import statistics
import sys
from typing import cast

import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.reports import _items, _run, _study

from .fixtures import make_study

REPORTS = plugins.names("reports")
ODD = ["a $x$ <b>|\n\"q\" & 'r'.png", "ünï 名.png", "x" * 300]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A study of two scenes with everything drawn; a seed of uniform failed at one ratio."""
    folder = make_study(tmp_path_factory.mktemp("drawn"), lpips=True, failed=[(None, "room_smooth", "uniform", 0.2, 1)])
    for name in REPORTS:
        _run.run(folder, name)
    return folder


def all_items(folder):
    return [item for name in REPORTS for item in _items.read(folder / "reports", name)]


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_reports_that_ship_are_found():
    assert {"psnr-over-ratio", "table-psnr", "cameras", "renders", "timing", "published", "recorded"} <= set(REPORTS)
    assert all(plugins.summary("reports", name) for name in REPORTS)


def test_figures_have_png_pdf_csv_and_tables_csv_md_tex(drawn):
    suffixes = {"figure": ["png", "pdf", "csv"], "table": ["csv", "md", "tex"], "text": []}
    for item in all_items(drawn):
        assert [file.rsplit(".", 1)[1] for file in item.files] == suffixes[item.kind]
        assert item.caption
        assert all((drawn / "reports" / file).stat().st_size > 20 for file in item.files)
        if item.kind == "table":
            table = known(item.table)
            assert all(len(row) == len(table.columns) for row in table.rows)


def test_no_file_is_named_by_two_items(drawn):
    files = [file for item in all_items(drawn) for file in item.files]
    assert len(files) == len(set(files))


@pytest.mark.parametrize(("table", "column"), [("psnr", "psnr_db"), ("ssim", "ssim"), ("lpips", "lpips")])
def test_tables_equal_a_plain_computation(drawn, table, column):
    """Mean and deviation from results.csv by dictionaries and the statistics module."""
    groups = {}
    for row in rows_of(drawn / "results.csv"):
        if row["status"] == "ok":
            groups.setdefault((row["scene"], row["selector"], float(row["ratio"])), []).append(float(row[column]))
    found = rows_of(drawn / "reports" / f"table_{table}.csv")
    assert len(found) == len(groups)
    for row in found:
        values = groups[row["scene"], row["selector"], float(row["ratio"])]
        assert float(row[f"{column}_mean"]) == pytest.approx(statistics.mean(values), rel=1e-5)
        assert int(row["n"]) == len(values)
        if len(values) == 1:
            assert row[f"{column}_std"] == ""
        else:
            assert float(row[f"{column}_std"]) == pytest.approx(statistics.stdev(values), rel=1e-4, abs=1e-9)


def test_the_best_of_each_row_is_bold(drawn):
    table = known(next(item for item in all_items(drawn) if item.title.startswith("PSNR per scene")).table)
    for row in table.rows:
        figures = [entry for entry in row[table.labels : -1] if entry.value is not None]  # the last one is full
        rounded = [round(cast(float, entry.value), 2) for entry in figures]
        top = max(rounded)
        assert [entry.best for entry in figures] == [value == top for value in rounded]
        assert not row[-1].best


def test_one_sample_is_shown_without_a_spread(drawn):
    table = known(next(item for item in all_items(drawn) if item.title.startswith("PSNR per scene")).table)
    at = table.columns.index("coverage")
    assert all("±" not in row[at].text and row[at].text for row in table.rows)
    assert all("±" in row[table.columns.index("maxmin")].text for row in table.rows)
    assert any("n = 2" in row[table.columns.index("uniform")].text for row in table.rows)
    for row in rows_of(drawn / "reports" / "psnr_over_ratio.csv"):
        assert (row["psnr_std_db"] == "") == (row["n"] == "1")
    verdicts = {row["selector"]: row["verdict"] for row in rows_of(drawn / "reports" / "table_differences.csv")}
    assert verdicts["coverage"] == "one sample"


def test_camera_csv_holds_the_choice_in_its_order(drawn):
    study = _study.load(drawn)
    rows = rows_of(drawn / "reports" / "cameras_room_human.csv")
    assert sum(row["role"] == "path" for row in rows) == 400
    assert sum(row["role"] == "test" for row in rows) == 40
    for selector in study.selectors:
        (cell,) = study.find(scene="room_human", selector=selector, ratio=0.1, seed=0)
        chosen = [int(row["index"]) for row in rows if row["role"] == selector]
        assert chosen == cell.read("selection")["indices"]


def test_ground_truth_is_optional(tmp_path):
    widths = []
    for truth in (True, False):
        folder = make_study(tmp_path / str(truth), scenes=("room_human",), truth=truth)
        _run.run(folder, "renders")
        with Image.open(folder / "reports" / "renders_room_human.png") as image:
            widths.append(image.width)
    assert widths[0] > widths[1]


def test_equal_data_gives_equal_bytes(drawn, tmp_path):
    again = make_study(tmp_path, lpips=True, failed=[(None, "room_smooth", "uniform", 0.2, 1)])
    for name in REPORTS:
        _run.run(again, name)
    for path in sorted((drawn / "reports").iterdir()):
        if path.name != "index.html":
            assert path.read_bytes() == (again / "reports" / path.name).read_bytes(), path.name


STUDIES = {
    "one ratio, one seed, no reference": {"ratios": (0.1,), "seeds": (0,), "reference": False},
    "two backends, one of which failed on a selector": {
        "backends": ("splat", "command-example"),
        "failed": [("splat", None, "random", None, None)],
        "scenes": ("room_human",),
    },
    "selectors nobody has heard of": {"selectors": ("my_sel", "odd.one+x", "maxmin:2"), "scenes": ("room_human",)},
    "one selector": {"selectors": ("uniform",), "scenes": ("room_human",), "ratios": (0.05, 0.1)},
    "odd names of views": {"test_names": ODD, "scenes": ("room_human",), "title": "<b>$x_1$</b> & co"},
    "the middle ratio failed": {"failed": [(None, None, None, 0.1, None)], "scenes": ("room_human",)},
    "nothing worked": {"failed": [(None, None, None, None, None)], "scenes": ("room_human",)},
}


@pytest.mark.parametrize("kind", STUDIES)
def test_any_study_can_be_reported(kind, tmp_path):
    folder = make_study(tmp_path, **STUDIES[kind])
    for name in REPORTS:
        _run.run(folder, name)
    _run.page(folder)
    for item in all_items(folder):
        assert all((folder / "reports" / file).is_file() for file in item.files)


def test_drawing_again_removes_what_is_no_longer_drawn(tmp_path):
    folder = make_study(tmp_path, scenes=("room_human",))
    _run.run(folder, "cameras")
    results = folder / "results.csv"
    kept = [line for line in results.read_text().splitlines() if ",0.1," not in line]
    results.write_text("\n".join(kept) + "\n")
    _run.run(folder, "cameras")
    assert sorted(path.name for path in (folder / "reports").iterdir()) == ["cameras.items.json"]


def test_unknown_report_is_answered_with_the_nearest(tmp_path):
    folder = make_study(tmp_path, scenes=("room_human",))
    with pytest.raises(UserError, match="did you mean 'cameras'"):
        _run.run(folder, "camera")


def test_a_choice_of_another_scene_is_refused(tmp_path):
    folder = make_study(tmp_path, scenes=("room_human",))
    path = folder / "cells/splat/room_human/maxmin/0.1/0/selection.json"
    path.write_text(path.read_text().replace('"indices": [', '"indices": [4000, '))
    with pytest.raises(UserError, match=r"selection\.json.*room_human"):
        _run.run(folder, "cameras")


PLUG_IN = '''"""How many cells have a score."""

from viewbench.common.files import write_text
from viewbench.reports._items import Item


def build(study, out):
    write_text(out / "counted.md", str(len(study.done)))
    return [Item("Counted", "text", f"{len(study.done)} cells.", ("counted.md",))]
'''


def test_a_new_report_is_one_file(tmp_path, monkeypatch):
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "cell_count.py").write_text(PLUG_IN)
    package = importlib.import_module("viewbench.reports")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path / "more")])
    monkeypatch.delitem(sys.modules, "viewbench.reports.cell_count", raising=False)
    folder = make_study(tmp_path, scenes=("room_human",), reports=("cell-count",))
    assert plugins.summary("reports", "cell-count") == "How many cells have a score."
    _run.run(folder, "cell-count")
    _run.page(folder)
    assert "40 cells." in (folder / "reports" / "index.html").read_text(encoding="utf-8")
