"""Which files of viewbench a step depends on, so that editing one re-runs what it touches and nothing else.

The sources of a step are the module that does it and, transitively, every module of viewbench that one imports (at the
top or inside a function). Plug-ins are loaded by name, so a step names those it uses. An import whose line ends in
`# no source: why` is left out: what it brings does not touch the step's result.
"""

import functools
import hashlib
from pathlib import Path

from . import statements
from .files import sha256_file
from .settings import PACKAGE


def sources(*modules: str) -> dict[str, str]:
    """SHA-256 by path, relative to the package, of the modules ("selectors.maxmin") and of all that they import.

    Raises FileNotFoundError for a module that is not there.
    """
    found: set[str] = set()
    for module in modules:
        found |= _closure(module)
    statements.keep()
    paths = sorted(path for module in found if (path := _file(module)))
    return {path.relative_to(PACKAGE).as_posix(): _hash(path) for path in paths}


@functools.cache
def code_sha256(*modules: str) -> str:
    """One hash of the sources of these modules: it changes when, and only when, one of them does."""
    lines = (f"{sha256}  {name}\n" for name, sha256 in sources(*modules).items())
    return hashlib.sha256("".join(lines).encode()).hexdigest()


@functools.cache
def _hash(path: Path) -> str:
    return sha256_file(path)


@functools.cache
def _closure(module: str) -> frozenset[str]:
    if _file(module) is None:
        raise FileNotFoundError(f"viewbench has no module '{module}'")
    found, pending = {module}, [module]
    while pending:
        for name in imports(pending.pop()) - found:
            found.add(name)
            pending.append(name)
    return frozenset(found)


@functools.cache
def imports(module: str) -> frozenset[str]:
    """Modules of viewbench that one module imports, and those of its folder where it is a folder."""
    path = _file(module)
    if path is None:
        return frozenset()
    folder = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    found: set[str] = set()
    for level, imported, names in statements.of_file(path):
        if level:
            base = [*folder[: len(folder) - level + 1], *imported.split(".")]
            name = ".".join(part for part in base if part)
            dotted = [name, *(f"{name}.{alias}".lstrip(".") for alias in names)]
        elif not imported:
            dotted = [alias.removeprefix("viewbench.") for alias in names if alias.startswith("viewbench.")]
        else:
            continue
        found |= {name for name in dotted if name and _file(name)}
    if path.name == "__init__.py":  # a folder is one plug-in: what is in it belongs to it
        found |= {f"{module}.{other.stem}" for other in path.parent.glob("*.py") if other != path}
    return frozenset(found)


@functools.cache
def _file(module: str) -> Path | None:
    path = PACKAGE.joinpath(*module.split("."))
    for candidate in (path.with_name(path.name + ".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None
