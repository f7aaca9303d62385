"""The shared view of a study: what its tags hold, and what MLflow's page draws from them."""

import base64
import hashlib
import json
import urllib.parse
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from tests import chromium, screenshots
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
    hashes = [f"psnr_db/{hashlib.sha512(bytes([i])).hexdigest()}" for i in range(100)]
    shown = figure(read(view.tags(hashes, 0)[LINK]))
    assert 10 < len(shown) < 100


@pytest.mark.parametrize("server", ["http://127.0.0.1:5000", "https://host/mlflow/", ""])
def test_links(server: str):
    """The page's part of an address is after the #, and has no filter: the page would prefer it to the view's."""
    base, _, rest = view.link(server, "12/x").partition("#")
    assert base == (server.rstrip("/") + "/" if server else "")
    path, _, query = rest.partition("?")
    assert path == "/experiments/12%2Fx/runs"
    wanted = {"viewStateShareKey": ["viewbench"], "compareRunsMode": ["CHART"], "workflowType": ["machine_learning"]}
    assert urllib.parse.parse_qs(query) == wanted
    assert not set(wanted) & set(read(view.tags([], 0)[LINK]))


RATIOS = {50: 0.5, 100: 1.0, 2000: 20.0}  # steps in hundredths of a percent, percent
COLOURS = {"maxmin": "#0072b2", "uniform": "#d55e00", "full": "#444444"}


def test_further_charts_go_before_those_of_the_figure():
    panels, further = [f"psnr_db/{number:03}" for number in range(60)], [f"ssim/{number:03}" for number in range(400)]
    found = view.tags(panels, 0, further)
    assert all(len(value) <= view.LONGEST for value in found.values())
    drawn = [chart["metricKey"] for chart in read(found[LINK])["compareRunCharts"]]
    assert drawn[:60] == panels
    assert 0 < len(drawn) - 60 < 400


PANELS = ["psnr_db/room 1", "psnr_db/kitchen-2.b"]


def height(panel: str, selector: str) -> list[float]:
    """What is logged for the panel, of one run."""
    return [20 + PANELS.index(panel) + (20 if selector == "full" else ratio / 3) for ratio in RATIOS.values()]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a real server with a study; tests of a page are skipped where there is no browser."""
    if chromium.find() is None:
        pytest.skip("no Chromium on this machine")
    mlflow = pytest.importorskip("mlflow")
    from mlflow.entities import Metric, Param

    from tests.reports.mlflow_server import Server

    folder = tmp_path_factory.mktemp("view")
    Image.new("RGB", (64, 48), "teal").save(folder / "view.png")
    running = Server(folder).start()
    try:
        client = mlflow.MlflowClient(running.url)
        experiment = client.create_experiment("study")
        for panel in PANELS:
            for selector, colour in COLOURS.items():
                tags = {view.KIND: "summary", "mlflow.runColor": colour}
                run = client.create_run(experiment, tags=tags, run_name=selector).info.run_id
                metrics = [Metric(view.SHARE, ratio, 0, step) for step, ratio in RATIOS.items()]
                for name in (panel, "psnr_db", "ssim", "train_s"):
                    values = zip(RATIOS, height(panel, selector), strict=True)
                    metrics += [Metric(name, value, 0, step) for step, value in values]
                client.log_batch(run, metrics=metrics, params=[Param("scene", panel), Param("selector", selector)])
                tags = {"mlflow.parentRunId": run, view.KIND: "cell"}
                cell = client.create_run(experiment, tags=tags, run_name="a cell").info.run_id
                client.log_artifact(cell, folder / "view.png", "renders")
                for one in (cell, run):
                    client.set_terminated(one)
        for key, value in view.tags(PANELS, 0).items():
            client.set_experiment_tag(experiment, key, value)
        yield running.url
    finally:
        running.stop()


@pytest.mark.slow
def test_the_page_draws_the_figure(server: str):
    """The link shows the summary runs alone, each in its colour and over the ratio."""
    with chromium.Page(known(chromium.find()), 1400, 1800) as page:
        page.open(view.link(server, screenshots.Study(server, "study").id))
        page.wait(f"{screenshots.LINES} >= 4 * {len(COLOURS)}")
        plots = page.value(
            "[...document.querySelectorAll('.js-plotly-plot')].map(plot => plot.data.filter(line => line.x?.length)"
            ".map(line => [line.marker.color, line.mode, [...line.x], [...line.y]]))"
        )
        text = page.text()
    lines = [{colour: [x, y] for colour, mode, x, y in plot if "markers" in mode} for plot in plots]
    ratios = list(RATIOS.values())
    assert lines[:2] == [{COLOURS[name]: [ratios, height(panel, name)] for name in COLOURS} for panel in PANELS]
    at = [text.index(words) for words in (view.FIGURE, *PANELS, view.FURTHER, view.OTHERS)]
    assert at == sorted(at)
    assert "6 matching runs" in text
    assert "a cell" not in text


@pytest.mark.slow
def test_screenshots(server: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert screenshots.main([server, str(tmp_path), "--readme", str(tmp_path / "small.png")]) == 0
    names = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert names == ["runs.png", "figure_4.png", "cell.png", "render.png", "first.png", "small.png"]
    for name in names:
        with Image.open(tmp_path / name) as picture:
            assert picture.size == screenshots.SIZE
            assert len(known(picture.convert("RGB").getcolors(1 << 24))) > 20  # a blank page has one
    with Image.open(tmp_path / "figure_4.png") as picture:
        seen = {colour for _, colour in known(picture.convert("RGB").getcolors(1 << 24))}
    assert {tuple(bytes.fromhex(colour[1:])) for colour in COLOURS.values()} <= seen
    with Image.open(tmp_path / "render.png") as picture:
        assert (0, 128, 128) in {colour for _, colour in known(picture.convert("RGB").getcolors(1 << 24))}
    assert (tmp_path / "small.png").stat().st_size < 150_000


def test_screenshots_without_a_browser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert screenshots.main(["nothing.db", str(tmp_path / "out")]) == 0
    assert "no Chromium" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
