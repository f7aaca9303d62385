"""Data flows one way: `common → scenes → selectors → backends → reports → workflow`, and nothing imports upward.

The arrows are those of relative imports, which any editor and type checker follows too.
"""

import ast
import json
import subprocess
import sys

import pytest

from viewbench.common import sources
from viewbench.common.settings import PACKAGE

FLOORS = ("common", "scenes", "selectors", "backends", "reports", "workflow")


def modules(folder: str) -> list[str]:
    paths = (PACKAGE / folder).rglob("*.py")
    parts = (path.relative_to(PACKAGE).with_suffix("").parts for path in paths)
    return sorted(".".join(part for part in names if part != "__init__") for names in parts)


def test_no_import_leads_upward():
    upward = [
        f"{module} imports {target}"
        for height, folder in enumerate(FLOORS)
        for module in modules(folder)
        for target in sources.imports(module)
        if target.split(".")[0] in FLOORS[height + 1 :]
    ]
    assert upward == []


def test_the_floors_stand_on_one_another():
    """What the first test looks at is there: else an import that nobody sees would pass it."""
    arrows = {
        (folder, target.split(".")[0])
        for folder in FLOORS
        for module in modules(folder)
        for target in sources.imports(module)
    }
    stands_on = {(upper, "common") for upper in FLOORS[1:]} | {("workflow", lower) for lower in FLOORS[:-1]}
    assert stands_on <= arrows
    assert {("selectors", "scenes"), ("backends", "scenes"), ("backends", "selectors")} <= arrows


@pytest.mark.parametrize("folder", FLOORS)
def test_the_package_is_imported_by_relative_names(folder):
    """An absolute `viewbench.…` is known to the installed finder alone."""
    for path in (PACKAGE / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            named += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not [name for name in named if name and name.split(".")[0] == "viewbench"], path


def test_editors_find_the_package_by_its_name():
    assert (PACKAGE / ".editor" / "viewbench").resolve() == PACKAGE


@pytest.mark.slow
def test_a_fresh_clone_shows_no_red_line(tmp_path):
    """Before anything is installed what is missing is a warning, and nothing an error; `make types` is for after."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "bare")], check=True)
    python = tmp_path / "bare" / "bin" / "python"
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", str(python), "--project", str(PACKAGE)]
    found = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
    errors = [item for item in found["generalDiagnostics"] if item["severity"] == "error"]
    assert errors == []
    assert found["summary"]["filesAnalyzed"] > 200
    unresolved = [item["message"] for item in found["generalDiagnostics"] if '"viewbench' in item["message"]]
    assert unresolved == [], "the package itself is found whatever the clone is called"
