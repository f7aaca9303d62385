"""A picture of redundancy: the uncovered distance over the number of views, still or to be hovered over (.html)."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from ..common.files import whole
from ..selectors._redundancy import Level
from ._selection_plot import kind_of, plain
from ._style import FIXED

COLOUR = FIXED["maxmin"].colour
X = "views chosen, in maxmin's order"
Y = "uncovered distance (1 − similarity)"


def plot(path: Path, title: str, curve: np.ndarray, n: int, levels: Sequence[Level]) -> None:
    """Draws `curve` (K,), the uncovered distance of the first 1, 2, … of `n` views, with the levels marked.

    The distance is on a logarithmic scale: what is asked for lies between 0.01 and 0.3.
    Raises UserError for a kind of file that is not drawn, and where the package that draws it is missing.
    """
    curve = curve[: max(1, np.count_nonzero(curve > 0))]  # which has no place for 0, where all are chosen
    draw = _interactive if kind_of(path) == ".html" else _still
    with whole(path) as temporary:
        draw(temporary, title, curve, n, [level for level in levels if level.views <= len(curve)])


def _label(level: Level) -> str:
    return f"{level.views:,} views: similarity {level.similarity:g}"


def _still(path: Path, title: str, curve: np.ndarray, n: int, levels: Sequence[Level]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    from ._figures import GREY, grid, look

    views = np.arange(1, len(curve) + 1)
    with look():
        figure, (axes,) = grid(1, 6.5, 4.0)
        axes.step(views, curve, where="post", color=COLOUR)
        for level in levels:
            right = level.views > 0.7 * len(curve)  # its words would leave the page on that side
            axes.plot([level.views], [1 - level.similarity], marker="o", color=COLOUR, markersize=4)
            axes.annotate(
                _label(level),
                (level.views, 1 - level.similarity),
                xytext=(-6 if right else 6, -3 if right else 4),
                textcoords="offset points",
                horizontalalignment="right" if right else "left",
                verticalalignment="top" if right else "bottom",
                color=GREY,
                fontsize=8,
            )
        axes.set_title(plain(title))
        axes.set_xlabel(X)
        axes.set_ylabel(Y)
        axes.set_xlim(0, len(curve) * 1.02)
        if curve[-1] > 0:
            axes.set_yscale("log")
            axes.set_ylim(
                bottom=0.7 * max(curve[-1], min((1 - level.similarity for level in levels), default=curve[-1]))
            )
            axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.yaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
        both_ways = (lambda k: np.asarray(k) * 100 / n, lambda share: np.asarray(share) * n / 100)
        top = axes.secondary_xaxis("top", functions=both_ways)
        top.set_xlabel("% of the training views", fontsize=8, color=GREY)
        top.tick_params(labelsize=8, colors=GREY)
        top.spines["top"].set_visible(False)
        figure.savefig(path)


def _interactive(path: Path, title: str, curve: np.ndarray, n: int, levels: Sequence[Level]) -> None:
    import plotly.graph_objects as go

    views = list(range(1, len(curve) + 1))
    shares = [f"{100 * k / n:.1f} %" for k in views]
    hover = "%{x} views (%{customdata}): every frame is within %{y:.4f}<extra></extra>"
    line = {"color": COLOUR, "shape": "hv"}
    figure = go.Figure(
        [
            go.Scatter(
                x=views, y=curve.tolist(), mode="lines", line=line, customdata=shares, hovertemplate=hover, name=""
            ),
            go.Scatter(
                x=[level.views for level in levels],
                y=[1 - level.similarity for level in levels],
                mode="markers+text",
                text=[_label(level) for level in levels],
                textposition="top right",
                marker={"color": COLOUR, "size": 8},
                hoverinfo="skip",
            ),
        ]
    )
    figure.update_layout(title=escape(title), showlegend=False, template="plotly_white")
    figure.update_xaxes(title=X)
    figure.update_yaxes(title=Y, type="log", dtick="D1")
    figure.write_html(path, include_plotlyjs=True, default_height="95vh")
