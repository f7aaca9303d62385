"""One panel of PSNR over ratio: mean and spread over seeds per selector, and the full-data line."""

import itertools
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes

from ._statistics import Summary, summary
from ._study import FULL, Cell, in_order, percent
from ._style import Style

SIDESTEP = 0.36  # selectors stand side by side at a ratio: the width they take of the gap to the next ratio


def summaries(cells: Sequence[Cell]) -> dict[tuple[str, float], Summary]:
    """PSNR in dB by (selector, ratio), over the seeds of the cells that have one."""
    values: dict[tuple[str, float], list[float]] = {}
    for cell in cells:
        if cell.psnr_db is not None:
            values.setdefault((cell.selector, cell.ratio), []).append(cell.psnr_db)
    return {key: summary(found) for key, found in values.items()}


def draw(axes: Axes, cells: Sequence[Cell], styles: dict[str, Style]) -> None:
    """Draws the cells of one scene and backend; `styles` names the selectors in their order."""
    found = summaries(cells)
    ratios = sorted({ratio for selector, ratio in found if selector != FULL})
    selectors = [name for name in styles if name != FULL and any(key[0] == name for key in found)]
    if len(ratios) > 1:
        _over_ratios(axes, found, ratios, selectors, styles)
        _ratio_ticks(axes, cells, ratios)
    else:
        _side_by_side(axes, found, selectors, styles)
        axes.set_xlabel(f"selector, at {percent(ratios[0])} of the training views" if ratios else "")
    full = found.get((FULL, 1.0))
    if full is not None:
        axes.axhline(full.mean, color=styles[FULL].colour, linestyle=styles[FULL].dash, linewidth=1.1, zorder=1)
    axes.set_ylabel("test PSNR (dB)")
    axes.margins(y=0.08)


def records(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """The numbers behind panels: one record a scene, backend, selector and ratio."""
    rows = []
    for backend, scene in in_order((cell.backend, cell.scene) for cell in cells):
        here = [cell for cell in cells if (cell.backend, cell.scene) == (backend, scene)]
        counts = {(cell.selector, cell.ratio): cell.count for cell in here}
        for (selector, ratio), item in summaries(here).items():
            rows.append(
                {
                    "backend": backend,
                    "scene": scene,
                    "selector": selector,
                    "ratio": ratio,
                    "count": counts[selector, ratio],
                    "n": item.n,
                    "psnr_mean_db": item.mean,
                    "psnr_std_db": item.std,
                }
            )
    return rows


def _over_ratios(
    axes: Axes,
    found: dict[tuple[str, float], Summary],
    ratios: list[float],
    selectors: list[str],
    styles: dict[str, Style],
) -> None:
    span = ratios[-1] / ratios[0]
    gap = min(after / before for before, after in itertools.pairwise(ratios))
    gap = min(gap, span**0.25)
    for place, selector in enumerate(selectors):
        step = gap ** (SIDESTEP * ((place + 0.5) / len(selectors) - 0.5))
        here = [(ratio, found[selector, ratio]) for ratio in ratios if (selector, ratio) in found]
        x = [ratio * step for ratio, _ in here]
        style = styles[selector]
        axes.plot(x, [item.mean for _, item in here], color=style.colour, linestyle=style.dash, zorder=2)
        for at, (_, item) in zip(x, here, strict=True):
            _point(axes, at, item, style)
    axes.set_xscale("log")
    axes.set_xlim(ratios[0] * span**-0.08, ratios[-1] * span**0.08)


def _ratio_ticks(axes: Axes, cells: Sequence[Cell], ratios: list[float]) -> None:
    from matplotlib.ticker import NullLocator

    counts = {cell.ratio: cell.count for cell in cells if cell.selector != FULL}
    axes.set_xticks(ratios, [f"{ratio * 100:.4g}\n{counts[ratio]}" for ratio in ratios])
    axes.xaxis.set_minor_locator(NullLocator())
    n_views = next((cell.n_views for cell in cells if cell.n_views), None)
    axes.set_xlabel(f"ratio (%), and number of the {n_views} training views" if n_views else "ratio (%)")


def _side_by_side(
    axes: Axes, found: dict[tuple[str, float], Summary], selectors: list[str], styles: dict[str, Style]
) -> None:
    for place, selector in enumerate(selectors):
        for (name, _), item in found.items():
            if name == selector:
                _point(axes, place, item, styles[selector])
    axes.set_xticks(range(len(selectors)), selectors)
    axes.set_xlim(-0.6, max(len(selectors), 1) - 0.4)


def _point(axes: Axes, x: float, item: Summary, style: Style) -> None:
    """A filled marker with a bar of one standard deviation, or a hollow one for a single sample."""
    face = style.colour if item.std is not None else "white"
    axes.errorbar(
        x, item.mean, yerr=item.std, color=style.colour, marker=style.marker, markerfacecolor=face, capsize=2, zorder=3
    )
