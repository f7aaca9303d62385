"""The shared view of a study: what its tags hold, and what MLflow's page draws from them."""

import base64
import json
import zlib
from pathlib import Path

import pytest

from tests import chromium
from tests.conftest import known
from viewbench.reports import _tracked_view as view

LINK, MENU = view.PREFIX + view.KEY, view.PREFIX + view.KEY + "-menu"


def read(value: str) -> dict:
    """The state of a tag as MLflow's page reads it: pako's inflate of base64 is zlib's."""
    assert value.startswith("deflate;")
    return json.loads(zlib.decompress(base64.b64decode(value.removeprefix("deflate;"), validate=True)))


def figure(state: dict) -> list[str]:
    """Metrics of the charts in the first section."""
    first = state["compareRunSections"][0]
    assert first["name"] == view.FIGURE
    return [chart["metricKey"] for chart in state["compareRunCharts"] if chart["metricSectionId"] == first["uuid"]]


def test_both_tags_hold_the_same_view():
    panels = ["psnr_db/room", "psnr_db/kitchen/splat"]
    tags = view.tags(panels, 5)
    named = json.loads(tags[MENU])
    assert (named["name"], named["createdAt"], named["state"]) == (view.FIGURE, 5, tags[LINK])
    assert figure(read(tags[LINK])) == panels
    assert tags == view.tags(panels, 5) != view.tags(panels[::-1], 5)


@pytest.mark.parametrize(
    "scene", ["küche 2", "a'b\"c`d", "</script>", "部屋", "x" * 240, "a/b/c", "\\", "ratio_percent", "\ud800"]
)
def test_any_name_of_a_scene(scene: str):
    panel = f"psnr_db/{scene}"
    tags = view.tags([panel, "psnr_db/other", panel], 0)
    assert figure(read(tags[LINK])) == [panel, "psnr_db/other"]
    assert all(value.isascii() for value in tags.values())


@pytest.mark.parametrize("panels", [0, 1, 60, 400])
def test_tags_are_as_short_as_the_oldest_mlflow_wants(panels: int):
    """60 are 20 scenes times 3 backends."""
    wanted = [f"psnr_db/scene_{i // 3:03d}/{('splat', 'gsplat', 'instant-ngp')[i % 3]}" for i in range(panels)]
    tags = view.tags(wanted, 1_800_000_000_000)
    assert max(map(len, tags.values())) <= 5000
    shown = figure(read(tags[LINK]))
    assert shown == wanted[: len(shown)]
    assert len(shown) == panels or panels == 400
    charts = [chart["uuid"] for chart in read(tags[LINK])["compareRunCharts"]]
    assert len(set(charts)) == len(charts)


def test_names_that_no_tag_has_room_for():
    hashes = [f"psnr_db/{view.hashlib.sha512(bytes([i])).hexdigest()}" for i in range(100)]
    shown = figure(read(view.tags(hashes, 0)[LINK]))
    assert 10 < len(shown) < 100


@pytest.mark.slow
@pytest.mark.skipif(chromium.find() is None, reason="no Chromium on this machine")
def test_the_page_draws_the_figure(tmp_path: Path):
    """A real server and a real browser: the link shows the summary runs alone, each with its colour, over the ratio."""
    mlflow = pytest.importorskip("mlflow")
    from mlflow.entities import Metric, Param

    from tests.reports.mlflow_server import Server

    ratios = {50: 0.5, 100: 1.0, 2000: 20.0}  # steps in hundredths of a percent
    colours = {"maxmin": "#0072b2", "uniform": "#d55e00", "full": "#444444"}
    server = Server(tmp_path).start()
    try:
        client = mlflow.MlflowClient(server.url)
        experiment = client.create_experiment("study")
        panels = [f"psnr_db/{scene}" for scene in ("room 1", "kitchen-2.b")]
        want = {panel: {} for panel in panels}
        for height, panel in enumerate(panels):
            for selector, colour in colours.items():
                tags = {view.KIND: view.SUMMARY, "mlflow.runColor": colour}
                run = client.create_run(experiment, tags=tags, run_name=selector).info.run_id
                y = [20 + height + ratio / 3 for ratio in ratios.values()] if selector != "full" else [31.0] * 3
                metrics = [Metric(view.X, ratio, 0, step) for step, ratio in ratios.items()]
                for name in (panel, "psnr_db", "ssim", "train_s"):
                    metrics += [Metric(name, value, 0, step) for step, value in zip(ratios, y, strict=True)]
                client.log_batch(run, metrics=metrics, params=[Param("scene", panel), Param("selector", selector)])
                client.create_run(experiment, tags={"mlflow.parentRunId": run, view.KIND: "cell"}, run_name="a cell")
                want[panel][colour] = [list(ratios.values()), y]
        for key, value in view.tags(panels, 0).items():
            client.set_experiment_tag(experiment, key, value)
        with chromium.Page(known(chromium.find()), 1400, 1800) as page:
            page.open(view.link(server.url, experiment))
            page.wait("document.querySelectorAll('.js-plotly-plot .scatterlayer .trace').length >= 4 * 3")
            plots = page.value(
                "[...document.querySelectorAll('.js-plotly-plot')].map(plot => plot.data.filter(line => line.x?.length)"
                ".map(line => [line.marker.color, line.mode, [...line.x], [...line.y]]))"
            )
            text = page.text()
    finally:
        server.stop()
    lines = [{colour: [x, y] for colour, mode, x, y in plot if "markers" in mode} for plot in plots[:2]]
    assert lines == [want[panel] for panel in panels]
    at = [text.index(words) for words in (view.FIGURE, *panels, view.FURTHER, view.OTHERS)]
    assert at == sorted(at)
    assert "a cell" not in text
    assert "6 matching runs" in text
    if tuple(map(int, mlflow.__version__.split(".")[:2])) >= (3, 17):
        assert "shared view" in text
