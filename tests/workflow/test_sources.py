import subprocess
import sys
from pathlib import Path

import pytest

from viewbench.common import plugins, sources
from viewbench.common.settings import PACKAGE


def files(*modules):
    return set(sources.sources(*modules))


@pytest.mark.parametrize("selector", plugins.names("selectors"))
def test_a_selector_depends_on_itself_and_no_other_selector(selector):
    module = f"selectors.{selector.replace('-', '_')}"
    found = files("workflow.commands.select", module)
    plugin_files = {f"selectors/{name.replace('-', '_')}.py" for name in plugins.names("selectors")}
    assert found & plugin_files == {f"selectors/{selector.replace('-', '_')}.py"}


def test_training_does_not_depend_on_selectors_or_reports():
    found = files("workflow.commands.train", "backends.splat")
    assert "backends/splat/__init__.py" in found
    assert "backends/_train.py" in found
    assert not any(name.startswith("reports/") for name in found)
    assert {name for name in found if name.startswith("selectors/")} == {"selectors/_selection.py"}


def test_the_names_of_sources_are_no_paths_of_the_machine():
    assert all(not Path(name).is_absolute() for name in files("workflow.commands.select", "selectors.maxmin"))


def test_an_import_that_is_marked_is_no_source():
    found = files("workflow.commands.select")
    assert "scenes/load.py" in found
    assert not any(name.startswith("reports/") for name in found), "drawing a choice does not make it another"


def test_relative_imports_are_followed_like_absolute_ones(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    for name, text in {
        "a/one.py": "from .two import x\nfrom . import three\n",
        "a/two.py": "def f():\n    from ..b import y\n",
        "a/three.py": "import viewbench.c\nimport json\n",
        "b.py": "from .d import z  # no source: a test says so\n",
        "c.py": "",
        "d.py": "",
    }.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(sources, "PACKAGE", tmp_path)
    for cached in (sources._closure, sources.imports, sources._file, sources._hash):
        cached.cache_clear()
    found = set(sources.sources("a.one"))
    for cached in (sources._closure, sources.imports, sources._file, sources._hash):
        cached.cache_clear()
    assert found == {"a/one.py", "a/two.py", "a/three.py", "b.py", "c.py"}


def test_reports_do_not_depend_on_what_made_the_results():
    for name in plugins.names("reports"):
        found = files(plugins.module_name("reports", name).removeprefix("viewbench."))
        assert not any(name.startswith(("backends/", "selectors/", "workflow/")) for name in found)


def test_data_flows_one_way():
    order = ["common", "scenes", "selectors", "backends", "reports", "workflow"]
    for number, folder in enumerate(order):
        for path in (PACKAGE / folder).rglob("*.py"):
            module = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
            for imported in sources.imports(module):
                first = imported.split(".")[0]
                assert order.index(first) <= number, f"{module} imports {imported}, which is to its right"


def test_what_is_declared_is_what_is_imported():
    """The modules that a real run loads are among the declared ones (plug-ins loaded by name aside)."""
    code = """
import sys
from viewbench.workflow.commands import _main
assert _main.run(["select", "room_human", "--ratio", "0.05", "--selector", "uniform", "--dry-run"]) == 0
print(*[name for name in sys.modules if name.startswith("viewbench.")], file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE, check=True)
    loaded = {name.removeprefix("viewbench.") for name in done.stderr.split()}
    declared = {
        ".".join(Path(path).with_suffix("").parts).removesuffix(".__init__")
        for path in files("workflow.commands.select", "selectors.uniform", "scenes.formats.transforms")
    }
    undeclared = {name for name in loaded - declared if sources._file(name)}
    # What is said of errors and how, what is done next, what stops a job.
    no_matter = {
        *("workflow.commands._main", "workflow._again", "workflow._follow"),
        *("common.extras", "common.terminal"),
    }
    assert {name for name in undeclared if not name.startswith("scenes.formats.")} <= no_matter


def test_an_unknown_module_is_an_error():
    with pytest.raises(FileNotFoundError):
        sources.sources("selectors.nothing")
