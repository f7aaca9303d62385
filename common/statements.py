"""Import statements of source files, remembered by content: parsing all that a step depends on takes a tenth of a
second, which every job of a study would pay again."""

import ast
import contextlib
import functools
import hashlib
import json
from pathlib import Path

from .files import user_cache, write_text

NO_SOURCE = "# no source"
KEPT = 1000  # files; when there are more, those that are not of this process go

# Level and module of `from ..module import names`; level 0 with the names alone for `import names`.
Statement = tuple[int, str, tuple[str, ...]]


def import_statements(text: str) -> list[Statement]:
    """The imports of a source file, at its top and inside functions, but those whose line ends in NO_SOURCE."""
    found: list[Statement] = []
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, (ast.Import, ast.ImportFrom)) or NO_SOURCE in lines[node.lineno - 1]:
            continue
        names = tuple(alias.name for alias in node.names)
        found.append((node.level, node.module or "", names) if isinstance(node, ast.ImportFrom) else (0, "", names))
    return found


def of_file(path: Path) -> list[Statement]:
    """`import_statements` of a file, taken from the user's cache where the same content was parsed before."""
    content = path.read_bytes()
    sha256 = hashlib.sha256(content).hexdigest()
    known = _remembered()
    if sha256 not in known:
        known[sha256] = import_statements(content.decode("utf-8"))
        _fresh.add(sha256)
    _used.add(sha256)
    return [(level, module, tuple(names)) for level, module, names in known[sha256]]


def keep() -> None:
    """Writes what this process has parsed to the user's cache; where that cannot be done it is parsed again."""
    if not _fresh:
        return
    known = _remembered()
    if len(known) > KEPT:
        known = {sha256: known[sha256] for sha256 in sorted(_used)}
    with contextlib.suppress(OSError, RuntimeError):
        write_text(_file(), json.dumps(known))
    _fresh.clear()


_fresh: set[str] = set()
_used: set[str] = set()


def _file() -> Path:
    """The cache; its name has this module's own hash, so that another way of reading imports starts anew."""
    own = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    return user_cache("sources") / f"imports-{own[:16]}.json"


@functools.cache
def _remembered() -> dict[str, list[Statement]]:
    try:
        known = json.loads(_file().read_text(encoding="utf-8"))
    except (OSError, ValueError, RuntimeError):
        return {}
    return known if isinstance(known, dict) else {}
