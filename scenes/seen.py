"""What a rendered capture says of its test views: the share of each one's pixels that some training view sees."""

from collections.abc import Sequence
from pathlib import Path

from ..common.errors import UserError
from ..common.files import read_json

FILE = "seen_test.json"  # of a capture; `viewbench render` writes it


def shares_of(root: Path, names: Sequence[str]) -> list[float] | None:
    """A share in [0, 1] for each of the named test views; None for a capture that says nothing of some of them.

    Raises UserError for a file that is broken.
    """
    file = root / FILE
    if not file.is_file():
        return None
    record = read_json(file, "shares")
    shares = record.get("seen") if isinstance(record, dict) else None
    if not isinstance(shares, dict) or not all(isinstance(shares.get(name), float | int) for name in names):
        return None
    if not all(0 <= shares[name] <= 1 for name in names):
        raise UserError(f"shares '{file}' has one that is not in [0, 1]; delete the file")
    return [float(shares[name]) for name in names]
