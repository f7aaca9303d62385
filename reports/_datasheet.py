"""What a data set is, for its readers: a table of its captures, maps of their ways, and example views."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..common.files import whole
from ..scenes.images import load_images
from ..scenes.rooms._pace import PERCENTILES, pace, spaced
from ..scenes.types import Scene
from . import _figures, _topview
from ._tables import Entry, Table, write_csv

EXAMPLES = 6  # views of a capture that are shown, the last two of them test views
SIZE = 1.5  # inches of one
INLIERS = 0.99  # share of the points on each axis that a map has to show
POINTS = 6000  # of a scene that are drawn
NEAR_M, NEAR_DEGREES = 0.3, 15.0  # of a training view that shows nearly what a test view does
CHART = {"train": "#0072B2", "test": "#D55E00"}
COLUMNS = ("capture", "room", "walk", "training", "test", "pixels", "seconds", "way (m)")
MOTION = ("speed 50 % (m/s)", "speed 95 %", "turn 50 % (deg/s)", "turn 95 %")
NEAR = ("nearest training view (m)", f"within {NEAR_M} m and {NEAR_DEGREES:.0f}°")
SEEN = ("test pixels seen", "least seen")


@dataclass(frozen=True)
class Capture:
    """One capture of the data set."""

    name: str
    room: str
    walk: str
    scene: Scene
    seen: tuple[float, ...]  # share of each test view's pixels that training views see; empty where it is not known


def table(captures: Sequence[Capture]) -> Table:
    """A row a capture: its size, how its camera moves, how much of its test views is seen. Scene units are metres."""
    known = any(capture.seen for capture in captures)
    rows = tuple(_row(capture, known) for capture in captures)
    return Table((*COLUMNS, *MOTION, *NEAR, *(SEEN if known else ())), rows, 3)


def _row(capture: Capture, known: bool) -> tuple[Entry, ...]:
    train, test = capture.scene.train, capture.scene.test
    size = f"{int(train.cameras.width[0])} × {int(train.cameras.height[0])}"
    row = [Entry(capture.name), Entry(capture.room), Entry(capture.walk)]
    row += [Entry(str(len(train)), len(train)), Entry(str(len(test)), len(test)), Entry(size)]
    # Of poses that mean nothing, of one frame and of times that do not rise nothing is told.
    if train.times is None or not capture.scene.posed or len(train) < 2 or not (np.diff(train.times) > 0).all():
        row += [Entry("")] * 6
    else:
        seconds, way = float(train.times[-1] - train.times[0]), length(train.times, train.cameras.positions)
        speed, turn = pace(train.times, train.cameras.c2w)
        middle, high = PERCENTILES.index(50), PERCENTILES.index(95)
        row += [Entry(f"{seconds:.0f}", seconds), Entry(f"{way:.1f}", way)]
        row += [Entry(f"{speed[k]:.2f}", speed[k]) for k in (middle, high)]
        row += [Entry(f"{turn[k]:.1f}", turn[k]) for k in (middle, high)]
    row += _near(capture)
    if known and capture.seen:
        mean, least = float(np.mean(capture.seen)), min(capture.seen)
        row += [Entry(f"{100 * mean:.1f} %", mean), Entry(f"{100 * least:.1f} %", least)]
    elif known:
        row += [Entry("")] * 2
    return tuple(row)


def _near(capture: Capture) -> list[Entry]:
    """Median distance from a test view to the nearest training view, and the share with one that shows almost it."""
    train, test = capture.scene.train.cameras, capture.scene.test.cameras
    if not capture.scene.posed or not len(capture.scene.test):
        return [Entry(""), Entry("")]
    apart = np.linalg.norm(test.positions[:, None] - train.positions, axis=-1)
    angle = np.degrees(np.arccos(np.clip(test.forward @ train.forward.T, -1, 1)))
    middle = float(np.median(apart.min(axis=1)))
    share = float(((apart < NEAR_M) & (angle < NEAR_DEGREES)).any(axis=1).mean())
    return [Entry(f"{middle:.2f}", middle), Entry(f"{100 * share:.0f} %", share)]


def length(times: np.ndarray, positions: np.ndarray) -> float:
    """Metres of a way of (N, 3) positions, by steps as `pace` takes them, so that jitter adds nothing."""
    return float(np.linalg.norm(np.diff(positions[spaced(times)], axis=0), axis=1).sum())


def maps(captures: Sequence[Capture], out: Path) -> tuple[str, ...]:
    """Draws every way from above over the scene's points, a panel a capture, each with a scale of its own.

    Captures without poses are left out; nothing is drawn where all are.
    """
    captures = [capture for capture in captures if capture.scene.posed]
    if not captures:
        return ()
    drawn = [_flat(capture.scene) for capture in captures]
    records = []
    with _figures.look():
        figure, axes = _figures.grid(len(captures), 3.2, 3.2, columns=4)
        for place, capture, (way, test, cloud, colours) in zip(axes, captures, drawn, strict=True):
            # What is held out leaves gaps; a path as it was given has none.
            whole_way = capture.scene.holdout == "given"
            _map(place, way, test, cloud, colours, [way] if whole_way else _topview.pieces(way))
            place.set_title(capture.name)
            for split, spots in (("train", way), ("test", test)):
                records += [{"capture": capture.name, "split": split, "x": x, "y": y} for x, y in spots]
        handles = [Line2D([], [], color=CHART["train"], label="training path")]
        handles += [Line2D([], [], color=CHART["test"], marker="x", linestyle="none", label="test views")]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        return _save(figure, out, "maps", records)


def _flat(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(N, 2) training path, (M, 2) test views, (P, 2) points and their (P, 3) colours in [0, 1], from above."""
    plane = _topview.plane(scene.train.cameras.positions, scene.train.cameras.forward)
    way, test = scene.train.cameras.positions @ plane.T, scene.test.cameras.positions.reshape(-1, 3) @ plane.T
    if scene.points is None or not len(scene.points):
        return way, test, np.zeros((0, 2)), np.zeros((0, 3))
    up = np.cross(plane[0], plane[1])
    height = scene.points.xyz @ up
    below = np.flatnonzero(height < np.quantile(scene.train.cameras.positions @ up, 0.95) + 0.3)  # no ceiling
    kept = below[:: max(1, len(below) // POINTS)]
    kept = kept[np.argsort(height[kept], kind="stable")]  # what is higher hides what is lower
    return way, test, scene.points.xyz[kept] @ plane.T, scene.points.rgb[kept] / 255


def _map(
    place: Axes,
    way: np.ndarray,
    test: np.ndarray,
    cloud: np.ndarray,
    colours: np.ndarray,
    pieces: list[np.ndarray],
) -> None:
    place.scatter(*cloud.T, c=colours, s=1.5, linewidths=0, alpha=0.55, rasterized=True)
    for piece in pieces:
        place.plot(*piece.T, color=CHART["train"], linewidth=1.2)
    place.plot(*test.T, "x", color=CHART["test"], markersize=4)
    most = np.quantile(cloud, (1 - INLIERS, INLIERS), axis=0) if len(cloud) else way[:0]  # stray points are far away
    shown = np.vstack([way, test, most])
    middle, extent = (shown.min(axis=0) + shown.max(axis=0)) / 2, float(np.ptp(shown, axis=0).max())
    low, high = middle - 0.55 * extent, middle + 0.55 * extent
    place.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
    place.grid(visible=False)
    place.spines[:].set_visible(False)
    left, at = low + 0.02 * extent
    place.plot([left, left + 1], [at, at], color="black", linewidth=2)
    place.annotate("1 m", (left, at), (0, 3), textcoords="offset points", fontsize=8)


def views(captures: Sequence[Capture], out: Path) -> tuple[str, ...]:
    """Draws example views, a row a capture: four training views and two test views, evenly spread."""
    records = []
    with _figures.look():
        figure, axes = _figures.grid(EXAMPLES * len(captures), SIZE, SIZE, columns=EXAMPLES)
        for row, capture in enumerate(captures):
            places = axes[row * EXAMPLES : (row + 1) * EXAMPLES]
            shown = [("train", i) for i in _spread(len(capture.scene.train), EXAMPLES - 2)]
            shown += [("test", i) for i in _spread(len(capture.scene.test), 2)]
            for place, (split, i) in zip(places, shown, strict=False):
                frames = getattr(capture.scene, split)
                image, _ = load_images(frames, np.array([i]), int(frames.cameras.width[i]))
                place.imshow(image[0])
                place.set_title("test" if split == "test" and row == 0 else "", fontsize=8)
                records.append({"capture": capture.name, "split": split, "view": frames.names[i]})
            for place in places:
                place.set(xticks=[], yticks=[])
                place.grid(visible=False)
                place.spines[:].set_visible(False)
            places[0].set_ylabel(capture.name, fontsize=8)
        figure.set_layout_engine("constrained", w_pad=0.01, h_pad=0.01, wspace=0, hspace=0)
        return _save(figure, out, "views", records)


def _save(figure: Figure, out: Path, name: str, records: Sequence[Mapping[str, object]]) -> tuple[str, ...]:
    """Writes name.jpg, which is small enough to lie beside a data set, and the CSV behind it."""
    with whole(out / f"{name}.jpg") as temporary:
        figure.savefig(temporary, format="jpg", dpi=100, pil_kwargs={"quality": 85, "optimize": True})
    write_csv(out / f"{name}.csv", records)
    return (f"{name}.jpg", f"{name}.csv")


def _spread(count: int, wanted: int) -> list[int]:
    wanted = min(count, wanted)
    return [(2 * k + 1) * count // (2 * wanted) for k in range(wanted)]
