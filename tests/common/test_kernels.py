"""How kernels are compiled and where they are kept: in one place, once for all jobs of a study."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import CODE, copy_package, environment_of
from viewbench.common import kernels, sources
from viewbench.common.settings import PACKAGE

WARM = "from viewbench.backends import splat; from viewbench.selectors import coverage; splat.warm(); coverage.warm()"
MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path
    for folder in CODE
    for path in sorted((PACKAGE / folder).rglob("*.py"))
}
DECORATORS = {"strict", "exact", "written"}


def python(code, **variables):
    """What a new process with a cache of the user's prints."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    return subprocess.check_output([sys.executable, "-c", code], text=True, env={**environment, **variables})


def cached(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.nb[ic]")}


def test_two_processes_on_a_cold_cache_do_not_collide(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    both = [
        subprocess.Popen([sys.executable, "-c", WARM], env=environment, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for process in both:
        _, errors = process.communicate(timeout=240)
        assert process.returncode == 0, errors
    before = cached(tmp_path)
    assert before
    subprocess.run([sys.executable, "-c", WARM], env=environment, check=True)
    assert cached(tmp_path) == before, "a third process compiled something anew"


def test_every_module_with_kernels_is_among_the_sources():
    hashed = set(kernels.sources())
    using = {name for name in MODULES if "common.kernels" in sources.imports(name)}
    assert {"backends.splat.raster", "selectors._coverage_kernels"} <= using
    assert [name for name in sorted(using) if MODULES[name] not in hashed] == []


def test_what_kernels_take_from_other_modules_is_among_the_sources():
    """A constant is compiled into them: numba would not see that it changed."""
    hashed = set(kernels.sources())
    for path in hashed:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        origin = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.level:
                folder = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                for alias in node.names:
                    files = folder.with_suffix(".py"), folder / "__init__.py", folder / f"{alias.name}.py"
                    origin[alias.asname or alias.name] = next(file for file in files if file.is_file())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and DECORATORS & {ast.unparse(item) for item in node.decorator_list}:
                names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                for name in (names & set(origin)) - DECORATORS:
                    assert origin[name] in hashed, f"{path.name}: {node.name} takes {name} from {origin[name]}"


def test_numba_is_imported_in_one_place():
    """Elsewhere its settings might not have been made."""
    importing = []
    for name, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            importing += [name for module in modules if module.split(".")[0] == "numba"]
    assert set(importing) == {"common.kernels"}


@pytest.mark.parametrize("first", ["backends.splat.raster", "selectors._coverage_kernels"])
def test_settings_are_made_before_numba_is_imported(first, tmp_path):
    code = f"import viewbench.{first}; from numba import config; print(config.CACHE_DIR, bool(config.CPU_FEATURES))"
    folder, features = python(code, XDG_CACHE_HOME=str(tmp_path)).split()
    assert (Path(folder).parent, features) == (tmp_path / "viewbench", "True")


def test_an_edited_source_has_another_cache(tmp_path):
    code = "from viewbench.common import kernels; import os; print(os.environ['NUMBA_CACHE_DIR'])"
    clone = copy_package(tmp_path)
    folders = []
    for edited in ("selectors/maxmin.py", "backends/splat/layout.py", "selectors/_coverage_kernels.py"):
        with open(clone / edited, "a", encoding="utf-8") as file:
            file.write("\n# edited\n")
        folders.append(python(code, PYTHONPATH=str(tmp_path)))
    assert len(set(folders)) == 3
    assert folders[0] == python(code), "what has no kernels counts"


def test_without_a_home_numba_keeps_them_itself():
    code = """
import pathlib, os
def home(): raise RuntimeError("Could not determine home directory.")
pathlib.Path.home = home
from viewbench.common import kernels
print("NUMBA_CACHE_DIR" in os.environ)
"""
    assert python(code, XDG_CACHE_HOME="") == "False\n"


def test_a_selection_leaves_nothing_in_the_source_tree(tmp_path):
    clone = copy_package(tmp_path / "package")
    environment = {**environment_of(clone), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    environment.pop("NUMBA_CACHE_DIR", None)
    options = ["room_human", "--selector", "coverage", "--count", "5", "--selection", str(tmp_path / "choice.json")]
    for arguments in (["warm", "--selector", "coverage"], ["select", *options]):
        command = [sys.executable, "-m", "viewbench", *arguments]
        subprocess.run(command, check=True, capture_output=True, env=environment, cwd=tmp_path)
        if arguments[0] == "warm":
            compiled = cached(tmp_path / "cache" / "viewbench")
    assert compiled
    assert cached(tmp_path / "cache" / "viewbench") == compiled, "choosing compiled something that warm did not"
    assert not cached(clone)


def test_every_kernel_is_compiled_for_one_kind_of_arguments(tmp_path):
    """Once for the warm-up and for real training, drawing and choosing."""
    code = f"""
import sys
from viewbench.workflow.commands import _main

def signatures():
    from numba.core.registry import CPUDispatcher  # only now: numba reads its settings when it is first imported

    return {{value.py_func.__name__: len(value.signatures) for name, module in sys.modules.items()
            if name.startswith("viewbench.") for value in vars(module).values() if isinstance(value, CPUDispatcher)}}

{WARM}
warm = signatures()
folder = {str(tmp_path)!r}
chosen, regularised = folder + "/s.json", ["--set", "opacity_weight=0.01", "--set", "scale_weight=0.01"]
train = ["train", "room_human", "--selection", chosen, "--iterations", "40", "--width", "192", "--out", folder + "/m"]
for arguments in (["select", "room_human", "--selector", "coverage", "--count", "5", "--selection", chosen],
                  [*train, *regularised], ["evaluate", folder + "/m", "room_human", "--out", folder + "/m"]):
    assert _main.run(arguments) == 0
print(warm)
print(signatures())
"""
    warm, trained = (ast.literal_eval(line) for line in python(code).splitlines()[-2:])
    called = ["project", "sort_visible", "place_slots", "fill_slots", "place_lists", "fill_lists", "render"]
    called += ["compare", "descend", "render_backward", "project_backward", "regularise", "adam"]
    called += ["_sweep", "observe", "observers", "add"]
    assert {name: warm[name] for name in called} == dict.fromkeys(called, 1)
    assert trained == warm
    assert max(trained.values()) == 1


def test_importing_a_plugin_does_not_import_numba():
    code = """
import sys
from viewbench.backends import splat
from viewbench.selectors import coverage
splat.available()
print('numba' in sys.modules)
"""
    assert python(code) == "False\n"
