"""What MLflow is told of a backend, scene and selector: its scores over the ratios, which draw the paper's Figure 4.

A summary is a run whose metrics have the ratio as their step, and whose children are the cells that it sums up. A ratio
is a *point*; points are added as they are complete, and a run of which one has changed is made anew.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from statistics import mean, stdev
from typing import Any

from ._about import About
from ._study import FULL
from ._tracked_cell import VERSION, Facts, common_tags, data_set
from ._tracked_run import SHARE, Content, Number, params

Group = tuple[str, str, str]  # backend, scene, selector
MEANS = ("psnr_db", "ssim", "lpips", "select_s", "train_s", "evaluate_s", "n_primitives")
SPREADS = ("psnr_db", "ssim")
PANELS = ("psnr_db", "ssim", "train_s")  # drawn for each scene by itself


def group_of(cell: Mapping[str, str]) -> Group:
    """The summary that a cell belongs to."""
    return cell["backend"], cell["scene"], cell["selector"]


def key_of(group: Group) -> str:
    """BACKEND/SCENE/SELECTOR."""
    return "/".join(group)


def by_group(cells: Iterable[Mapping[str, str]]) -> dict[Group, list[Mapping[str, str]]]:
    """The cells of each summary."""
    found: dict[Group, list[Mapping[str, str]]] = {}
    for cell in cells:
        found.setdefault(group_of(cell), []).append(cell)
    return found


def fingerprint(group: Group, about: About) -> str:
    """What its run carries: the hash of what it is called. Its numbers are compared point by point."""
    look = (about.summary_title(*group), about.colours.get(group[2]), about.panel(*group[:2]), about.unit)
    return hashlib.sha256(repr((group, look, VERSION)).encode()).hexdigest()


def content(group: Group, about: About, first: Facts, scene: dict[str, Any]) -> Content:
    """The run without a point; `first` are those of one of its cells."""
    backend, name, selector = group
    return Content(
        kind="summary",
        key=key_of(group),
        name=about.summary_title(*group),
        tags={**first.tags, **common_tags(about, selector, first.commit)},
        params=params({"backend": backend, "scene": name, "selector": selector, **first.named}),
        metrics=(),
        started_ms=first.began_ms,
        ended_ms=first.ended_ms,
        data=data_set(about, name, first.scene_sha256, scene),
    )


def points(group: Group, about: About, cells: Iterable[Facts]) -> dict[str, list[Number]]:
    """Metrics by ratio, as the grid spells it: means over the seeds, sample standard deviations where there are two.

    The reference on all views has one ratio, and a level line over the ratios of the others in its panel.
    """
    backend, scene, selector = group
    by_ratio: dict[str, list[Facts]] = {}
    for cell in cells:
        by_ratio.setdefault(cell.cell["ratio"], []).append(cell)
    found = {}
    for ratio, here in sorted(by_ratio.items(), key=lambda item: float(item[0])):
        values, stamp = _values(here), max(cell.ended_ms for cell in here)
        numbers = [(key, value, stamp, about.step(ratio)) for key, value in values.items()]
        drawn = [ratio, *(about.ratios_of(backend, scene) if selector == FULL else ())]
        numbers += [(SHARE, 100 * float(at), stamp, about.step(at)) for at in drawn]
        for key in PANELS:
            if key in values:
                panel = about.panel(backend, scene, key)
                numbers += [(panel, values[key], stamp, about.step(at)) for at in drawn[1:] or drawn]
        found[ratio] = numbers
    return found


def _values(cells: Sequence[Facts]) -> dict[str, float]:
    """The numbers of a point."""
    values: dict[str, float] = {"n_seeds": float(len(cells)), "count": float(cells[0].count)}
    for key in MEANS:
        here = [cell.figures[key] for cell in cells if key in cell.figures]
        if len(here) == len(cells):
            values[key] = mean(here)
            if key in SPREADS and len(here) > 1:
                values[f"{key}_std"] = stdev(here)
    return values
