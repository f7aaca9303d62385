"""Files that appear whole or not at all, and the hashes that say what was read."""

import contextlib
import hashlib
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from . import bounded, holding
from .errors import UserError

SEAL = "content_sha256"  # of a JSON record: the hash of all the rest of it


@contextlib.contextmanager
def whole(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary path in the same folder, renamed to `path` on success and removed on failure.

    The temporary name keeps the suffix of `path`, so that writers which look at it do the right thing. What a writer
    that was killed left is removed by `holding.sweep`.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=holding.prefix(), suffix=path.suffix, dir=path.parent)
    temporary = Path(name)
    held = holding.lock(handle)
    if not held:  # Windows renames no open file
        os.close(handle)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    finally:
        if held:
            os.close(handle)
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary folder beside `path` that takes its place on success; an old one goes only then.

    Where `path` is a link it is the folder that it leads to.
    """
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=holding.prefix(), dir=path.parent))
    try:
        with holding.kept(temporary):
            yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o777 & ~umask)
        if path.exists():
            shutil.rmtree(path)
        temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_text(path: str | os.PathLike, text: str) -> None:
    """Writes UTF-8 text with `\\n` line ends, whole or not at all."""
    with whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: str | os.PathLike, value: Any) -> None:
    """Writes `value` as indented JSON, whole or not at all.

    Raises ValueError for NaN and infinity, which JSON does not have.
    """
    write_text(path, json.dumps(plain(value), indent=1, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike, what: str = "file") -> Any:
    """Reads JSON; raises UserError that names the file when it is missing, broken or beyond `limits`."""
    text = bounded.json_text(path, what)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{what} '{path}' is not valid JSON: {error}") from None


def sealed(record: dict[str, Any]) -> dict[str, Any]:
    """The record with the hash of its own content, by which `unsealed` finds what was edited since."""
    bare = {key: value for key, value in record.items() if key != SEAL}
    return {**bare, SEAL: content_sha256(bare)}


def unsealed(record: dict[str, Any], what: str) -> dict[str, Any]:
    """The record without its seal; one that has none was made by somebody else, and is taken as it is.

    Raises UserError, which calls the record `what`, when its content is not what was sealed.
    """
    if not isinstance(record, dict):
        raise UserError(f"{what} is no JSON object; make it again")
    bare = {key: value for key, value in record.items() if key != SEAL}
    try:
        found = content_sha256(bare)
    except (ValueError, RecursionError):
        raise UserError(f"{what} has NaN, infinity, or lists too deep; make it again") from None
    if record.get(SEAL, found) != found:
        raise UserError(f"{what} was edited since it was made; make it again")
    return bare


def content_sha256(record: dict[str, Any]) -> str:
    """Hex SHA-256 of a record, whatever the order of its keys and the layout of its file."""
    return hashlib.sha256(json.dumps(plain(record), sort_keys=True, allow_nan=False).encode()).hexdigest()


def plain(value: Any) -> Any:
    """`value` with numpy scalars and arrays, tuples and paths turned into what JSON knows."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def finite_or_none(value: float) -> float | None:
    """`value`, or None where it is NaN or infinite: JSON has neither."""
    return float(value) if math.isfinite(value) else None


def sha256_folder(path: str | os.PathLike) -> dict[str, str]:
    """Hex SHA-256 of every file below the folder, by its path from there, sorted."""
    root = Path(path)
    files = sorted(file for file in root.rglob("*") if file.is_file())
    return {file.relative_to(root).as_posix(): sha256_file(file) for file in files}


def user_cache(name: str) -> Path:
    """The folder `name` in viewbench's part of the user's cache. Raises RuntimeError where there is no home."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "viewbench" / name


def sha256_file(path: str | os.PathLike) -> str:
    """Hex SHA-256 of the file's bytes. Raises OSError, too, for a pipe or a device."""
    bounded.checked(path)
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
