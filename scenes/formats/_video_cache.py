"""The user's cache of small pictures of videos: one folder a video, held while it is used, the oldest go first."""

import contextlib
import os
import shutil
import sys
from pathlib import Path
from typing import Any

from ...common.files import user_cache

LOCK = "lock"
_held: dict[Path, Any] = {}  # until the process ends


def hold(name: str) -> Path:
    """The folder of this name, made where it is not, which no process removes while this one runs."""
    folder = user_cache("video") / name
    while folder not in _held:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            file = open(folder / LOCK, "ab")  # noqa: SIM115
        except FileNotFoundError:  # it was just removed
            continue
        _lock(file, shared=True)
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(file.fileno()), (folder / LOCK).stat()):
                _held[folder] = file
                break
        file.close()
    with contextlib.suppress(OSError):
        os.utime(folder / LOCK)
    return folder


def drop(folder: Path) -> None:
    """Removes a folder that this process holds and that has no picture in it: of a file that turned out to be none."""
    if folder in _held and not any(folder.glob("*.jpg")):
        _held.pop(folder).close()
        _remove(folder)


def trim(gigabytes: int) -> None:
    """Removes folders that were not used for longest until all of them take no more than the limit, and says so.

    Those that a process holds stay.
    """
    folders = [folder for folder in user_cache("video").iterdir() if folder.is_dir()]
    sizes = {folder: _bytes(folder) for folder in folders}
    total, limit = sum(sizes.values()), gigabytes * 1e9
    for folder in sorted(folders, key=_used):
        if total <= limit:
            return
        if folder not in _held and _remove(folder):
            total -= sizes[folder]
            print(
                f"viewbench: removed {sizes[folder] / 1e9:.2f} GB of small pictures of a video from '{folder}', which "
                f"was not used for longest: data.video_cache_gb is {gigabytes}",
                file=sys.stderr,
            )


def _bytes(folder: Path) -> int:
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        return sum(entry.stat().st_size for entry in entries if entry.is_file(follow_symlinks=False))
    return 0


def _used(folder: Path) -> float:
    for path in (folder / LOCK, folder):
        with contextlib.suppress(OSError):
            return path.stat().st_mtime
    return 0.0


def _remove(folder: Path) -> bool:
    """Whether nobody held the folder, and it is gone."""
    try:
        # "ab" makes the file where an older version wrote the folder, or a process died before it was there.
        with open(folder / LOCK, "ab") as file:
            if not _lock(file, shared=False):
                return False
            away = folder.with_name(f".gone-{os.getpid()}-{folder.name}")
            folder.rename(away)  # at once: half a folder is never found
    except OSError:
        return False
    shutil.rmtree(away, ignore_errors=True)
    return True


def _lock(file: Any, shared: bool) -> bool:
    """Takes the lock, waiting where it is shared; False where it is had by another. Without locks nobody has it."""
    try:
        import fcntl
    except ImportError:  # Windows, where a file that is open cannot be renamed away
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_SH if shared else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
