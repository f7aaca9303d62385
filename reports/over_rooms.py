"""Does a way of choosing win in rooms that were not tried? Differences to plain choice, with rooms as the sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import _findings, _tables
from ._items import Item
from ._statistics import Difference, interval, over_samples, signed
from ._study import Study, percent
from ._tables import Entry, Table

ORDER = 15
LEAST = 2  # rooms: fewer are no sample
VERDICTS = ("better", "not told apart", "worse")  # of a scene by its seeds: wins, level, losses


@dataclass(frozen=True)
class OverRooms:
    """What one selector gains over a baseline, in dB, room by room."""

    rooms: dict[str, float]  # the mean over the room's scenes
    mean: Difference  # over rooms, each counted once, with the interval that rooms give
    counts: tuple[int, int, int]  # scenes that it wins, that the seeds cannot tell apart, that it loses

    @property
    def left_out(self) -> tuple[float, float]:
        """The lowest and the highest mean when one room is left out."""
        total, n = math.fsum(self.rooms.values()), len(self.rooms)
        means = [(total - value) / (n - 1) for value in self.rooms.values()]
        return min(means), max(means)


def build(study: Study, out: Path) -> list[Item]:
    """One table; nothing for a study of scenes in a single room."""
    rooms = {scene: study.scene(scene).room for scene in {scene for _, scene in study.panels()}}
    if len(set(rooms.values())) < LEAST:
        return []
    baselines = [name for name in _findings.BASELINES if name in study.selectors]
    others = [name for name in study.selectors if name not in _findings.BASELINES]
    rows, records = [], []
    for backend in study.backends:
        ratios = study.ratios_of(backend)
        for baseline in baselines:
            for selector in others:
                total = over_rooms(study, rooms, backend, selector, baseline, ratios)
                if total is None:
                    continue
                row = [Entry(backend)] if len(study.backends) > 1 else []
                row += [Entry(selector), Entry(baseline), Entry(str(len(total.rooms)), len(total.rooms))]
                for ratio in study.ratios if len(study.ratios) > 1 else ():
                    part = over_rooms(study, rooms, backend, selector, baseline, (ratio,)) if ratio in ratios else None
                    row.append(Entry("") if part is None else Entry(interval(part.mean), part.mean.mean))
                    records += [] if part is None else _records(backend, selector, baseline, percent(ratio), part)
                low, high = total.left_out
                row += [
                    Entry(interval(total.mean), total.mean.mean),
                    Entry(" / ".join(map(str, total.counts)), total.counts[0]),
                    Entry(f"{signed(low)} to {signed(high)}", low),
                    Entry(total.mean.verdict, total.mean.mean),
                ]
                rows.append(tuple(row))
                records += _records(backend, selector, baseline, "all", total)
    if not rows:
        return []
    head = ["backend"] if len(study.backends) > 1 else []
    labels = [*head, "selector", "against", "rooms"]
    parts = [f"Δ at {percent(ratio)} (95 % interval)" for ratio in study.ratios] if len(study.ratios) > 1 else []
    end = ("Δ over all (95 % interval)", "won / level / lost", "without one room", "in words")
    table = Table((*labels, *parts, *end), tuple(rows), len(labels))
    files = _tables.save(table, out, "table_over_rooms", records)
    return [Item("Differences over rooms", "table", _caption(rooms), files, table)]


def over_rooms(
    study: Study, rooms: dict[str, str], backend: str, selector: str, baseline: str, ratios: Sequence[float]
) -> OverRooms | None:
    """The differences of mean PSNR in dB, averaged over `ratios`, then over the scenes of each room, then over rooms.

    None where fewer than two rooms have both sides.
    """
    found: dict[str, list[float]] = {}
    verdicts: list[str] = []
    for scene in study.scenes:
        if scene in rooms and (item := _findings.against(study, backend, scene, selector, baseline, tuple(ratios))):
            found.setdefault(rooms[scene], []).append(item.mean)
            verdicts.append(item.verdict)
    if len(found) < LEAST:
        return None
    means = {room: math.fsum(values) / len(values) for room, values in found.items()}
    counts = [sum(verdict == word for verdict in verdicts) for word in VERDICTS]
    counts[1] = len(verdicts) - counts[0] - counts[2]  # a single sample tells nothing either
    return OverRooms(means, over_samples(list(means.values())), (counts[0], counts[1], counts[2]))


def _caption(rooms: dict[str, str]) -> str:
    shared = {room for room in rooms.values() if list(rooms.values()).count(room) > 1}
    several = " Walks through one room are averaged and count as one." if shared else ""
    return (
        "Difference of mean PSNR in dB; positive means that the selector is better. Here rooms are the sample: in each "
        "the seeds are averaged, and the interval (Student's, 95 %) is of what another room of this kind might give, "
        f"if these were drawn from such.{several} Few rooms give wide intervals, and rightly so. Won, level and lost "
        "count scenes by the intervals of their own seeds. “Without one room” is the range of the mean when each room "
        "in turn is left out: a verdict that hangs on one of them shows there."
    )


def _records(backend: str, selector: str, baseline: str, ratio: str, found: OverRooms) -> list[dict[str, object]]:
    common = {"backend": backend, "selector": selector, "against": baseline, "ratio": ratio}
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
