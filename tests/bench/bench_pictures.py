"""What the pictures of a run cost, beside the same figures by matplotlib: processor time and bytes.

    python tests/bench/bench_pictures.py results/STUDY [--cells 40]

STUDY is finished. Of cells at equal steps one strip and the chosen cameras are drawn and encoded, in turn with the
reports' own drawing of the same by matplotlib, as PNG alone. Milliseconds of the processor's time, the median and the
slowest tenth, the first cell not counted; `records` is reading the four JSON files that they are drawn from, `scene`
what is drawn once for all cells of a scene. The share is that of --views strips and the cameras, without either, in
what the cell's steps took.
"""

import argparse
import io
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common.cells import AXES, cell_folder, figures, read_records
from viewbench.common.files import read_json
from viewbench.reports import _figures, _run_pictures, _topview
from viewbench.reports import cameras as report
from viewbench.reports._run_cameras import cameras, room_of
from viewbench.reports._style import Style, styles
from viewbench.reports.renders import _picture, _show


def main() -> None:
    """Prints a line for each kind of picture."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("study", type=Path)
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--views", type=int, default=4)
    given = parser.parse_args()
    found = sorted(path.parent for path in given.study.glob("cells/*/*/*/*/*/metrics.json"))
    spent: dict[str, list[float]] = {}
    sizes: dict[str, list[int]] = {}
    shares = []

    def timed(what: str, draw: Callable[[], Any]) -> Any:
        began = time.process_time()
        drawn = draw()
        spent.setdefault(what, []).append(1e3 * (time.process_time() - began))
        if isinstance(drawn, bytes):
            sizes.setdefault(what, []).append(len(drawn))
        return drawn

    for place in np.linspace(0, len(found) - 1, min(given.cells, len(found))).round().astype(int):
        cell: dict[str, str] = dict(zip(AXES, found[place].parts[-5:], strict=True))
        folder, scenes = cell_folder(given.study, cell), given.study / "scenes"

        def records(cell=cell, folder=folder, scenes=scenes) -> Any:
            return [*read_records(folder), read_json(scenes / f"{cell['scene']}.json", "scene")]

        selection, train, metrics, scene = timed("records", records)
        view = _run_pictures.views_to_show(metrics, given.views)[place % given.views]
        render, truth = _run_pictures.files_of(view, folder, scenes / cell["scene"])
        words, style = _run_pictures.words_of(view), styles([cell["selector"]])[cell["selector"]]
        timed("strip", lambda: _run_pictures.encoded(_run_pictures.strip(render, truth, words)))  # noqa: B023
        timed("strip, matplotlib", lambda: strip_by_matplotlib(render, truth, words))  # noqa: B023
        room = timed("scene", lambda: room_of(scene))  # noqa: B023
        timed("cameras", lambda: _run_pictures.encoded(cameras(room, selection, style.colour), ".png"))  # noqa: B023
        timed("cameras, matplotlib", lambda: cameras_by_matplotlib(scene, selection, style))  # noqa: B023
        steps = figures(selection, train, metrics)
        took = 1e3 * sum(steps[key] for key in ("select_s", "train_s", "evaluate_s"))
        shares.append((given.views * spent["strip"][-1] + spent["cameras"][-1]) / took)
    for what, times in spent.items():
        middle, slow = statistics.median(times[1:]), statistics.quantiles(times[1:], n=10)[-1]
        size = f"{statistics.median(sizes[what]):10,.0f} bytes, at most {max(sizes[what]):,}" if what in sizes else ""
        print(f"{what:20} {middle:7.1f} ms, slowest tenth {slow:7.1f} {size}")
    print(f"{given.views} strips and the cameras: {statistics.median(shares[1:]):.2%} of a cell's seconds")


def strip_by_matplotlib(render: Path, truth: Path | None, words: str) -> bytes:
    """The same three pictures, as the report draws its own."""
    drawn, compared = _picture(render), _picture(truth or render)
    apart = 4 * np.abs(drawn.astype(int) - compared).mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    with _figures.look():
        figure, axes = _figures.grid(3, 2.6, 2.8)
        pictures = (compared, drawn, np.minimum(apart, 255).astype(np.uint8))
        for at, picture, title in zip(axes, pictures, ("truth", "render", "difference"), strict=True):
            _show(at, picture, title, words if title == "truth" else "")
        return saved(figure)


def cameras_by_matplotlib(scene: dict[str, Any], selection: dict[str, Any], style: Style) -> bytes:
    """One panel of the report's figure."""
    train, forward = np.array(scene["train"]["positions"]), np.array(scene["train"]["forward"])
    test, points = np.array(scene["test"]["positions"]), np.array(scene["points"])[:, :3]
    plane = _topview.plane(train, forward)
    low, high = _topview.limits(np.vstack([train, test]) @ plane.T, points @ plane.T)
    indices = selection["indices"]
    with _figures.look():
        figure, (at,) = _figures.grid(1, 4.3, 3.2)
        report._backdrop(at, train @ plane.T, test @ plane.T, points @ plane.T)
        report._chosen(at, train[indices] @ plane.T, forward[indices] @ plane.T, style, max(high - low))
        at.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
        report._scale_bar(at, low, high)
        figure.legend(handles=report._handles(True), loc="outside lower center", ncols=2)
        return saved(figure)


def saved(figure: Any) -> bytes:
    """As PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


if __name__ == "__main__":
    main()
