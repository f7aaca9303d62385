"""What a report hands to the page: figures, tables and texts, kept as JSON beside the files they name."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ..common.errors import UserError
from ..common.files import read_json, write_json
from ._tables import Entry, Table


@dataclass(frozen=True)
class Item:
    """One thing on the page. `files` are names in the reports folder; a figure's first one is its PNG."""

    title: str
    kind: Literal["figure", "table", "text"]
    caption: str  # what was measured and how to read it; blank lines part paragraphs
    files: tuple[str, ...] = ()
    table: Table | None = None


def path(out: Path, report: str) -> Path:
    """Where the items of a report are kept."""
    return out / f"{report}.items.json"


def write(out: Path, report: str, items: list[Item]) -> None:
    """Keeps the items, and removes the files of an earlier drawing that no item names any more."""
    target = path(out, report)
    before = {file for item in read(out, report) for file in item.files} if target.is_file() else set()
    write_json(target, [asdict(item) for item in items])
    for name in before - {file for item in items for file in item.files}:
        (out / name).unlink(missing_ok=True)


def read(out: Path, report: str) -> list[Item]:
    """The items of a report; raises UserError when their file is missing or garbled."""
    source = path(out, report)
    try:
        return [_item(record) for record in read_json(source, "report")]
    except (KeyError, TypeError) as error:
        raise UserError(f"report '{source}' lacks {error}; draw it again by `viewbench report`") from None


def _item(record: dict[str, Any]) -> Item:
    table = record["table"]
    if table is not None:
        rows = tuple(tuple(Entry(**entry) for entry in row) for row in table["rows"])
        table = Table(tuple(table["columns"]), rows, table["labels"])
    return Item(record["title"], record["kind"], record["caption"], tuple(record["files"]), table)
