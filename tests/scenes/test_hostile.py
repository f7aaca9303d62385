"""Captures that mean harm cost a sentence: no time, no memory, nothing left behind, nothing told that is not theirs."""

import dataclasses
import json

import pytest

from tests.scenes.hostile import ATTACKS, SECRET, Result, in_a_process
from viewbench.common import extras

SECONDS = 60  # of a machine that others use too; all take two or three on one that is free
MEGABYTES = 500
NEEDS_VIDEO = [name for name in ATTACKS if "video" in name]


@pytest.fixture(scope="module")
def results(once) -> dict[str, list[Result]]:
    names = [name for name in ATTACKS if name not in NEEDS_VIDEO or extras.missing("av") is None]

    def fill(folder):
        found = in_a_process(names, folder)
        rows = {name: [dataclasses.asdict(row) for row in rows] for name, rows in found.items()}
        (folder / "results.json").write_text(json.dumps(rows))

    rows = json.loads((once("hostile", fill) / "results.json").read_text())
    return {name: [Result(**row) for row in rows[name]] for name in rows}


@pytest.mark.parametrize("name", list(ATTACKS))
def test_an_attack_costs_a_sentence(results, name):
    if name not in results:
        pytest.skip("PyAV is not installed")
    expected = ATTACKS[name]
    assert len(results[name]) == len(expected.commands)
    for row in results[name]:
        assert row.status == expected.status, row
        assert not {"Traceback", "Warning"} & set(row.err.replace(":", " ").split()), row.err
        assert row.seconds < SECONDS, row
        assert row.megabytes < MEGABYTES, row
        assert SECRET not in row.out + row.err
        assert not any(ord(letter) < 32 and letter != "\n" for letter in row.err), row.err
        assert not any("pwned" in left or ".part-" in left for left in row.left), row.left
        if expected.status:
            assert row.err.startswith("viewbench: "), row.err
            assert row.err.count("\n") == 1, row.err
            assert len(row.err) < 4200
            assert expected.says in row.err, row.err
            assert not row.out
            assert [
                left for left in row.left if left not in ("cache", "cache/viewbench", "cache/viewbench/video")
            ] == []


def test_what_is_fine_is_done(results):
    """Else nothing above would say anything: commands that do nothing leave nothing."""
    (row,) = results["nothing wrong"]
    assert {"out/transforms.json", "out/images/0.png", "out/selection.json"} <= set(row.left)
    assert row.out.splitlines() == ["images/2.png", "images/0.png"]


def test_a_page_shows_names_as_text(results):
    sheet = results["names for terminals, shells and pages"][1]
    assert {"sheet.html", "plot.html"} <= set(sheet.left)
    assert "&lt;script&gt;alert(1)" in sheet.pages
    assert "<script>alert" not in sheet.pages
    # What plotly is given is HTML to it, whatever JSON makes of its letters.
    assert "\\u003cscript\\u003ealert" not in sheet.pages
