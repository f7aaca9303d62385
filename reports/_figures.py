"""Figures: one look, and each written as PNG, PDF and the CSV behind it, the same bytes for the same data."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..common.files import whole
from ._study import FULL
from ._style import Style
from ._tables import write_csv

LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # ships with matplotlib: the same glyphs everywhere
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.dpi": 150,
    "text.parse_math": False,  # a name may hold a dollar sign
    "pdf.fonttype": 42,
}
GREY = "#5F5F5F"


@contextlib.contextmanager
def look() -> Iterator[None]:
    """The settings that every figure is made and saved under."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # whatever a matplotlibrc says
        matplotlib.rcParams.update(LOOK)
        yield


def grid(count: int, width: float, height: float, columns: int = 3) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels of width × height inches, at most `columns` a row; unused places stay blank."""
    across = 2 if count == 4 and columns == 3 else min(count, columns)
    down = -(-count // across)
    figure = Figure(figsize=(across * width, down * height), layout="constrained")
    axes = [figure.add_subplot(down, across, place + 1) for place in range(count)]
    return figure, axes


def legend(figure: Figure, styles: Mapping[str, Style], extra: Sequence[Line2D] = (), lines: bool = True) -> None:
    """One legend below all panels."""
    handles = [
        Line2D(
            [],
            [],
            color=style.colour,
            marker="" if name == FULL and lines else style.marker,
            linestyle=style.dash if lines else "none",
            label=name,
        )
        for name, style in styles.items()
    ]
    handles += extra
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), handlelength=2.6)


def share_heights(axes: Sequence[Axes], most: float = 1.6) -> None:
    """Gives all panels one y axis, so that they can be compared by eye, unless it would be more than `most` times the
    tallest of them and flatten the rest."""
    limits = [place.get_ylim() for place in axes]
    low, high = min(low for low, _ in limits), max(high for _, high in limits)
    if high - low <= most * max(top - bottom for bottom, top in limits):
        for place in axes:
            place.set_ylim(low, high)


def save(figure: Figure, out: Path, name: str, records: Sequence[Mapping[str, object]]) -> tuple[str, ...]:
    """Writes name.png, name.pdf and name.csv; returns the three file names.

    Dates and program versions stay out of the files, so that equal data gives equal bytes.
    """
    with whole(out / f"{name}.png") as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})
    with whole(out / f"{name}.pdf") as temporary:
        figure.savefig(temporary, format="pdf", metadata={"CreationDate": None, "Producer": None, "Creator": None})
    write_csv(out / f"{name}.csv", records)
    return (f"{name}.png", f"{name}.pdf", f"{name}.csv")
