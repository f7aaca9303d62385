"""The repository is the package: what that needs to work is checked here."""

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from viewbench.common.settings import PACKAGE

HEAVY = ["torch", "numba", "mlflow", "pandas", "matplotlib", "scipy", "skimage", "pycolmap", "open_clip", "snakemake"]
FOLDERS = ["common", "scenes", "selectors", "backends", "reports", "workflow", "tests"]


def python(code: str, cwd=PACKAGE) -> str:
    return subprocess.check_output([sys.executable, "-c", code], text=True, cwd=cwd)


def test_folders_do_not_shadow_the_standard_library():
    assert [name for name in FOLDERS if (PACKAGE / name / "__init__.py").exists()] == []
    assert "select" in python("import selectors; print(dir(selectors.DefaultSelector))")
    assert "viewbench" not in python("import selectors; print(selectors.__name__)")
    python("import asyncio, subprocess; asyncio.run(asyncio.sleep(0))")


@pytest.mark.parametrize("command", ["--help", "select --help", "info --help", "train --help", "list --help"])
def test_help_imports_nothing_heavy(command):
    code = f"""
import sys
from viewbench.workflow.commands import _main
assert _main.run({command.split()!r}) == 0
print("loaded:", [name for name in {HEAVY!r} if name in sys.modules])
"""
    assert python(code).splitlines()[-1] == "loaded: []"


def test_the_default_profile_is_where_snakemake_looks():
    assert (PACKAGE / "profiles" / "default" / "config.yaml").samefile(
        PACKAGE / "workflow" / "profiles" / "default" / "config.yaml"
    )


def test_every_folder_of_modules_is_packaged():
    import tomllib

    listed = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    with_code = {path.parent.relative_to(PACKAGE) for name in FOLDERS[:-1] for path in (PACKAGE / name).rglob("*.py")}
    wanted = {".".join(["viewbench", *path.parts]) for path in with_code} | {"viewbench"}
    assert sorted(wanted) == sorted(listed)


def test_the_wheel_works_on_its_own(tmp_path, wheel):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path / "site")!r})
import selectors, viewbench
assert viewbench.__file__.startswith({str(tmp_path)!r}), viewbench.__file__
from viewbench.workflow.commands import _main
assert _main.run(["info", "room_human", "--json"]) == 0
assert _main.run(["study", "quick"]) == 0
"""
    lines = python(code, cwd=tmp_path)
    info, _ = json.JSONDecoder().raw_decode(lines)
    assert info
    assert (tmp_path / "site" / "viewbench" / "workflow" / "Snakefile").is_file()


def test_the_rendered_rooms_are_in_a_wheel_of_their_own(tmp_path, wheel, once):
    """Without it the code says what brings them; with it beside the code they open by name."""

    def build(folder: Path) -> None:
        source = folder / "source"  # setuptools builds beside what it reads
        shutil.copytree(PACKAGE / "scenes" / "rendered", source, symlinks=True)
        command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(source)]
        subprocess.run(command, check=True, capture_output=True)

    rooms = next(once("rooms", build).glob("*.whl"))
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    assert not (site / "viewbench" / "scenes" / "rendered").exists()
    code = f"""
import sys
sys.path.insert(0, {str(site)!r})
from viewbench.workflow.commands import _main
status = _main.run(["select", "office_smooth", "--count", "3", "--dry-run"])
print(status)
"""
    alone = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert alone.stdout == "2\n"
    assert "the wheel viewbench-rooms brings those that ship" in alone.stderr
    with zipfile.ZipFile(rooms) as archive:
        archive.extractall(site)
        assert any(name.endswith("LICENSE") for name in archive.namelist())
    lines = python(code, cwd=tmp_path).splitlines()
    assert lines[-1] == "0"
    assert [line for line in lines if line.startswith("train/")], "views were chosen, by the features that came along"
