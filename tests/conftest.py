"""Fixtures that several folders share."""

import fcntl
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest

from viewbench.common.settings import PACKAGE

ROOM = PACKAGE / "scenes" / "generated_room" / "human"
CODE = ("common", "scenes", "selectors", "backends", "reports", "workflow")
DATA = ("generated_room", "rendered")  # folders of scenes/ that are large
T = TypeVar("T")


def known(value: T | None) -> T:
    """The value, which is there."""
    assert value is not None
    return value


def until(condition: Callable[[], bool]) -> None:
    """Waits for it, and fails when it does not come."""
    for _ in range(900):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError("it did not come")


@pytest.fixture(scope="session")
def small_room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Blender-form scene of 12 training and 4 test frames of the generated room, with its points."""
    folder = tmp_path_factory.mktemp("scenes") / "small_room"
    for split, every in (("train", 33), ("test", 10)):
        transforms = json.loads((ROOM / f"transforms_{split}.json").read_text(encoding="utf-8"))
        transforms["frames"] = transforms["frames"][::every][: 12 if split == "train" else 4]
        (folder / split).mkdir(parents=True)
        for frame in transforms["frames"]:
            shutil.copy(ROOM / frame["file_path"], folder / frame["file_path"])
        (folder / f"transforms_{split}.json").write_text(json.dumps(transforms), encoding="utf-8")
    shutil.copy(ROOM / "points3d.ply", folder / "points3d.ply")
    return folder


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], object]], Path]:
    """A folder that is filled once, also where several processes run the tests: `once(name, fill)`."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def once(name: str, fill: Callable[[Path], object]) -> Path:
        folder = shared / name
        with open(shared / f"{name}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (shared / f"{name}.done").exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                fill(folder)
                (shared / f"{name}.done").touch()
        return folder

    return once


@pytest.fixture(scope="session")
def wheel(once) -> Path:
    """The wheel of this checkout."""

    def build(folder: Path) -> None:
        command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(PACKAGE)]
        subprocess.run(command, check=True, capture_output=True)

    return next(once("wheel", build).glob("*.whl"))


@pytest.fixture
def data_root() -> Path:
    """Folder of the real captures; the test is skipped where there is none."""
    root = os.environ.get("VIEWBENCH_DATA")
    if not root:
        pytest.skip("the real captures are not here: VIEWBENCH_DATA is not set")
    return Path(known(root))


@pytest.fixture(scope="session")
def run_viewbench() -> Callable[..., subprocess.CompletedProcess]:
    """Runs the command line in a process of its own, as a user does."""

    def run(*arguments: object, cwd: Path | None = None, **variables: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-m", "viewbench", *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=cwd or PACKAGE,
            env={**os.environ, "OMP_NUM_THREADS": "1", **variables},
            timeout=300,
        )

    return run


def copy_package(parent: Path) -> Path:
    """A copy of the package's code named `viewbench` in `parent`, for tests that edit it; images are linked."""
    clone = parent / "viewbench"
    clone.mkdir(parents=True)
    for name in CODE:
        ignored = shutil.ignore_patterns("__pycache__", *DATA)
        shutil.copytree(PACKAGE / name, clone / name, ignore=ignored, symlinks=True)
    for name in ("__init__.py", "__main__.py", "Snakefile", "environment.toml"):
        shutil.copy(PACKAGE / name, clone / name)
    (clone / "profiles").symlink_to("workflow/profiles")
    for name in DATA:
        (clone / "scenes" / name).symlink_to(PACKAGE / "scenes" / name)
    return clone


def environment_of(clone: Path) -> dict[str, str]:
    """Environment variables that make Python and `viewbench` use the copy."""
    here = str(Path(sys.executable).parent)
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "NUMBA")}
    return {
        **os.environ,
        **threads,
        "PYTHONPATH": str(clone.parent),
        "PATH": here + os.pathsep + os.environ.get("PATH", ""),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
