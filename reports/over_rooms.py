"""Does a way of choosing win over rooms, and not in one alone? Differences to plain choice, rooms as the sample."""

import re
from collections.abc import Mapping
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from . import _figures, _findings, _tables
from ._items import Item
from ._rooms import ALL, OverRooms, groups, over_rooms
from ._statistics import interval, signed
from ._study import Study, percent
from ._style import Style, styles
from ._tables import Entry, Table

ORDER = 15
NAME = "over_rooms"
SPREAD = 0.025  # between selectors at a ratio, of the axis


def build(study: Study, out: Path) -> list[Item]:
    """A figure against every n-th frame and a table for each way of walking; nothing where all is in a single room."""
    found = groups(study)
    items = [_figure(study, found, out), *(_table(study, walk, rooms, out) for walk, rooms in found.items())]
    return [item for item in items if item is not None]


def _figure(study: Study, walks: Mapping[str, Mapping[str, str]], out: Path) -> Item | None:
    """Mean difference to every n-th frame over the ratio, a panel for each backend and way of walking."""
    baseline = _findings.BASELINES[0]
    if baseline not in study.selectors:
        return None
    drawn = styles(name for name in study.selectors if name != baseline)
    panels, records = [], []
    for backend in study.backends:
        for walk, rooms in walks.items():
            found = {
                name: {
                    ratio: item
                    for ratio in study.ratios_of(backend)
                    if (item := over_rooms(study, rooms, backend, name, baseline, (ratio,)))
                }
                for name in drawn
            }
            if any(found.values()):
                panels.append((_panel_title(study, backend, walk), found))
                for name, by_ratio in found.items():
                    for ratio, item in by_ratio.items():
                        records += _records(walk, backend, name, baseline, percent(ratio), item)
    if not panels:
        return None
    with _figures.look():
        figure, axes = _figures.grid(len(panels), 4.3, 3.5)
        for place, (title, found) in zip(axes, panels, strict=True):
            _panel(place, found, drawn)
            place.set(title=title, xlabel="training views", ylabel=f"Δ PSNR to {baseline} (dB)")
        _figures.share_heights(axes, 3)
        _figures.legend(figure, {name: drawn[name] for name in drawn if any(found[name] for _, found in panels)})
        files = _figures.save(figure, out, NAME, records)
    caption = (
        f"Difference of mean PSNR to {baseline} (the line at 0), the mean over rooms; above the line is better. Bars: "
        "the 95 % interval (Student's) of that mean with rooms as the sample; a single further room may differ by more "
        "than twice as much; small marks: each room's own difference, the mean of its seeds and walks. At a ratio the "
        "selectors stand side by side so that their bars can be told apart."
    )
    return Item("Differences over rooms", "figure", caption, files)


def _panel_title(study: Study, backend: str, walk: str) -> str:
    parts = [] if len(study.backends) == 1 else [backend]
    return " · ".join([*parts, "all walks" if walk == ALL else f"{walk} walks"])


def _panel(axes: Axes, found: Mapping[str, Mapping[float, OverRooms]], drawn: Mapping[str, Style]) -> None:
    ratios = sorted({ratio for by_ratio in found.values() for ratio in by_ratio})
    shown = [name for name in drawn if found[name]]
    axes.axhline(0, color="black", linewidth=1)
    for place, name in enumerate(shown):
        style, by_ratio = drawn[name], found[name]
        shift = 1 + SPREAD * (2 * place - len(shown) + 1)
        at = [ratio * shift for ratio in by_ratio]
        means = [item.mean.mean for item in by_ratio.values()]
        bars = [0.0 if item.mean.high is None else item.mean.high - item.mean.mean for item in by_ratio.values()]
        axes.errorbar(
            at, means, bars, color=style.colour, marker=style.marker, linestyle=style.dash, elinewidth=1.2, capsize=2
        )
        for x, item in zip(at, by_ratio.values(), strict=True):
            values = list(item.rooms.values())
            axes.plot([x] * len(values), values, "_", color=style.colour, markersize=4, alpha=0.7)
    axes.set_xscale("log")
    axes.set_xticks(ratios, [percent(ratio) for ratio in ratios])
    axes.xaxis.set_minor_locator(NullLocator())


def _table(study: Study, walk: str, rooms: Mapping[str, str], out: Path) -> Item | None:
    baselines = [name for name in _findings.BASELINES if name in study.selectors]
    others = [name for name in study.selectors if name not in _findings.BASELINES]
    rows, records = [], []
    for backend in study.backends:
        ratios = study.ratios_of(backend)
        for baseline in baselines:
            # The baselines stand against each other once.
            for selector in study.selectors if baseline == baselines[0] else others:
                total = over_rooms(study, rooms, backend, selector, baseline, ratios)
                if total is None:
                    continue
                row = [Entry(backend)] if len(study.backends) > 1 else []
                row += [Entry(selector), Entry(baseline), Entry(str(len(total.rooms)), len(total.rooms))]
                for ratio in study.ratios if len(study.ratios) > 1 else ():
                    part = over_rooms(study, rooms, backend, selector, baseline, (ratio,)) if ratio in ratios else None
                    row.append(Entry("") if part is None else Entry(interval(part.mean), part.mean.mean))
                    records += [] if part is None else _records(walk, backend, selector, baseline, percent(ratio), part)
                low, high = total.left_out
                row += [
                    Entry(interval(total.mean), total.mean.mean),
                    Entry(" / ".join(map(str, total.counts)), total.counts[0]),
                    Entry(f"{signed(low)} to {signed(high)}", low),
                    Entry(total.mean.verdict, total.mean.mean),
                ]
                rows.append(tuple(row))
                records += _records(walk, backend, selector, baseline, "all", total)
    if not rows:
        return None
    head = ["backend"] if len(study.backends) > 1 else []
    labels = [*head, "selector", "against", "rooms"]
    parts = [f"Δ at {percent(ratio)} (95 % interval)" for ratio in study.ratios] if len(study.ratios) > 1 else []
    end = ("Δ over all (95 % interval)", "won / level / lost", "without one room", "in words")
    table = Table((*labels, *parts, *end), tuple(rows), len(labels))
    name, title = ("table_over_rooms", "Differences over rooms")
    if walk != ALL:
        name, title = name + "_" + re.sub(r"\W+", "-", walk), f"{title}: {walk} walks"
    files = _tables.save(table, out, name, records)
    return Item(title, "table", _caption(rooms), files, table)


def _caption(rooms: Mapping[str, str]) -> str:
    shared = {room for room in rooms.values() if list(rooms.values()).count(room) > 1}
    several = " Walks through one room are averaged and count as one." if shared else ""
    return (
        "Difference of mean PSNR in dB; positive means that the selector is better. Here rooms are the sample: in each "
        "the seeds are averaged, and the interval (Student's, 95 %) is of the mean over rooms of this kind, if these "
        "were drawn from such: a single further room may differ by more than twice as much. Where rooms lie closer "
        f"together than their seeds explain, the interval is by the seeds' error.{several} Few rooms give wide "
        "intervals, and rightly so; of every twenty intervals one misses by chance. “Over all” averages the ratios "
        "that the backend ran. Won, level and lost count scenes by the intervals of their own seeds, which few seeds "
        "leave level. “Without one room” is the range of the mean when each room in turn is left out: whether its sign "
        "hangs on one of them."
    )


def _records(
    walk: str, backend: str, selector: str, baseline: str, ratio: str, found: OverRooms
) -> list[dict[str, object]]:
    common = {"walk": walk or "all", "backend": backend, "selector": selector, "against": baseline, "ratio": ratio}
    low, high = found.left_out
    over_all = {
        "low_95_db": found.mean.low,
        "high_95_db": found.mean.high,
        "won": found.counts[0],
        "level": found.counts[1],
        "lost": found.counts[2],
        "without_one_low_db": low,
        "without_one_high_db": high,
        "verdict": found.mean.verdict,
    }
    none = dict.fromkeys(over_all)
    each = [{**common, "room": room, "delta_psnr_db": value, **none} for room, value in found.rooms.items()]
    return [*each, {**common, "room": "all", "delta_psnr_db": found.mean.mean, **over_all}]
