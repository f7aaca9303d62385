"""What logging a study leaves in results/STUDY for those who come after: whether it worked, and where it is."""

from pathlib import Path
from typing import Any

from ..common.files import read_json

STAMPS = ("tracked.json", "tracked.partial.json")  # of logging the cells, in the end
FOLLOWED = "logs/track/follow.json"  # of the process that logs them while the study runs


def newest(results: Path) -> dict[str, Any]:
    """What logging the cells left last; empty where they were not offered. Raises UserError for a file that cannot be
    read."""
    for path in newest_first(results, *STAMPS):
        record = read_json(path, "stamp of tracking")
        return record if isinstance(record, dict) else {}
    return {}


def newest_first(results: Path, *names: str) -> list[Path]:
    """Those of the files that are there."""
    there = [path for name in names if (path := results / name).is_file()]
    return sorted(there, key=lambda path: path.stat().st_mtime_ns, reverse=True)
