"""A choice along the capture: when frames were chosen, and how far each frame is from the nearest chosen one."""

from html import escape
from typing import Any

import numpy as np

from ._picked import Picked
from ._style import FIXED

GREY, CHOSEN = "#9a9a9a", FIXED["maxmin"].colour
Y = "distance to the\nnearest chosen"


def draw_strip(axes: Any, picked: Picked) -> None:
    """Draws it on matplotlib axes: the curve grey, a mark for each chosen frame below it, the distance asked for."""
    clock = picked.clock
    top = 1.0
    if picked.distance is None:
        axes.set_ylim(-0.12, 0)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
    else:
        axes.fill_between(clock, picked.distance, color=GREY, alpha=0.35, linewidth=0)
        axes.plot(clock, picked.distance, color=GREY, linewidth=0.8)
        top = max(float(picked.distance.max()), picked.within or 0.0) or 1.0
        axes.set_ylim(-0.12 * top, 1.08 * top)
        axes.set_ylabel(Y)
    if picked.within is not None:
        axes.axhline(picked.within, color=CHOSEN, linewidth=0.8, linestyle=(0, (4, 2)))
    marks = clock[picked.chosen]
    axes.plot(marks, np.full(len(marks), -0.06 * top), "|", color=CHOSEN, markersize=8, markeredgewidth=1.1)
    axes.margins(x=0.01)
    axes.set_xlabel(picked.unit)


def strip_traces(picked: Picked) -> list[Any]:
    """The same for plotly, with the frame's name, its distance and the chosen frame that it is nearest to."""
    import plotly.graph_objects as go

    # Plotly takes texts for HTML, and a name may have links in it.
    names, clock = [escape(name) for name in picked.frames.names], picked.clock
    ranks = {int(index): rank for rank, index in enumerate(picked.chosen, start=1)}
    traces: list[Any] = []
    if picked.distance is not None:
        words = [
            f"{name}: chosen as number {ranks[i]}" if i in ranks else f"{name}: {left:.3f} from {names[owner]}"
            for i, (name, left, owner) in enumerate(zip(names, picked.distance, picked.owner, strict=True))
        ]
        look = {"fill": "tozeroy", "line": {"color": GREY, "width": 1}, "name": "distance"}
        x, y = clock.tolist(), picked.distance.tolist()
        traces.append(go.Scatter(x=x, y=y, hovertext=words, hoverinfo="text", **look))
    if picked.within is not None:
        line = {"color": CHOSEN, "width": 1, "dash": "dash"}
        ends = [float(clock[0]), float(clock[-1])]
        traces.append(go.Scatter(x=ends, y=[picked.within] * 2, mode="lines", line=line, name="--auto"))
    marks = clock[picked.chosen].tolist()
    words = [f"{names[i]}: chosen as number {rank}" for i, rank in ranks.items()]
    marker = {"symbol": "line-ns", "size": 9, "line": {"color": CHOSEN, "width": 1.5}}
    chosen = go.Scatter(
        x=marks, y=[0.0] * len(marks), mode="markers", marker=marker, hovertext=words, hoverinfo="text", name="chosen"
    )
    return [*traces, chosen]
