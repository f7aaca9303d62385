"""A picture of one choice: the path from above (.png, .pdf, .svg), or in three dimensions to turn around (.html)."""

from pathlib import Path

import numpy as np

from ..common import extras
from ..common.errors import UserError, nearest
from ..common.files import whole

KINDS = (".png", ".pdf", ".svg", ".html")
GREY, CHOSEN = "#9a9a9a", "#D55E00"


def plot(path: Path, title: str, positions: np.ndarray, forward: np.ndarray, chosen: np.ndarray) -> None:
    """Draws all frames grey and the chosen ones with their viewing direction.

    `positions` (N, 3) in scene units, `forward` (N, 3) unit viewing directions, `chosen` (K,) indices in the order
    chosen. Raises UserError for a kind of file that is not drawn, and where the package that draws it is missing.
    """
    draw = _interactive if kind_of(path) == ".html" else _from_above
    with whole(path) as temporary:
        draw(temporary, title, positions, forward, chosen)


def kind_of(path: Path) -> str:
    """The ending of the file, one of KINDS. Raises UserError for another, and where what draws it is not installed."""
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise UserError(f"--plot '{path}': expected a file ending in one of {', '.join(KINDS)}{nearest(kind, KINDS)}")
    extras.need("plotly" if kind == ".html" else "matplotlib", use="a picture of the choice needs", extra="plot")
    return kind


def _arrow(positions: np.ndarray) -> float:
    """Length of a viewing direction: a share of the extent that stays readable from 10 to 1,000 chosen views."""
    return 0.04 * float(np.ptp(positions, axis=0).max() or 1.0)


def _from_above(path: Path, title: str, positions: np.ndarray, forward: np.ndarray, chosen: np.ndarray) -> None:
    from ._figures import grid, look
    from ._topview import pieces, plane

    axes_2d = plane(positions, forward)
    flat, looks = positions @ axes_2d.T, forward @ axes_2d.T
    with look():
        figure, (axes,) = grid(1, 6.5, 6.5)
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
        axes.scatter(
            flat[chosen, 0],
            flat[chosen, 1],
            s=12,
            color=CHOSEN,
            zorder=3,
            label=f"{len(chosen)} chosen, with their direction",
        )
        axes.set_aspect("equal")
        axes.set_title(title)
        axes.set_xlabel("scene units, seen from above")
        figure.legend(loc="outside lower center", ncols=2)
        figure.savefig(path)


def _interactive(path: Path, title: str, positions: np.ndarray, forward: np.ndarray, chosen: np.ndarray) -> None:
    import plotly.graph_objects as go

    from ._topview import plane

    tips = positions[chosen] + _arrow(positions) * forward[chosen]
    rays = np.stack([positions[chosen], tips, np.full_like(tips, np.nan)], axis=1).reshape(-1, 3)
    order = [f"chosen as number {rank + 1}, frame {index}" for rank, index in enumerate(chosen)]
    grey, orange = {"color": GREY, "size": 2}, {"color": CHOSEN, "size": 4}
    figure = go.Figure(
        [
            go.Scatter3d(**_xyz(positions), mode="lines+markers", marker=grey, line={"color": GREY}, name="all frames"),
            go.Scatter3d(**_xyz(rays), mode="lines", line={"color": CHOSEN, "width": 4}, name="viewing direction"),
            go.Scatter3d(**_xyz(positions[chosen]), mode="markers", marker=orange, name="chosen", hovertext=order),
        ]
    )
    right, away = plane(positions, forward)
    up = np.cross(right, away)
    view = {"up": dict(zip("xyz", up, strict=True)), "eye": dict(zip("xyz", 1.7 * up - 1.2 * away, strict=True))}
    figure.update_layout(title=title, scene={"aspectmode": "data", "camera": view}, margin={"l": 0, "r": 0, "b": 0})
    figure.write_html(path, include_plotlyjs=True, default_height="95vh")


def _xyz(points: np.ndarray) -> dict[str, list[float | None]]:
    values = [[None if np.isnan(v) else float(v) for v in axis] for axis in points.T]
    return dict(zip("xyz", values, strict=True))
