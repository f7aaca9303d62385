"""One hash of everything that a scene was read from, whichever folder it lies in."""

import contextlib
import hashlib
import json
import os
import re
import time
from pathlib import Path
from typing import Any

from ..common import bounded, limits
from ..common.errors import UserError
from ..common.files import sha256_file, user_cache, write_json
from .types import Scene

REMEMBERED_BYTES = 1 << 26  # the hashes of larger scenes are kept: reading gigabytes again for every step takes hours
KEPT_S = 90 * 86400.0  # and so long: hashes of scenes that nobody has opened since go
SHA256 = re.compile("[0-9a-f]{64}")
MISSING = "missing"  # in place of the hash of a file that is not there
SETTLED_S = 2.0  # a file changed less than that ago may change again without a new time


def scene_sha256(scene: Scene) -> str:
    """Hex SHA-256 over format, rule of the test split, metadata files and the images of both splits, with their names.

    The hashes of a large scene's files are kept in the user's cache and used again for a file of the same size, times
    and inode. Raises UserError for a file that cannot be read.
    """
    assumed = scene.details.get("assumed", "")  # what a reader knows from elsewhere than the files
    digest = hashlib.sha256(f"{scene.format}\0{scene.holdout}\0{assumed}\0".encode())
    named = [(path.name, path) for path in scene.files]
    for split in (scene.train, scene.test):
        digest.update(f"{len(split)}\0".encode())
        if not scene.details.get("extracted"):  # pictures that a reader made itself of its files say nothing new
            named += zip(split.names, split.paths, strict=True)
    try:
        hashes = _hashes([path for _, path in named])
    except OSError as error:
        raise UserError(f"scene '{scene.name}': '{error.filename}' cannot be read: {error.strerror}") from None
    for (name, _), sha256 in zip(named, hashes, strict=True):
        digest.update(f"{name}\0{sha256}\0".encode(errors="surrogatepass"))  # surrogates: names that are not UTF-8
    return digest.hexdigest()


def file_sha256(path: Path) -> str:
    """Hex SHA-256 of one file, remembered as `scene_sha256` does. Raises UserError for one that cannot be read."""
    try:
        return _hashes([path])[0]
    except OSError as error:
        raise UserError(f"'{path}' cannot be read: {error.strerror}") from None


def _hashes(paths: list[Path]) -> list[str]:
    """SHA-256 of each file."""
    states = [_state(path) for path in paths]
    if sum(state[0] for state in states if state) < REMEMBERED_BYTES:
        return [sha256_file(path) if state else MISSING for path, state in zip(paths, states, strict=True)]
    # Absolute and not resolved: two links to one file are two entries, and nothing has to be looked up for them.
    names = [os.fsencode(path.absolute()).hex() for path in paths]
    try:
        cache = user_cache("digests")
    except RuntimeError:  # nobody's home
        return [sha256_file(path) if state else MISSING for path, state in zip(paths, states, strict=True)]
    file = cache / f"{hashlib.sha256(chr(10).join(sorted(names)).encode()).hexdigest()[:32]}.json"
    known = _remembered(file)
    settled = time.time_ns() - SETTLED_S * 1e9
    result, fresh = [], {}
    for name, path, state in zip(names, paths, states, strict=True):
        if not state:
            result.append(MISSING)
            continue
        entry = known.get(name)
        sha256 = entry[-1] if entry is not None and entry[:-1] == state else sha256_file(path)
        result.append(sha256)
        if max(state[1:3]) < settled:
            fresh[name] = [*state, sha256]
    if fresh != known:
        with contextlib.suppress(OSError):  # a full disk or a home that cannot be written to costs time, no more
            write_json(file, fresh)
            for other in cache.glob("*.json"):
                if time.time() - other.stat().st_mtime > KEPT_S:
                    other.unlink()
    return result


def _state(path: Path) -> list[int]:
    """Size, times of change in nanoseconds, and inode: what differs whenever the content was written anew.

    Empty where there is no such file: whoever wants a picture's pixels says that it is gone, a hash can do without.
    """
    try:
        bounded.checked(path, limits.VIDEO_BYTES)
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return []
    return [found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino]


def _remembered(file: Path) -> dict[str, list]:
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {name: entry for name, entry in known.items() if _is_entry(entry)} if isinstance(known, dict) else {}


def _is_entry(entry: Any) -> bool:
    """Whether it is a state and a hash; a damaged cache says nothing."""
    return isinstance(entry, list) and bool(entry) and isinstance(entry[-1], str) and bool(SHA256.fullmatch(entry[-1]))
