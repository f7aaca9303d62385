"""A picture of one choice: the path from above (.png, .pdf, .svg) or in three dimensions (.html), and a strip in time.

Without poses there is no path, and what is drawn is the strip along the capture alone.
"""

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..common import extras
from ..common.errors import UserError, nearest, printable
from ..common.files import whole
from ._picked import Picked
from ._strip import CHOSEN, GREY, Y, draw_strip, strip_traces

KINDS = (".png", ".pdf", ".svg", ".html")
STRIP = 1.7  # inches


def plot(path: Path, picked: Picked) -> None:
    """Draws all frames grey and the chosen ones with their viewing direction, and the strip below.

    Raises UserError for a kind of file that is not drawn, and where the package that draws it is missing.
    """
    draw = _interactive if kind_of(path) == ".html" else _still
    with whole(path) as temporary:
        draw(temporary, picked)


def kind_of(path: Path) -> str:
    """The ending of the file, one of KINDS. Raises UserError for another, and where what draws it is not installed."""
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise UserError(f"--plot '{path}': expected a file ending in one of {', '.join(KINDS)}{nearest(kind, KINDS)}")
    extras.need("plotly" if kind == ".html" else "matplotlib", use="a picture of the choice needs", extra="plot")
    return kind


def plain(text: str) -> str:
    """The text as matplotlib shows it letter by letter: between two $ it would read formulas, and fail at bad ones."""
    return printable(text).replace("$", r"\$")


def _arrow(positions: np.ndarray) -> float:
    """Length of a viewing direction: a share of the extent that stays readable from 10 to 1,000 chosen views."""
    return 0.04 * float(np.ptp(positions, axis=0).max() or 1.0)


def _still(path: Path, picked: Picked) -> None:
    from matplotlib.figure import Figure

    from ._figures import look

    with look():
        height = 6.5 + STRIP if picked.posed else STRIP if picked.distance is None else 1.0 + STRIP
        figure = Figure(figsize=(6.5 if picked.posed else 9.0, height), layout="constrained")
        rows = figure.add_gridspec(2, 1, height_ratios=(6.5, STRIP)) if picked.posed else figure.add_gridspec(1, 1)
        places = [figure.add_subplot(row) for row in rows]
        if picked.posed:
            _from_above(places[0], picked)
        draw_strip(places[-1], picked)
        places[0].set_title(plain(picked.title))
        if not picked.posed:
            by = "" if picked.distance is None else f", compared by {picked.factors}"
            words = f"{len(picked.chosen):,} chosen of {len(picked.frames):,} frames{by}"
            figure.supxlabel(words, fontsize=8)
        else:
            figure.legend(loc="outside lower center", ncols=2)
        figure.savefig(path)


def _from_above(axes: Any, picked: Picked) -> None:
    from ._topview import pieces, plane

    cameras, chosen = picked.frames.cameras, picked.chosen
    positions, forward = cameras.positions, cameras.forward
    axes_2d = plane(positions, forward)
    flat, looks = positions @ axes_2d.T, forward @ axes_2d.T
    for piece in pieces(flat):
        axes.plot(*piece.T, color=GREY, linewidth=0.8, zorder=1)
    axes.scatter(flat[:, 0], flat[:, 1], s=4, color=GREY, zorder=1, label=f"all {len(positions)} frames")
    axes.quiver(
        *flat[chosen].T,
        *looks[chosen].T,
        color=CHOSEN,
        angles="xy",
        scale_units="xy",
        scale=1 / _arrow(positions),
        width=0.003,
        zorder=3,
    )
    label = f"{len(chosen)} chosen, with their direction"
    axes.scatter(flat[chosen, 0], flat[chosen, 1], s=12, color=CHOSEN, zorder=3, label=label)
    axes.set_aspect("equal")
    axes.set_xlabel("scene units, seen from above")


def _interactive(path: Path, picked: Picked) -> None:
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    # Here and below: plotly takes texts for HTML, and a name may have links in it.
    if picked.posed:
        kinds = [[{"type": "scene"}], [{"type": "xy"}]]
        figure = make_subplots(rows=2, cols=1, specs=kinds, row_heights=[0.8, 0.2], vertical_spacing=0.04)
        for trace in _path(picked):
            figure.add_trace(trace, row=1, col=1)
        for trace in strip_traces(picked):
            figure.add_trace(trace.update(showlegend=False), row=2, col=1)
        figure.update_layout(scene={"aspectmode": "data", "camera": _view(picked)})
    else:
        figure = go.Figure(strip_traces(picked))
    figure.update_xaxes(title=picked.unit)
    figure.update_yaxes(title=Y.replace("\n", "<br>"), visible=picked.distance is not None)
    figure.update_layout(title=escape(picked.title), template="plotly_white", margin={"l": 60, "r": 10, "b": 40})
    figure.write_html(path, include_plotlyjs=True, default_height="95vh")


def _path(picked: Picked) -> list[Any]:
    import plotly.graph_objects as go

    cameras, chosen, names = picked.frames.cameras, picked.chosen, picked.frames.names
    positions = cameras.positions
    tips = positions[chosen] + _arrow(positions) * cameras.forward[chosen]
    rays = np.stack([positions[chosen], tips, np.full_like(tips, np.nan)], axis=1).reshape(-1, 3)
    order = [
        f"chosen as number {rank + 1}, frame {index} ({escape(names[index])})" for rank, index in enumerate(chosen)
    ]
    grey, orange = {"color": GREY, "size": 2}, {"color": CHOSEN, "size": 4}
    return [
        go.Scatter3d(**_xyz(positions), mode="lines+markers", marker=grey, line={"color": GREY}, name="all frames"),
        go.Scatter3d(**_xyz(rays), mode="lines", line={"color": CHOSEN, "width": 4}, name="viewing direction"),
        go.Scatter3d(**_xyz(positions[chosen]), mode="markers", marker=orange, name="chosen", hovertext=order),
    ]


def _view(picked: Picked) -> dict[str, dict[str, float]]:
    from ._topview import plane

    right, away = plane(picked.frames.cameras.positions, picked.frames.cameras.forward)
    up = np.cross(right, away)
    return {"up": dict(zip("xyz", up, strict=True)), "eye": dict(zip("xyz", 1.7 * up - 1.2 * away, strict=True))}


def _xyz(points: np.ndarray) -> dict[str, list[float | None]]:
    values = [[None if np.isnan(v) else float(v) for v in axis] for axis in points.T]
    return dict(zip("xyz", values, strict=True))
