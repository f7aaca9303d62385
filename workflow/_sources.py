"""Which files of viewbench a step depends on, so that editing one re-runs what it touches and nothing else.

Snakemake sees only files. The sources of a step are the module that does it and, transitively, every viewbench module
that one imports (at the top or inside a function). Plug-ins are loaded by name, so a step names those it uses. They
are declared as one file that lists them with their hashes, rather than one by one: Snakemake looks at every input of
every waiting job again and again, which with forty sources a job took half a core.
"""

import ast
import functools
from pathlib import Path

from viewbench.common.files import sha256_file, write_text
from viewbench.common.settings import PACKAGE


def sources(*modules: str) -> list[str]:
    """Files of the modules ("selectors.maxmin") and of all that they import, sorted, relative to the working folder.

    Raises FileNotFoundError for a module that is not there.
    """
    found: set[str] = set()
    for module in modules:
        found |= _closure(module)
    paths = (_file(module) for module in found)
    return sorted(from_here(path) for path in paths if path)


def from_here(path: Path) -> str:
    """The path relative to the working folder where it is inside, so that a clone that moves is not run again."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def listing(path: Path, files: list[str]) -> str:
    """Writes "hash  file" lines to `path` where they differ from what stands there, and returns the path."""
    lines = (f"{_hash(name)}  {name}\n" for name in files)
    text = "".join(lines)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)
    return str(path)


@functools.cache
def _hash(name: str) -> str:
    return sha256_file(name)


@functools.cache
def _closure(module: str) -> frozenset[str]:
    if _file(module) is None:
        raise FileNotFoundError(f"viewbench has no module '{module}'")
    found, pending = {module}, [module]
    while pending:
        for name in _imports(pending.pop()) - found:
            found.add(name)
            pending.append(name)
    return frozenset(found)


@functools.cache
def _imports(module: str) -> frozenset[str]:
    path = _file(module)
    if path is None:
        return frozenset()
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            dotted = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            dotted = [node.module] + [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        inside = (name.removeprefix("viewbench.") for name in dotted if name.startswith("viewbench."))
        found |= {name for name in inside if _file(name)}
    if path.name == "__init__.py":  # a folder is one plug-in: what is in it belongs to it
        inner = (path.parent / f"{other.stem}.py" for other in path.parent.glob("*.py"))
        found |= {f"{module}.{other.stem}" for other in inner if other.stem != "__init__"}
    return frozenset(found)


@functools.cache
def _file(module: str) -> Path | None:
    path = PACKAGE.joinpath(*module.split("."))
    for candidate in (path.with_name(path.name + ".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None
