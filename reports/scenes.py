"""What was chosen from: the scenes of the study, and how fair their test views are."""

import math
from pathlib import Path

from . import _tables
from ._items import Item
from ._study import SceneInfo, Study
from ._tables import Entry, Table

ORDER = 17
FAIR = 0.85  # share of a test view that training views see, below which views are counted


def build(study: Study, out: Path) -> list[Item]:
    """One table, a row a scene that has scores."""
    scored = {cell.scene for cell in study.done}
    scenes = [study.scene(name) for name in study.scenes if name in scored]
    if not scenes:
        return []
    walks, known = any(info.walk for info in scenes), any(info.seen for info in scenes)
    head = ["scene", "room", *(["walk"] if walks else [])]
    columns = ["training views", "test views"]
    columns += ["of a test view seen, mean", "least", f"views below {100 * FAIR:.0f} %"] if known else []
    rows = tuple(_row(info, walks, known) for info in scenes)
    table = Table((*head, *columns), rows, len(head))
    files = _tables.save(table, out, "table_scenes", [_record(info) for info in scenes])
    return [Item("Scenes", "table", _caption(known), files, table)]


def _row(info: SceneInfo, walks: bool, known: bool) -> tuple[Entry, ...]:
    row = [Entry(info.name), Entry(info.room), *([Entry(info.walk)] if walks else [])]
    row += [Entry(str(info.n_train), info.n_train), Entry(str(info.n_test), info.n_test)]
    if known and info.seen:
        mean, least = math.fsum(info.seen) / len(info.seen), min(info.seen)
        below = sum(share < FAIR for share in info.seen)
        row += [Entry(f"{100 * mean:.1f} %", mean), Entry(f"{100 * least:.1f} %", least), Entry(str(below), below)]
    elif known:
        row += [Entry("")] * 3
    return tuple(row)


def _caption(known: bool) -> str:
    text = "What the selectors choose from, and what the models are scored on."
    if known:
        text += (
            " Of rendered rooms it is known what the pixels of a test view show: “seen” is the share of them whose "
            "surface lies in some training view with nothing in between, by casting rays (24 × 24 a view; what glass "
            "hides and what mirrors show is not followed). No choice can show a model the rest. The shares of each "
            "view are in the table's CSV."
        )
    return text


def _record(info: SceneInfo) -> dict[str, object]:
    shares = " ".join(f"{share:.4f}" for share in info.seen)
    return {
        "scene": info.name,
        "room": info.room,
        "walk": info.walk,
        "training_views": info.n_train,
        "test_views": info.n_test,
        "seen_by_test_view": shares,
    }
