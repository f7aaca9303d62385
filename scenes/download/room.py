"""Whether there is room on the disk, asked before anything is fetched."""

import shutil
from pathlib import Path

from ...common.catalogue import size_in_words
from ...common.errors import UserError

SPARE = 1 << 24  # bytes that are left free


def check_room(folder: Path, needed: int) -> None:
    """Raises UserError when the disk of `folder`, which may not be there yet, has not `needed` bytes free."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    free = shutil.disk_usage(folder).free
    if needed + SPARE > free:
        raise UserError(
            f"'{folder}' has {size_in_words(free) or 'no room'} free and {size_in_words(needed)} are needed; make "
            "room, or name another folder by --to"
        )
