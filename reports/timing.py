"""Seconds per stage and selector, and test PSNR over seconds of training."""

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from . import _figures, _tables
from ._items import Item
from ._statistics import summary
from ._study import FULL, Cell, Study, and_list, failures_note, in_order, percent
from ._style import Style, styles
from ._tables import Entry, Table

ORDER = 50
STAGES = ("select", "train", "evaluate")


def build(study: Study, out: Path) -> list[Item]:
    """The figure of stages, the table of the same with memory, and the training curves."""
    if not study.done:
        return []
    present = {cell.selector for cell in study.done}
    drawn = styles(name for name in (*study.selectors, FULL) if name in present)
    items = [_stages(study, drawn, out), _table(study, list(drawn), out), _training(study, drawn, out)]
    return [item for item in items if item is not None]


def _stages(study: Study, drawn: dict[str, Style], out: Path) -> Item:
    records = [
        {
            **{key: getattr(cell, key) for key in ("backend", "scene", "selector", "ratio", "seed")},
            **{f"{stage}_s": _seconds(cell, stage) for stage in STAGES},
        }
        for cell in study.done
    ]
    backends = [backend for backend in study.backends if study.find(backend)]
    with _figures.look():
        figure, axes = _figures.grid(3 * len(backends), 3.7, 0.32 * len(drawn) + 1.1)
        for number, place in enumerate(axes):
            backend, stage = backends[number // 3], STAGES[number % 3]
            _dots(place, [cell for cell in study.find(backend) if cell.select_s is not None], stage, drawn)
            place.set_title(stage if len(backends) == 1 else f"{stage} · {backend}")
        files = _figures.save(figure, out, "timing", records)
    caption = (
        "Wall time in seconds; one dot per cell over all scenes, ratios and seeds, the bar is the mean. Select counts "
        "the similarity and the choice but not the image features, which a scene needs once; it has a logarithmic "
        "axis, the others start at zero. A greedy order is made once for all ratios, and each has its time. Train "
        "leaves out set-up and the probes behind the curves. Cells that ran at the same time shared the machine."
        f"{_sharing(study)}{failures_note(study)}"
    )
    return Item("Time per stage", "figure", caption, files)


def _dots(axes: Axes, cells: list[Cell], stage: str, drawn: dict[str, Style]) -> None:
    for row, (selector, style) in enumerate(drawn.items()):
        values = [v for cell in cells if cell.selector == selector and (v := _seconds(cell, stage)) is not None]
        if stage == "select":
            values = [max(value, 1e-5) for value in values]  # a log axis has no zero; full takes none
        if not values or (stage == "select" and selector == FULL):
            continue
        axes.scatter(values, [row] * len(values), s=16, color=style.colour, alpha=0.45, linewidths=0)
        axes.plot([summary(values).mean] * 2, [row - 0.32, row + 0.32], color=style.colour, linewidth=2)
    axes.set_yticks(range(len(drawn)), drawn)
    axes.set_ylim(len(drawn) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    if stage == "select":
        _decades(axes)
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel("seconds")


def _decades(axes: Axes) -> None:
    """A logarithmic x axis over whole decades, labelled in plain numbers."""
    low, high = axes.get_xlim()
    axes.set_xscale("log")
    first, last = math.floor(math.log10(max(low, 1e-5))), math.ceil(math.log10(high))
    axes.set_xlim(10.0**first, 10.0**last)
    axes.set_xticks([10.0**power for power in range(first, last + 1)], [f"{10.0**p:g}" for p in range(first, last + 1)])
    axes.minorticks_off()


def _table(study: Study, selectors: list[str], out: Path) -> Item:
    rows, records = [], []
    for backend in study.backends:
        for selector in selectors:
            cells = study.find(backend, selector=selector)
            if not cells:
                continue
            means = {stage: _mean([_seconds(cell, stage) for cell in cells]) for stage in STAGES}
            memory = max((cell.peak_rss_bytes for cell in cells if cell.peak_rss_bytes), default=None)
            row = [Entry(backend), Entry(selector), Entry(str(len(cells)), len(cells))]
            row += [Entry("" if value is None else _three_digits(value), value) for value in means.values()]
            row.append(Entry("" if memory is None else f"{memory / 1e6:.0f}", memory))
            rows.append(tuple(row))
            records.append(
                {"backend": backend, "selector": selector, "cells": len(cells)}
                | {f"{stage}_s_mean": value for stage, value in means.items()}
                | {"peak_rss_bytes_max": memory}
            )
    columns = ("backend", "selector", "cells", "select (s)", "train (s)", "evaluate (s)", "peak memory (MB)")
    table = Table(columns, tuple(rows), 2)
    files = _tables.save(table, out, "table_timing", records)
    caption = "Means over all scenes, ratios and seeds in seconds of wall time; memory is the largest of the cells."
    return Item("Time and memory", "table", caption, files, table)


def _training(study: Study, drawn: dict[str, Style], out: Path) -> Item | None:
    """PSNR over training seconds at the middle ratio, one line per run; all ratios are in the CSV."""
    curves = [(cell, curve) for cell in study.done if (curve := _curve(cell))]
    shown = [
        (cell, curve)
        for cell, curve in curves
        if cell.ratio == study.middle_ratio(cell.backend) or cell.selector == FULL
    ]
    panels = [panel for panel in study.panels() if any((c.backend, c.scene) == panel for c, _ in shown)]
    if not panels:
        return None
    records = [
        {key: getattr(cell, key) for key in ("backend", "scene", "selector", "ratio", "seed")}
        | {"step": step, "train_s": seconds, "test_psnr_db": psnr}
        for cell, curve in curves
        for step, seconds, psnr in curve
    ]
    with _figures.look():
        figure, axes = _figures.grid(len(panels), 4.3, 3.2)
        for place, (backend, scene) in zip(axes, panels, strict=True):
            for cell, curve in shown:
                if (cell.backend, cell.scene) == (backend, scene):
                    style = drawn[cell.selector]
                    x, y = [point[1] for point in curve], [point[2] for point in curve]
                    place.plot(x, y, color=style.colour, linestyle=style.dash, linewidth=1.1, alpha=0.85)
            place.set(xlabel="training time (s)", ylabel="test PSNR (dB)", xlim=(0, None))
            place.set_title(study.label(backend, scene))
        present = [name for name in drawn if any(cell.selector == name for cell, _ in shown)]
        handles = [Line2D([], [], color=drawn[n].colour, linestyle=drawn[n].dash, label=n) for n in present]
        figure.legend(handles=handles, loc="outside lower center", ncols=6, handlelength=2.6)
        files = _figures.save(figure, out, "training_curves", records)
    ratios = and_list(percent(ratio) for ratio in in_order(study.middle_ratio(backend) for backend, _ in panels))
    caption = (
        f"PSNR of a few test views during training at {ratios} of the views; one line per seed. "
        "It is a probe of at most eight views, so its end differs from the score over all test views. A line that "
        "still climbs at its end means that the budget, not the choice of views, sets the score."
    )
    return Item("Test PSNR over training time", "figure", caption, files)


def _curve(cell: Cell) -> list[tuple[int, float, float]]:
    """(step, seconds, PSNR in dB) of the run's probes; points without a PSNR are steps that only logged the loss."""
    points = (
        (point["step"], point["seconds"], point["test_psnr_db"])
        for point in cell.read("train")["curve"]
        if point.get("test_psnr_db") is not None
    )
    return list(points)


def _sharing(study: Study) -> str:
    """A sentence where other programs used the GPU while models were trained; nothing where none did."""
    on_gpu = [gpu for cell in study.done if (gpu := cell.read("train").get("gpu"))]
    shared = sum(gpu["shared"] is True for gpu in on_gpu)
    unknown = sum(gpu["shared"] is None for gpu in on_gpu)
    said = f" {shared} of {len(on_gpu)} models were trained on a GPU that other programs used too." if shared else ""
    return said + (f" Of {unknown} models nobody can say whether their GPU was shared." if unknown else "")


def _seconds(cell: Cell, stage: str) -> float | None:
    value: float | None = getattr(cell, f"{stage}_s")
    return value


def _mean(values: list[Any]) -> float | None:
    known = [value for value in values if value is not None]
    return summary(known).mean if known else None


def _three_digits(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"
