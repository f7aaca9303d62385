"""Extras: the table of packages agrees with pyproject.toml, and what is missing is answered by the line to type."""

import re
import sys
import tomllib

import pytest

from tests.conftest import known
from viewbench.backends.splat import available as splat_available
from viewbench.common import extras, plugins
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE
from viewbench.workflow.commands import _main

PROJECT = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def names(requirements: list[str]) -> set[str]:
    """Packages of some requirements, those of viewbench's other extras too, as pip spells them."""
    found = set()
    for requirement in requirements:
        package, extra = known(re.match(r"([\w-]+)(?:\[([\w,]+)\])?", requirement)).groups()
        if package == "viewbench":
            found |= {name for part in extra.split(",") for name in names(PROJECT["optional-dependencies"][part])}
        else:
            found.add(package.lower().replace("_", "-"))
    return found


BASE = names(PROJECT["dependencies"])
EXTRAS = {extra: names(packages) for extra, packages in PROJECT["optional-dependencies"].items()}


@pytest.mark.parametrize("module", extras.OPTIONAL)
def test_the_extra_that_is_named_brings_the_package(module):
    package = extras.OPTIONAL[module]
    assert package.name.lower().replace("_", "-") in (EXTRAS[package.extra] if package.extra else BASE)


def test_every_package_of_an_extra_has_its_line():
    known = {package.name.lower().replace("_", "-") for package in extras.OPTIONAL.values()}
    named = set().union(*(packages for extra, packages in EXTRAS.items() if extra != "dev"))
    not_imported = {"viewbench-rooms", "snakemake-executor-plugin-slurm"}  # data, and what Snakemake finds by itself
    assert named - not_imported <= known


def test_what_is_optional_is_not_in_the_light_install():
    assert {package.name for package in extras.OPTIONAL.values() if package.extra} & BASE == set()


@pytest.fixture
def without(monkeypatch):
    """Makes packages as good as not installed, in this process."""

    def hide(*modules):
        found = extras.importlib.util.find_spec
        monkeypatch.setattr(
            extras.importlib.util, "find_spec", lambda name, *rest: None if name in modules else found(name, *rest)
        )
        for module in modules:
            loaded = [name for name in sys.modules if name.partition(".")[0] == module]
            for name in loaded:
                monkeypatch.delitem(sys.modules, name)
            monkeypatch.setitem(sys.modules, module, None)  # importing it raises ModuleNotFoundError

    return hide


def test_the_first_that_is_missing_is_named(without):
    assert extras.missing("av", "plotly") is None
    without("plotly")
    reason = extras.missing("av", "plotly")
    assert reason == (
        "plotly, which a picture in three dimensions needs, is not installed: pip install 'viewbench[plot]'"
    )
    with pytest.raises(UserError, match=r"^plotly, which dice need, .* 'viewbench\[dev\]'$"):
        extras.need("plotly", use="dice need", extra="dev")


def test_only_a_package_that_is_not_there_is_answered(without):
    assert extras.answer(ModuleNotFoundError(name="plotly.nothing")) is None
    assert extras.answer(ModuleNotFoundError(name="unheard_of")) is None
    assert extras.answer(ModuleNotFoundError()) is None
    without("mlflow")
    assert "'viewbench[study]'" in known(extras.answer(ModuleNotFoundError(name="mlflow.entities")))


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("numba", "train", "train room_human --selection S --out O"),
        ("numba", "train", "select room_human --selector coverage --count 9 --dry-run"),
        ("plotly", "plot", "select room_human --selector uniform --count 9 --dry-run --plot a.html"),
        ("matplotlib", "plot", "select room_human --selector uniform --count 9 --dry-run --plot a.png"),
        ("av", "video", "info walk.mp4"),
        ("yaml", "study", "study quick"),
        ("snakemake", "study", "run quick"),
        ("mlflow", "study", "run quick"),
        ("open_clip", "clip", "features room_human --encoder open_clip"),
    ],
)
def test_a_command_ends_in_the_line_to_type(without, capsys, tmp_path, monkeypatch, module, extra, arguments):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.mp4").write_bytes(b"film")
    chosen = '{"schema": 1, "indices": [0], "selector": "uniform"}'
    (tmp_path / "S").write_text(chosen, encoding="utf-8")
    compiled = ("viewbench.selectors._coverage", "viewbench.common.kernels")
    for name in [name for name in sys.modules if name.startswith(compiled)]:
        monkeypatch.delitem(sys.modules, name)
        parent, _, child = name.rpartition(".")
        monkeypatch.delattr(sys.modules[parent], child, raising=False)  # where `from . import` finds it first
    without(module)
    status = _main.run(arguments.split())
    captured = capsys.readouterr()
    assert (status, captured.out) == (2, "")
    last = captured.err.splitlines()[-1]
    assert last.startswith("viewbench: ")
    assert last.endswith(f"is not installed: pip install 'viewbench[{extra}]'")
    assert "Traceback" not in captured.err
    assert not (tmp_path / "O").exists()


@pytest.mark.parametrize(
    ("kind", "module", "unavailable"),
    [
        ("selectors", "numba", {"coverage"}),
        ("backends", "numba", {"splat"}),
        ("formats", "av", {"video"}),
        ("encoders", "open_clip", {"open-clip"}),
        ("studies", "snakemake", None),
        ("reports", "matplotlib", None),
    ],
)
def test_list_says_the_same_line(without, capsys, kind, module, unavailable):
    without(module)
    assert _main.run(["list", kind]) == 0
    lines = capsys.readouterr().out.splitlines()
    answered = {line.split()[0] for line in lines if f"{extras.missing(module)}]" in line or "[clip]'" in line}
    assert answered == (unavailable or {line.split()[0] for line in lines})


def test_the_backend_says_what_the_table_says(without):
    without("numba")
    assert splat_available() == extras.missing("numba")
    assert plugins.load("selectors", "coverage").available() == extras.missing("numba")
