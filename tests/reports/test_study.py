"""Reading a study's folder: what is there, what failed, and what is said when it is broken."""

import pytest

from tests.conftest import known
from viewbench.common.errors import UserError
from viewbench.reports._study import and_list, load, percent

from .fixtures import make_study


@pytest.fixture
def folder(tmp_path):
    return make_study(tmp_path, scenes=("room_human",), failed=[(None, None, "logdet", 0.1, 1)])


def test_grid_and_failures(folder):
    study = load(folder)
    assert len(study.cells) == 4 * 3 * 3 + 3 + 1
    assert [(cell.selector, cell.ratio, cell.seed) for cell in study.failed] == [("logdet", 0.1, 1)]
    assert len(study.find(selector="logdet", ratio=0.1)) == 2
    assert study.middle_ratio() == study.middle_ratio("splat") == 0.1
    assert known(study.full("splat", "room_human")).count == 400
    assert study.panels() == [("splat", "room_human")]
    assert study.find(selector="maxmin", seed=2)[0].read("selection")["selector"] == "maxmin"
    assert study.scene("room_human").n_test == 40


@pytest.mark.parametrize("file", ["study.json", "results.csv"])
def test_missing_file_is_named(folder, file):
    (folder / file).unlink()
    with pytest.raises(UserError, match=file):
        load(folder)


def test_garbled_row_is_named_by_its_line(folder):
    path = folder / "results.csv"
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace("0.05", "five", 1)
    path.write_text("\n".join(lines))
    with pytest.raises(UserError, match="line 4"):
        load(folder)


def test_no_cells_and_no_scene_are_said(folder):
    study = load(folder)
    with pytest.raises(UserError, match="elsewhere"):
        study.scene("elsewhere")
    path = folder / "results.csv"
    path.write_text(path.read_text().splitlines()[0] + "\n")
    with pytest.raises(UserError, match="no cells"):
        load(folder)


def test_words():
    assert [percent(ratio) for ratio in (0.05, 0.005, 1.0)] == ["5 %", "0.5 %", "100 %"]
    assert [and_list(words) for words in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == ["", "a", "a and b", "a, b and c"]
