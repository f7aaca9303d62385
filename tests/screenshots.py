"""What people see of a study in MLflow, as pictures: its table, Figure 4, a cell, one of its renders, the first page.

    python -m tests.screenshots STORE FOLDER [--readme FILE] [--study NAME]          (or: make screenshots)

STORE is a SQLite file, such as results/mlflow.db, of which a copy is served, or the address of a server that runs.
FOLDER gets runs.png, figure_4.png, cell.png, render.png, first.png; --readme writes the second once more, with so few
colours that it has less than 150 kB. --study names the experiment; else it is the one changed last. Needs Chromium, and
says so where there is none. Raises AssertionError where a page does not come to show what it should.
"""

import argparse
import contextlib
import io
import json
import sqlite3
import sys
import tempfile
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from tests import chromium
from tests.reports.mlflow_server import Server
from viewbench.reports import _tracked_view as view

SIZE = (1400, 900)
README_BYTES = 150_000
PICTURES = (".png", ".jpg", ".jpeg")
# The panel that newer versions open at the first visit, and the buttons of a chart, which a mouse over it shows.
TIDY = """
localStorage.setItem('mlflow.assistant.fab.autoOpenedOnFirstLoad_v1', 'true');
localStorage.setItem('mlflow.assistant.panelOpen_v1', 'false');
addEventListener('DOMContentLoaded', () => document.head.insertAdjacentHTML(
    'beforeend', '<style>.modebar-container { display: none }</style>'));
"""
ROWS = "document.querySelectorAll('[role=row][row-id]').length"
LINES = "document.querySelectorAll('.js-plotly-plot .scatterlayer .trace').length"
OPEN_ROW = """(() => {
    const button = document.querySelector('[role=row][row-id] [col-id*="Run Name"] button');
    button?.click();
    return Boolean(button);
})()"""


def main(arguments: list[str] | None = None) -> int:
    """Exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.screenshots", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("store")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--readme", type=Path)
    parser.add_argument("--study")
    options = parser.parse_args(arguments)
    program = chromium.find()
    if program is None:
        print("screenshots: no Chromium on this machine, so there are none (apt-get install chromium)", file=sys.stderr)
        return 0
    options.folder.mkdir(parents=True, exist_ok=True)
    with _served(options.store) as address:
        study = Study(address, options.study)
        with chromium.Page(program, *SIZE) as page:
            page.before(TIDY)
            for path in shoot(page, study, options.folder):
                print(path)
    if options.readme:
        small(options.folder / "figure_4.png", options.readme)
        print(options.readme)
    return 0


@contextlib.contextmanager
def _served(store: str) -> Iterator[str]:
    if store.startswith(("http://", "https://")):
        yield store.rstrip("/")
        return
    path = Path(store.removeprefix("sqlite:///"))
    assert path.is_file(), f"{path}: no such file"
    with tempfile.TemporaryDirectory(prefix="viewbench-screenshots-") as folder:
        # A copy: the study may be running, and a server brings the tables of an older MLflow up to date.
        source = f"file:{urllib.parse.quote(str(path.resolve()))}?mode=ro"
        copy = Path(folder, "copy.db")
        with (
            contextlib.closing(sqlite3.connect(source, uri=True)) as old,
            contextlib.closing(sqlite3.connect(copy)) as new,
        ):
            old.backup(new)
        server = Server(Path(folder), store=f"sqlite:///{copy}").start()
        try:
            yield server.url
        finally:
            server.stop()


class Study:
    """What a server knows of an experiment."""

    def __init__(self, address: str, name: str | None):
        self.address = address
        found = self.ask("experiments/search", max_results=1000)["experiments"]
        named = [one for one in found if one["name"] == (name or one["name"]) and one["experiment_id"] != "0"]
        assert named, f"{address} has no experiment {name or ''}: {[one['name'] for one in found]}"
        newest = max(named, key=lambda one: int(one["last_update_time"]))
        self.id, self.tags = newest["experiment_id"], {tag["key"]: tag["value"] for tag in newest.get("tags", [])}

    def ask(self, what: str, **body: Any) -> dict[str, Any]:
        """The answer of MLflow's REST interface."""
        url = f"{self.address}/api/2.0/mlflow/{what}"
        if what == "artifacts/list":
            request = urllib.request.Request(f"{url}?{urllib.parse.urlencode(body)}")
        else:
            request = urllib.request.Request(url, json.dumps(body).encode(), {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    def runs(self, kind: str) -> list[str]:
        """Ids of up to 100 runs of a kind."""
        wanted = f"tags.`{view.KIND}` = '{kind}'"
        found = self.ask("runs/search", experiment_ids=[self.id], filter=wanted, max_results=100)
        return [run["info"]["run_id"] for run in found.get("runs", [])]

    def picture(self, run: str, folder: str = "") -> str | None:
        """Path of the first picture among a run's artifacts, or None."""
        files = self.ask("artifacts/list", run_id=run, **({"path": folder} if folder else {})).get("files", [])
        below = [self.picture(run, one["path"]) for one in files if one.get("is_dir")]
        here = [one["path"] for one in files if one["path"].endswith(PICTURES)]
        return next(filter(None, [*below, *here]), None)

    def page(self, run: str, rest: str = "") -> str:
        """Address of a run's page."""
        return view.run_link(self.address, self.id, run, rest)


def shoot(page: chromium.Page, study: Study, folder: Path) -> Iterator[Path]:
    """Takes the pictures, and names each."""

    def taken(name: str) -> Path:
        page.picture(folder / f"{name}.png")
        return folder / f"{name}.png"

    page.open(view.runs_link(study.address, study.id))
    page.wait(f"{ROWS} > 0")
    before = page.value(ROWS)
    if page.value(OPEN_ROW):
        page.wait(f"{ROWS} > {before}")
    yield taken("runs")
    assert view.PREFIX + view.KEY in study.tags, f"{study.address}: experiment {study.id} has no view of the figure"
    page.open(view.link(study.address, study.id))
    page.wait(f"{LINES} > 1")
    yield taken("figure_4")
    cells = study.runs("cell")
    with_picture = [(cell, picture) for cell in cells[:10] if (picture := study.picture(cell))]
    if cells:
        page.open(study.page(with_picture[0][0] if with_picture else cells[0]))
        page.wait("document.body.innerText.includes('Duration')")
        yield taken("cell")
    if with_picture:
        cell, picture = with_picture[0]
        page.open(study.page(cell, f"/artifacts/{urllib.parse.quote(picture)}"))
        page.wait("[...document.images].some(image => image.src.startsWith('blob:') && image.naturalWidth)")
        yield taken("render")
    page.open(f"{study.address}/#/experiments/{study.id}")
    page.wait("document.body.innerText.length > 200")
    yield taken("first")


def small(source: Path, path: Path) -> None:
    """Writes the picture with as many colours, up to 256, as 150 kB have room for."""
    picture = Image.open(source).convert("RGB")
    for colours in (256, 128, 64, 32):
        buffer = io.BytesIO()
        picture.quantize(colours, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
        if buffer.tell() < README_BYTES:
            break
    assert buffer.tell() < README_BYTES, f"{source}: {buffer.tell()} bytes with {colours} colours"
    path.write_bytes(buffer.getvalue())


if __name__ == "__main__":
    sys.exit(main())
