"""Finds the plug-ins of a folder: every module in it whose name does not start with an underscore.

Selectors, backends, reports and scene formats are found in this way; no list of them is kept anywhere. A plug-in is
a module (or a folder with `__init__.py`), its name is the module's with `_` written as `-`, and the first line of
its docstring is its summary. Machinery that plug-ins share lives in the same folder in modules that start with `_`.
"""

import ast
import importlib
import importlib.util
import pkgutil
from pathlib import Path
from types import ModuleType

from .errors import UserError, nearest


def names(package: str) -> list[str]:
    """Sorted names of the plug-ins in `package` ("selectors", "scenes.formats"), without importing them."""
    folder = importlib.import_module(f"viewbench.{package}")
    found = (module.name for module in pkgutil.iter_modules(folder.__path__))
    return sorted(name.replace("_", "-") for name in found if not name.startswith("_"))


def load(package: str, name: str) -> ModuleType:
    """Imports one plug-in; `_` and `-` in its name are the same.

    Raises UserError, which names the nearest right one, when there is none such.
    """
    known = names(package)
    name = name.replace("_", "-")
    if name not in known:
        kind = package.rsplit(".", 1)[-1].rstrip("s")
        raise UserError(f"unknown {kind} '{name}'{nearest(name, known)} (there are: {', '.join(known)})")
    return importlib.import_module(module_name(package, name))


def module_name(package: str, name: str) -> str:
    """The import name of a plug-in."""
    return f"viewbench.{package}.{name.replace('-', '_')}"


def source_name(package: str, name: str) -> str:
    """The plug-in's name as `sources` takes it: without the package's own."""
    return module_name(package, name).removeprefix("viewbench.")


def summary(package: str, name: str) -> str:
    """First line of the plug-in's docstring, read without importing it."""
    return (ast.get_docstring(_parsed(package, name)) or "").split("\n", 1)[0]


def defines(package: str, name: str, function: str) -> bool:
    """Whether the plug-in has this function at its top level, found out without importing it."""
    return any(isinstance(node, ast.FunctionDef) and node.name == function for node in _parsed(package, name).body)


def constant(package: str, name: str, variable: str, default: object = None) -> object:
    """Value of a literal that the plug-in assigns at its top level, read without importing it."""
    for node in _parsed(package, name).body:
        if isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets, value = [node.target], node.value
        else:
            continue
        if any(isinstance(target, ast.Name) and target.id == variable for target in targets):
            return ast.literal_eval(value)
    return default


def _parsed(package: str, name: str) -> ast.Module:
    """The plug-in's source; an empty one where there is no such plug-in."""
    spec = importlib.util.find_spec(module_name(package, name))
    source = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
    return ast.parse(source)
