"""Where the chosen cameras are, seen from above, over the full path."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..common.errors import UserError
from . import _figures, _topview
from ._items import Item
from ._study import Cell, SceneInfo, Study, percent
from ._style import Style, styles

ORDER = 30


def build(study: Study, out: Path) -> list[Item]:
    """One figure per scene, one panel per selector, at the middle ratio and the first seed."""
    items = []
    for scene in study.scenes:
        # Every backend trains on the same choice: any one of them shows it.
        found = study.find(scene=scene, ratio=study.middle_ratio(), seed=study.first_seed)
        chosen = {cell.selector: cell for cell in reversed(found)}
        cells = [chosen[name] for name in study.selectors if name in chosen]
        if cells:
            items.append(_figure(study, study.scene(scene), cells, out))
    return items


def _figure(study: Study, scene: SceneInfo, cells: list[Cell], out: Path) -> Item:
    train, forward = np.array(scene.train_positions), np.array(scene.train_forward)
    test = np.array(scene.test_positions).reshape(-1, 3)
    points = np.array(scene.points, dtype=float).reshape(-1, 6)[:, :3]
    plane = _topview.plane(train, forward)
    flat_train, flat_test, flat_points = train @ plane.T, test @ plane.T, points @ plane.T
    low, high = _topview.limits(np.vstack([flat_train, flat_test]), flat_points)
    aspect = (high - low)[1] / (high - low)[0]
    drawn = styles(study.selectors)
    records = _records("path", scene.name, range(len(train)), train, forward)
    records += _records("test", scene.name, range(len(test)), test, np.full_like(test, np.nan))
    with _figures.look():
        figure, axes = _figures.grid(len(cells), 3.6, float(np.clip(3.3 * aspect, 1.8, 4.6)) + 0.35)
        for place, cell in zip(axes, cells, strict=True):
            indices = _indices(cell, scene)
            _backdrop(place, flat_train, flat_test, flat_points)
            _chosen(place, flat_train[indices], forward[indices] @ plane.T, drawn[cell.selector], max(high - low))
            place.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
            place.grid(visible=False)
            place.spines[:].set_visible(False)
            place.set_title(f"{cell.selector}: {len(indices)} of {scene.n_train} views")
            records += _records(cell.selector, scene.name, indices, train[indices], forward[indices])
        _scale_bar(axes[0], low, high)
        figure.legend(handles=_handles(len(points) > 0), loc="outside lower center", ncols=min(4, len(axes)))
        files = _figures.save(figure, out, f"cameras_{scene.name}", records)
    caption = (
        f"{scene.name} from above at {percent(study.middle_ratio())}, seed {study.first_seed}. Coloured: the chosen "
        "cameras, each with an arrow along its viewing direction (short where it looks up or down); grey line: the "
        f"path of all {scene.n_train} training views; crosses: the {scene.n_test} test cameras. Crowded arrows are "
        "views that repeat each other; bare stretches of the path are what the choice leaves out. Up is estimated "
        "from the poses."
    )
    return Item(f"Chosen cameras in {scene.name}", "figure", caption, files)


def _indices(cell: Cell, scene: SceneInfo) -> list[int]:
    indices = [int(index) for index in cell.read("selection")["indices"]]
    if not indices or max(indices) >= scene.n_train or min(indices) < 0:
        raise UserError(f"'{cell.folder / 'selection.json'}' does not fit scene '{scene.name}'; run the study again")
    return indices


def _backdrop(axes: Axes, train: np.ndarray, test: np.ndarray, points: np.ndarray) -> None:
    axes.scatter(points[:, 0], points[:, 1], s=1.2, color="#DCDCDC", linewidths=0, rasterized=True, zorder=0)
    for piece in _topview.pieces(train):
        axes.plot(piece[:, 0], piece[:, 1], color="#8C8C8C", linewidth=0.9, zorder=1)
    axes.scatter(test[:, 0], test[:, 1], s=16, marker="+", color="#222222", linewidths=0.7, zorder=2)


def _chosen(axes: Axes, at: np.ndarray, looks: np.ndarray, style: Style, extent: float) -> None:
    axes.scatter(at[:, 0], at[:, 1], s=9, color=style.colour, linewidths=0, zorder=4)
    length = 0.055 * extent * looks
    axes.quiver(
        *at.T,
        *length.T,
        color=style.colour,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.004,
        headwidth=4.5,
        zorder=3,
    )


def _scale_bar(axes: Axes, low: np.ndarray, high: np.ndarray) -> None:
    """A bar of a round length, in scene units (metres where the capture is metric)."""
    extent = high[0] - low[0]
    length = _topview.round_length(extent / 4)
    x, y = low[0] + 0.04 * extent, low[1] + 0.04 * (high[1] - low[1])
    axes.plot([x, x + length], [y, y], color="black", linewidth=1.5, solid_capstyle="butt")
    label = f"{length:g} unit" if length == 1 else f"{length:g} units"
    axes.annotate(label, (x + length, y), (3, 0), textcoords="offset points", fontsize=7.5, va="center")


def _handles(has_points: bool) -> list[Line2D]:
    handles = [
        Line2D([], [], color="#8C8C8C", linewidth=0.9, label="path of all training views"),
        Line2D([], [], color="#222222", marker="+", linestyle="none", label="test cameras"),
        Line2D([], [], color="#444444", marker="o", markersize=3.5, linewidth=1.2, label="chosen view, its direction"),
    ]
    if has_points:
        handles.append(Line2D([], [], color="#C0C0C0", marker=".", linestyle="none", label="points of the scene"))
    return handles


def _records(role: str, scene: str, indices: Any, at: np.ndarray, forward: np.ndarray) -> list[dict[str, Any]]:
    """`role` is "path", "test" or the selector that chose the view; `order` is the place in the choice."""
    return [
        {
            "scene": scene,
            "role": role,
            "order": order,
            "index": index,
            **dict(zip("xyz", map(float, position), strict=True)),
            **{f"forward_{axis}": None if np.isnan(f) else float(f) for axis, f in zip("xyz", look, strict=True)},
        }
        for order, (index, position, look) in enumerate(zip(indices, at, forward, strict=True))
    ]
