"""The paper's published numbers, drawn the same way, beside this study's."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes

from viewbench.reports import _figures, _published, _tables
from viewbench.reports._items import Item
from viewbench.reports._published import DATASETS, MODELS, SAMPLES, Score
from viewbench.reports._statistics import Summary, number, signed, summary, with_spread
from viewbench.reports._study import Study, in_order, percent
from viewbench.reports._style import Style, styles
from viewbench.reports._tables import Entry, Table

ORDER = 70
BASELINE = "uniform"
PAPER_RATIO = 0.05
SOURCE = "“Diversity-Driven View Subset Selection for Indoor Novel View Synthesis”, TMLR 2025"
LIMIT_DB = 4.5  # differences beyond this are drawn at the edge with their figure, so that the others can be read


@dataclass(frozen=True)
class Delta:
    """Difference of a selector's mean PSNR to that of uniform choice, in dB, with its standard error."""

    group: str
    scene: str
    selector: str
    mean_db: float
    error_db: float | None  # sqrt(s₁²/n₁ + s₂²/n₂); None where a side is one sample
    ours: bool


def build(study: Study, out: Path) -> list[Item]:
    """The differences to uniform, published and ours; then the paper's tables."""
    synthetic, real = _published.scores("table1_synthetic"), _published.scores("table2_real")
    deltas = _ours(study) + _theirs([*synthetic, *real])
    return [
        _figure(deltas, study, out),
        _means(deltas, out),
        _scores(synthetic, "Published: synthetic scenes", "published_synthetic", out),
        _scores(real, "Published: real scenes, 3DGS", "published_real", out),
        _ablation(out),
        _times(out),
    ]


def _ours(study: Study) -> list[Delta]:
    if not study.ratios:
        return []
    ratio = min(study.ratios, key=lambda value: abs(math.log(value / PAPER_RATIO)))
    deltas = []
    for backend, scene in study.panels():
        found = {name: _psnr(study, backend, scene, name, ratio) for name in study.selectors}
        base = found.get(BASELINE)
        if base is None:
            continue
        group = f"this study: {backend}, {percent(ratio)}"
        deltas += [
            _delta(group, scene, name, item, base, True)
            for name, item in found.items()
            if item is not None and name != BASELINE
        ]
    return deltas


def _psnr(study: Study, backend: str, scene: str, selector: str, ratio: float) -> Summary | None:
    values = [cell.psnr_db for cell in study.find(backend, scene, selector, ratio) if cell.psnr_db is not None]
    return summary(values) if values else None


def _theirs(scores: Sequence[Score]) -> list[Delta]:
    base = {(score.model, score.scene): _published_summary(score) for score in scores if score.selector == BASELINE}
    return [
        _delta(
            f"{MODELS[score.model]}, {DATASETS[score.dataset]}, {percent(score.ratio)}",
            score.scene,
            score.selector,
            _published_summary(score),
            base[score.model, score.scene],
            False,
        )
        for score in scores
        if score.selector != BASELINE
    ]


def _published_summary(score: Score) -> Summary:
    return Summary(score.psnr_db, score.psnr_std_db, 1 if score.psnr_std_db is None else SAMPLES)


def _delta(group: str, scene: str, selector: str, item: Summary, base: Summary, ours: bool) -> Delta:
    error = None
    if item.std is not None and base.std is not None:
        error = math.sqrt(item.std**2 / item.n + base.std**2 / base.n)
    return Delta(group, scene, selector, item.mean - base.mean, error, ours)


def _figure(deltas: list[Delta], study: Study, out: Path) -> Item:
    drawn = styles(in_order(delta.selector for delta in deltas))
    rows = in_order((delta.group, delta.scene) for delta in deltas)
    groups = in_order(group for group, _ in rows)
    # Group headings take a row each.
    places: dict[tuple[str, str], float] = {}
    headings: dict[str, float] = {}
    line = 0.0
    for group in groups:
        headings[group], line = line, line + 1
        for row in (row for row in rows if row[0] == group):
            places[row], line = line, line + 1
        line += 0.3
    with _figures.look():
        low = max(-LIMIT_DB, min(0.0, *(delta.mean_db for delta in deltas)) - 0.3)
        high = min(LIMIT_DB, max(0.0, *(delta.mean_db for delta in deltas)) + 0.3)
        figure, (axes,) = _figures.grid(1, 8.2, 0.21 * line + 0.9)
        for delta in deltas:
            _mark(axes, delta, places[delta.group, delta.scene], drawn, low, high)
        axes.axvline(0, color="black", linewidth=1)
        for group, at in headings.items():
            axes.annotate(group, (low, at), fontsize=8.5, fontweight="bold", va="center", annotation_clip=False)
        axes.set_yticks(list(places.values()), [scene for _, scene in places])
        axes.set(ylim=(line, -0.8), xlim=(low - 0.1, high + 0.1))
        axes.set_xlabel("Δ PSNR to uniform (dB); right of the line is better than uniform")
        ours = [at for (group, _), at in places.items() if group.startswith("this study")]
        if ours:
            axes.axhspan(-0.6, max(ours) + 0.6, color="#FFF6DF", zorder=0)
        _figures.legend(figure, drawn, lines=False)
        records = [
            {
                "group": delta.group,
                "scene": delta.scene,
                "selector": delta.selector,
                "delta_psnr_db": delta.mean_db,
                "standard_error_db": delta.error_db,
                "source": "this study" if delta.ours else "published",
            }
            for delta in deltas
        ]
        files = _figures.save(figure, out, "published_differences", records)
    mine = "The shaded rows are this study. " if ours else "This study has no uniform choice to compare with. "
    caption = (
        f"Difference of mean test PSNR to uniform choice, on the scenes of {SOURCE}, as published, and on this "
        f"study's. {mine}Bars: standard error of the difference (five published sample sets; this study's seeds); "
        "hollow markers have a single sample on one side. Figures at the edge are beyond it. Compare signs and "
        "order, not sizes: scenes, trainers, picture sizes and budgets differ."
    )
    return Item("Differences to uniform, published and measured here", "figure", caption, files)


def _mark(axes: Axes, delta: Delta, row: float, drawn: dict[str, Style], low: float, high: float) -> None:
    style = drawn[delta.selector]
    names = list(drawn)
    at = row + 0.5 * ((names.index(delta.selector) + 0.5) / len(names) - 0.5)
    inside = max(low, min(high, delta.mean_db))
    face = style.colour if delta.error_db is not None else "white"
    error = delta.error_db if inside == delta.mean_db else None
    axes.errorbar(inside, at, xerr=error, color=style.colour, marker=style.marker, markerfacecolor=face, elinewidth=1)
    if inside != delta.mean_db:
        side = 1 if inside < 0 else -1
        axes.annotate(
            signed(delta.mean_db, 1),
            (inside, at),
            (6 * side, 0),
            textcoords="offset points",
            fontsize=7.5,
            color=style.colour,
            va="center",
            ha="left" if side > 0 else "right",
        )


def _means(deltas: list[Delta], out: Path) -> Item:
    """Mean difference to uniform per group of scenes."""
    selectors = in_order(delta.selector for delta in deltas)
    rows, records = [], []
    for group in in_order(delta.group for delta in deltas):
        here = [delta for delta in deltas if delta.group == group]
        scenes = in_order(delta.scene for delta in here)
        means: list[float | None] = []
        for selector in selectors:
            values = [delta.mean_db for delta in here if delta.selector == selector]
            means.append(summary(values).mean if values else None)
            if values:
                records.append(
                    {"group": group, "selector": selector, "scenes": len(values), "delta_psnr_db": means[-1]}
                )
        marks = _tables.best(means, 2)
        row = [Entry(group), Entry(str(len(scenes)), len(scenes))]
        row += [
            Entry("" if value is None else signed(value), value, mark) for value, mark in zip(means, marks, strict=True)
        ]
        rows.append(tuple(row))
    table = Table(("scenes of", "scenes", *selectors), tuple(rows), 2)
    files = _tables.save(table, out, "published_means", records)
    caption = "Δ PSNR to uniform in dB, mean over the scenes of a group. Bold: the largest of the row."
    return Item("Mean difference to uniform, published and measured here", "table", caption, files, table)


def _scores(scores: list[Score], title: str, name: str, out: Path) -> Item:
    scenes = in_order(score.scene for score in scores)
    rows = []
    for model in in_order(score.model for score in scores):
        best = {}
        for scene in scenes:
            column = [score for score in scores if (score.model, score.scene) == (model, scene)]
            marks = _tables.best([score.psnr_db for score in column], 2)
            best |= {(score.selector, scene): mark for score, mark in zip(column, marks, strict=True)}
        for selector in in_order(score.selector for score in scores):
            found = {s.scene: s for s in scores if (s.model, s.selector) == (model, selector)}
            row = [Entry(MODELS[model]), Entry(selector)]
            for scene in scenes:
                text = with_spread(_published_summary(found[scene]), 2, SAMPLES)
                row.append(Entry(text, found[scene].psnr_db, best[selector, scene]))
            rows.append(tuple(row))
    table = Table(("model", "selector", *scenes), tuple(rows), 2)
    records = [vars(score) for score in scores]
    files = _tables.save(table, out, name, records)
    ratios = {}
    for score in scores:
        ratios.setdefault(DATASETS[score.dataset], percent(score.ratio))
    shares = ", ".join(f"{dataset} at {share}" for dataset, share in ratios.items())
    caption = (
        f"PSNR in dB, mean ± standard deviation over five sample sets, as published in {SOURCE}; {shares} of the "
        "views. coverage (z_CF) is one sample. Bold: the best per model and scene."
    )
    return Item(title, "table", caption, files, table)


def _ablation(out: Path) -> Item:
    found = _published.ablations()
    scenes = in_order(item.scene for item in found)
    rows = []
    for model in in_order(item.model for item in found):
        here = {(item.factors, item.scene): item.psnr_db for item in found if item.model == model}
        kinds = in_order(factors for factors, _ in here)
        best = {scene: max(here[kind, scene] for kind in kinds) for scene in scenes}
        for kind in kinds:
            figures = [Entry(number(here[kind, s], 2), here[kind, s], here[kind, s] == best[s]) for s in scenes]
            rows.append((Entry(MODELS[model]), Entry(kind.replace("+", " + ")), *figures))
    table = Table(("model", "factors", *scenes), tuple(rows), 2)
    files = _tables.save(table, out, "published_ablation", [vars(item) for item in found])
    caption = (
        f"PSNR in dB of maxmin by the factors of the similarity in use, at 5 % of the views, as published in {SOURCE}: "
        "pos is Dist3D, ang is Ang3D, sem is DistSem. Bold: the best per model and scene."
    )
    return Item("Published: ablation of the factors", "table", caption, files, table)


def _times(out: Path) -> Item:
    found = _published.selection_seconds()
    datasets = in_order(dataset for _, dataset in found)
    rows = []
    for selector in in_order(selector for selector, _ in found):
        printed = [found[selector, dataset] for dataset in datasets]
        figures = [Entry(text, 0.5 if text.startswith("<") else float(text)) for text in printed]
        rows.append((Entry(selector), *figures))
    table = Table(("selector", *(DATASETS[dataset] for dataset in datasets)), tuple(rows), 1)
    records = [{"selector": s, "dataset": d, "seconds": seconds} for (s, d), seconds in found.items()]
    files = _tables.save(table, out, "published_selection_time", records)
    caption = f"Seconds to choose the views, as published in {SOURCE}; coverage on a GPU."
    return Item("Published: time to choose", "table", caption, files, table)
