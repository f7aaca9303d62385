"""The paper's published numbers, drawn the same way, beside this study's."""

from collections.abc import Sequence
from pathlib import Path

from . import _deltas, _published, _tables
from ._deltas import Delta
from ._items import Item
from ._published import DATASETS, MODELS, SAMPLES, Score
from ._statistics import number, signed, summary, with_spread
from ._study import Study, in_order, percent
from ._tables import Entry, Table

ORDER = 70
AS_RUN = (
    "The published z_DPP was drawn from the k-DPP, as the authors' code does, and is called logdet-sample; logdet is "
    "the greedy maximiser that the paper defines, whose views are more spread out. The published Uniform is a "
    "linspace, shifted and wrapped, which always has two neighbouring frames; viewbench's own takes equal steps."
)
SOURCE = "“Diversity-Driven View Subset Selection for Indoor Novel View Synthesis”, TMLR 2025"


def build(study: Study, out: Path) -> list[Item]:
    """The differences to uniform, published and ours; then the paper's tables."""
    synthetic, real = _published.scores("table1_synthetic"), _published.scores("table2_real")
    deltas = _deltas.of_study(study) + _deltas.of_paper([*synthetic, *real])
    return [
        _figure(deltas, out),
        _means(deltas, out),
        _scores(synthetic, "Published: synthetic scenes", "published_synthetic", out),
        _scores(real, "Published: real scenes, 3DGS", "published_real", out),
        _ablation(out),
        _times(out),
    ]


def _figure(deltas: Sequence[Delta], out: Path) -> Item:
    files = _deltas.figure(deltas, out, "published_differences")
    shaded = any(delta.ours for delta in deltas)
    mine = "The shaded rows are this study. " if shaded else "This study has no uniform choice to compare with. "
    caption = (
        f"Difference of mean test PSNR to uniform choice on the scenes of {SOURCE}, as published, and on this "
        f"study's. {mine}Bars: standard error of the difference (five published sample sets; this study's seeds); "
        "hollow markers have a single sample on one side. A marker at the edge with a figure lies beyond it. Compare "
        "signs and order, not sizes: scenes, trainers, picture sizes and budgets differ. " + AS_RUN
    )
    return Item("Differences to uniform, published and measured here", "figure", caption, files)


def _means(deltas: Sequence[Delta], out: Path) -> Item:
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
        best: dict[tuple[str, str], bool] = {}
        for scene in scenes:
            column = [score for score in scores if (score.model, score.scene) == (model, scene)]
            marks = _tables.best([score.psnr_db for score in column], 2)
            best |= {(score.selector, scene): mark for score, mark in zip(column, marks, strict=True)}
        for selector in in_order(score.selector for score in scores):
            found = {s.scene: s for s in scores if (s.model, s.selector) == (model, selector)}
            row = [Entry(MODELS[model]), Entry(selector)]
            for scene in scenes:
                text = with_spread(_published.summary_of(found[scene]), 2, SAMPLES)
                row.append(Entry(text, found[scene].psnr_db, best[selector, scene]))
            rows.append(tuple(row))
    table = Table(("model", "selector", *scenes), tuple(rows), 2)
    records = [vars(score) for score in scores]
    files = _tables.save(table, out, name, records)
    ratios: dict[str, str] = {}
    for score in scores:
        ratios.setdefault(DATASETS[score.dataset], percent(score.ratio))
    shares = ", ".join(f"{dataset} at {share}" for dataset, share in ratios.items())
    caption = (
        f"PSNR in dB, mean ± standard deviation over five sample sets, as published in {SOURCE}; {shares} of the "
        "views. coverage (z_CF) is one sample; logdet-sample is z_DPP, which was sampled and not maximised. Bold: the "
        "best per model and scene."
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
