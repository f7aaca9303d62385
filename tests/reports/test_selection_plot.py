"""Pictures of a choice, with poses and without."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from tests.conftest import known
from tests.selectors import slow
from tests.selectors.test_every_selector import SCENE, VIEWS, N
from viewbench.reports import _redundancy_plot, _selection_plot
from viewbench.reports._picked import picked
from viewbench.scenes.types import Scene
from viewbench.selectors._covering import compared
from viewbench.selectors._normalise import normalise
from viewbench.selectors._redundancy import levels

CHOSEN = np.array([3, 20, 7])


def choice(posed=True, features=VIEWS.features, times=None):
    split = type(SCENE.train)(SCENE.train.names, SCENE.train.paths, SCENE.train.cameras, times)
    scene = Scene("a scene", SCENE.root, "images", split, split.subset([]), posed=posed)
    return picked(scene, "a scene: 3 of 30", CHOSEN, compared(scene, {}, features), 0.5)


def traces_of(path):
    """The traces of the page, by their kind and name."""
    text = path.read_text(encoding="utf-8")
    start = known(re.search(r'Plotly\.newPlot\(\s*"[^"]*",\s*', text)).end()
    return {(trace["type"], trace["name"]): trace for trace in json.JSONDecoder().raw_decode(text, start)[0]}


def numbers(value):
    """What plotly writes as a list or as base64."""
    return np.asarray(
        value if isinstance(value, list) else np.frombuffer(__import__("base64").b64decode(value["bdata"]))
    )


@pytest.mark.parametrize("posed", [True, False])
def test_the_strip_has_the_distance_of_each_frame_and_the_chosen_ones(tmp_path, posed):
    pytest.importorskip("plotly")
    path = tmp_path / "choice.html"
    _selection_plot.plot(path, choice(posed))
    traces = traces_of(path)
    strip = {name: trace for (kind, name), trace in traces.items() if kind == "scatter"}
    scaled = type(VIEWS)(normalise(VIEWS.positions), VIEWS.rotations, VIEWS.features)
    m = slow.matrix(scaled, factors=["pos", "ang", "sem"] if posed else ["sem"])
    expected = 1 - m[CHOSEN].max(axis=0)
    np.testing.assert_allclose(numbers(strip["distance"]["y"]), expected, atol=1e-9)
    assert numbers(strip["chosen"]["x"]).tolist() == CHOSEN.tolist()
    assert [words.split(": ")[1] for words in strip["chosen"]["hovertext"]] == [
        f"chosen as number {k}" for k in (1, 2, 3)
    ]
    assert numbers(strip["--auto"]["y"]).tolist() == [0.5, 0.5]
    assert any(kind == "scatter3d" for kind, _ in traces) == posed


@pytest.mark.parametrize(
    ("times", "unit"),
    [
        (None, "training view"),
        (np.arange(N) / 10, "seconds"),
        (np.zeros(N), "training view"),
        (np.full(N, np.nan), "training view"),
    ],
)
def test_the_axis_is_time_where_there_is_one(times, unit):
    drawn = choice(times=times)
    assert drawn.unit == unit
    assert (np.diff(drawn.clock) > 0).all()


@pytest.mark.parametrize("posed", [True, False])
@pytest.mark.parametrize("features", [VIEWS.features, None])
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_still_pictures_are_drawn_whatever_is_known(tmp_path, posed, features, kind):
    path = tmp_path / f"choice.{kind}"
    _selection_plot.plot(path, choice(posed, features))
    if kind == "png":
        with Image.open(path) as image:
            assert (np.asarray(image.convert("L")) < 128).mean() > 0.001


@pytest.mark.parametrize("curve", [[0.0], [0.9, 0.4, 0.0], [1e-17] * 3, [0.5]])
@pytest.mark.parametrize("kind", ["png", "html"])
def test_a_curve_of_any_length_is_drawn(tmp_path, recwarn, curve, kind):
    array = np.array(curve)
    _redundancy_plot.plot(tmp_path / f"curve.{kind}", "a", array, len(array), levels(array, len(array), [0.9, 0.5]))
    assert [str(warning.message) for warning in recwarn if "log" in str(warning.message)] == []
