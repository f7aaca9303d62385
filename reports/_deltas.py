"""Differences to uniform choice, published and of a study, and the figure that shows them side by side."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes

from . import _figures, _published
from ._published import DATASETS, MODELS, Score
from ._statistics import Summary, signed, summary
from ._study import Study, in_order, percent
from ._style import Style, styles

BASELINE = "uniform"
PAPER_RATIO = 0.05  # a study is shown at its ratio nearest to this
LIMIT_DB = 4.5  # differences beyond this are drawn at the edge with their figure, so that the others can be read


@dataclass(frozen=True)
class Delta:
    """Difference of a selector's mean PSNR to that of uniform choice, in dB, with its standard error."""

    group: str
    scene: str
    selector: str
    mean_db: float
    error_db: float | None  # sqrt(s₁²/n₁ + s₂²/n₂); None where a side is one sample
    ours: bool  # measured by the study, not published


def of_study(study: Study) -> list[Delta]:
    """The study's differences, at its ratio nearest to the paper's; none where it has no uniform choice."""
    ratio = min(study.ratios, key=lambda value: abs(math.log(value / PAPER_RATIO)))
    deltas = []
    for backend, scene in study.panels():
        found = {name: _psnr(study, backend, scene, name, ratio) for name in study.selectors}
        base = found.pop(BASELINE, None)
        if base is not None:
            group = f"this study: {backend}, {percent(ratio)}"
            deltas += [_delta(group, scene, name, item, base, True) for name, item in found.items() if item is not None]
    return deltas


def of_paper(scores: Sequence[Score]) -> list[Delta]:
    """The paper's differences."""
    base = {(score.model, score.scene): _published.summary_of(score) for score in scores if score.selector == BASELINE}
    return [
        _delta(
            f"{MODELS[score.model]}, {DATASETS[score.dataset]}, {percent(score.ratio)}",
            score.scene,
            score.selector,
            _published.summary_of(score),
            base[score.model, score.scene],
            False,
        )
        for score in scores
        if score.selector != BASELINE
    ]


def figure(deltas: Sequence[Delta], out: Path, name: str) -> tuple[str, ...]:
    """One row per scene, under the heading of its group; the study's rows are shaded. Returns the file names."""
    drawn = styles(in_order(delta.selector for delta in deltas))
    rows, headings, end = _rows(deltas)
    low = max(-LIMIT_DB, min(0.0, *(delta.mean_db for delta in deltas)) - 0.3)
    high = min(LIMIT_DB, max(0.0, *(delta.mean_db for delta in deltas)) + 0.3)
    with _figures.look():
        drawing, (axes,) = _figures.grid(1, 8.2, 0.21 * end + 0.9)
        for delta in deltas:
            _mark(axes, delta, rows[delta.group, delta.scene], drawn, (low, high))
        for group, at in headings.items():
            axes.annotate(group, (low, at), fontsize=8.5, fontweight="bold", va="center", annotation_clip=False)
        ours = [rows[delta.group, delta.scene] for delta in deltas if delta.ours]
        if ours:
            axes.axhspan(-0.6, max(ours) + 0.6, color="#FFF6DF", zorder=0)
        axes.axvline(0, color="black", linewidth=1)
        axes.set_yticks(list(rows.values()), [scene for _, scene in rows])
        axes.set(ylim=(end, -0.8), xlim=(low - 0.1, high + 0.1))
        axes.set_xlabel("Δ PSNR to uniform (dB); right of the line is better than uniform")
        _figures.legend(drawing, drawn, lines=False)
        return _figures.save(drawing, out, name, [_record(delta) for delta in deltas])


def _psnr(study: Study, backend: str, scene: str, selector: str, ratio: float) -> Summary | None:
    values = [cell.psnr_db for cell in study.find(backend, scene, selector, ratio) if cell.psnr_db is not None]
    return summary(values) if values else None


def _delta(group: str, scene: str, selector: str, item: Summary, base: Summary, ours: bool) -> Delta:
    error = None
    if item.std is not None and base.std is not None:
        error = math.sqrt(item.variance_of_mean + base.variance_of_mean)
    return Delta(group, scene, selector, item.mean - base.mean, error, ours)


def _rows(deltas: Sequence[Delta]) -> tuple[dict[tuple[str, str], float], dict[str, float], float]:
    """Heights of the rows by (group, scene), of the headings by group, and of the end of the last row."""
    rows: dict[tuple[str, str], float] = {}
    headings: dict[str, float] = {}
    line = 0.0
    for group in in_order(delta.group for delta in deltas):
        headings[group], line = line, line + 1
        for scene in in_order(delta.scene for delta in deltas if delta.group == group):
            rows[group, scene], line = line, line + 1
        line += 0.3
    return rows, headings, line


def _mark(axes: Axes, delta: Delta, row: float, drawn: dict[str, Style], limits: tuple[float, float]) -> None:
    """A marker with its standard error; at the edge, with its figure, where it is beyond the limits."""
    style = drawn[delta.selector]
    # The selectors of a row stand one below the other, so that equal ones do not hide each other.
    at = row + 0.5 * ((list(drawn).index(delta.selector) + 0.5) / len(drawn) - 0.5)
    face = style.colour if delta.error_db is not None else "white"
    inside = min(max(delta.mean_db, limits[0]), limits[1])
    error = delta.error_db if inside == delta.mean_db else None
    axes.errorbar(inside, at, xerr=error, color=style.colour, marker=style.marker, markerfacecolor=face, elinewidth=1)
    if inside != delta.mean_db:
        inward = 1 if inside < 0 else -1
        axes.annotate(
            signed(delta.mean_db, 1),
            (inside, at),
            (6 * inward, 0),
            textcoords="offset points",
            fontsize=7.5,
            color=style.colour,
            va="center",
            ha="left" if inward > 0 else "right",
        )


def _record(delta: Delta) -> dict[str, object]:
    return {
        "source": "this study" if delta.ours else "published",
        "group": delta.group,
        "scene": delta.scene,
        "selector": delta.selector,
        "delta_psnr_db": delta.mean_db,
        "standard_error_db": delta.error_db,
    }
