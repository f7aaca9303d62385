"""Scores per scene, ratio and selector, and the differences to uniform and random with their uncertainty."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from . import _findings, _tables
from ._items import Item
from ._statistics import (
    Difference,
    Summary,
    interval,
    summary,
    usual_n,
    with_spread,
)
from ._study import FULL, Cell, Study, failures_note, percent
from ._tables import Entry, Table

ORDER = 20


@dataclass(frozen=True)
class Metric:
    """One score: where it stands in a cell, and how it is printed."""

    name: str
    title: str
    unit: str
    digits: int
    lowest: bool  # whether less is better
    of: Callable[[Cell], float | None]


METRICS = (
    Metric("psnr", "PSNR", "dB", 2, False, lambda cell: cell.psnr_db),
    Metric("ssim", "SSIM", "0 to 1", 3, False, lambda cell: cell.ssim),
    Metric("lpips", "LPIPS", "AlexNet", 3, True, lambda cell: cell.lpips),
)


def build(study: Study, out: Path) -> list[Item]:
    """The differences first, then one table per metric that was measured."""
    items = [_differences(study, out)]
    items += [
        _scores(study, metric, out) for metric in METRICS if any(metric.of(cell) is not None for cell in study.done)
    ]
    return [item for item in items if item is not None]


def _scores(study: Study, metric: Metric, out: Path) -> Item:
    selectors = [name for name in (*study.selectors, FULL) if study.find(selector=name)]
    rows, records = [], []
    for backend, scene in study.panels():
        full = _summary(metric, study.find(backend, scene, FULL))
        for ratio in study.ratios_of(backend):
            here = {name: _summary(metric, study.find(backend, scene, name, ratio)) for name in study.selectors}
            found = {name: item for name, item in here.items() if item is not None}
            if not found:
                continue
            winners = _tables.best(
                [found[name].mean if name in found else None for name in study.selectors], metric.digits, metric.lowest
            )
            best = dict(zip(study.selectors, winners, strict=True))
            expected = usual_n(found.values())
            shown = {**here, FULL: full}
            count = next((c.count for c in study.find(backend, scene, ratio=ratio) if c.selector != FULL), None)
            row = [Entry(backend)] if len(study.backends) > 1 else []
            row += [Entry(scene), Entry(percent(ratio), ratio), Entry(str(count or ""), count)]
            for name in selectors:
                item = shown[name]
                if item is None:
                    row.append(Entry(""))
                    continue
                text = with_spread(item, metric.digits, item.n if name == FULL else expected)
                row.append(Entry(text, item.mean, best.get(name, False)))
                records.append(_record(metric, backend, scene, name, 1.0 if name == FULL else ratio, item))
            rows.append(tuple(row))
    head = ["backend"] if len(study.backends) > 1 else []
    labels = [*head, "scene", "ratio", "views"]
    table = Table((*labels, *selectors), tuple(rows), len(labels))
    distinct = list({tuple(record.values()): record for record in records}.values())
    files = _tables.save(table, out, f"table_{metric.name}", distinct)
    better = "lower" if metric.lowest else "higher"
    caption = (
        f"{metric.title} ({metric.unit}), mean over all test views; {better} is better. Mean ± sample standard "
        "deviation over seeds; a figure without ± is one sample. Bold: the best of the row as printed, which need not "
        f"be a difference that the seeds can tell (see the differences).{failures_note(study)}"
    )
    return Item(f"{metric.title} per scene and ratio", "table", caption, files, table)


def _differences(study: Study, out: Path) -> Item | None:
    """Δ PSNR of each selector to the plain ways of choosing, per ratio and over all of them."""
    baselines = [name for name in _findings.BASELINES if name in study.selectors]
    others = [name for name in study.selectors if name not in _findings.BASELINES]
    rows, records = [], []
    for backend, scene in study.panels():
        for baseline in baselines:
            for selector in others:
                total = _findings.against(study, backend, scene, selector, baseline)
                if total is None:
                    continue
                row = [Entry(backend)] if len(study.backends) > 1 else []
                row += [Entry(scene), Entry(selector), Entry(baseline)]
                for ratio in study.ratios if len(study.ratios) > 1 else ():
                    part = _findings.against(study, backend, scene, selector, baseline, (ratio,))
                    row.append(Entry("" if part is None else interval(part), None if part is None else part.mean))
                    if part is not None:
                        records.append(_difference_record(backend, scene, selector, baseline, percent(ratio), part))
                row += [Entry(interval(total), total.mean), Entry(total.verdict, total.mean)]
                rows.append(tuple(row))
                records.append(_difference_record(backend, scene, selector, baseline, "all", total))
    if not rows:
        return None
    head = ["backend"] if len(study.backends) > 1 else []
    labels = [*head, "scene", "selector", "against"]
    parts = [f"Δ at {percent(ratio)} (95 % interval)" for ratio in study.ratios] if len(study.ratios) > 1 else []
    table = Table((*labels, *parts, "Δ over all (95 % interval)", "in words, over all"), tuple(rows), len(labels))
    files = _tables.save(table, out, "table_differences", records)
    caption = (
        "Difference of mean PSNR in dB; positive means that the selector is better. In brackets: its 95 % interval. "
        "Over all ratios, each seed's PSNR is averaged over them. The seeds of the two selectors are compared by "
        "Welch's t interval, as independent ones: choices with equal seed numbers share no randomness. “Not told "
        "apart” means that the interval holds zero: the seeds differ among themselves by as much. By chance alone one "
        "interval in twenty leaves it out. Nothing here says how it is on other scenes."
    )
    return Item("Differences to uniform and random choice", "table", caption, files, table)


def _summary(metric: Metric, cells: list[Cell]) -> Summary | None:
    values = [value for cell in cells if (value := metric.of(cell)) is not None]
    return summary(values) if values else None


def _record(metric: Metric, backend: str, scene: str, selector: str, ratio: float, item: Summary) -> dict:
    name = "psnr_db" if metric.name == "psnr" else metric.name
    return {
        "backend": backend,
        "scene": scene,
        "selector": selector,
        "ratio": ratio,
        "n": item.n,
        f"{name}_mean": item.mean,
        f"{name}_std": item.std,
    }


def _difference_record(backend: str, scene: str, selector: str, baseline: str, ratio: str, item: Difference) -> dict:
    return {
        "backend": backend,
        "scene": scene,
        "selector": selector,
        "against": baseline,
        "ratio": ratio,
        "delta_psnr_db": item.mean,
        "low_95_db": item.low,
        "high_95_db": item.high,
        "verdict": item.verdict,
    }
