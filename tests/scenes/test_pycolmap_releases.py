"""The readers and writers of COLMAP's models under the lowest release of pycolmap that is supported.

Under the pinned one all tests of this folder run; a new major release is refused until it was tried.
"""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pycolmap
import pytest

from tests.workflow.clones import ROOT

FILES = ("test_colmap.py", "test_colmap_readers.py", "test_lenses.py", "test_chosen_points.py", "test_written.py")


def bounds() -> tuple[str, str]:
    """The lowest release, and the first that is not allowed, as pyproject.toml has them."""
    lines = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    found = next(match for line in lines if (match := re.fullmatch(r"pycolmap>=([\d.]+),<(\d+)", line)))
    return found[1], found[2]


def test_the_pinned_release_is_the_last_that_is_allowed():
    pinned = re.search(r"^pycolmap==(\d+)\.([\d.]+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
    assert pinned
    assert int(pinned[1]) + 1 == int(bounds()[1])
    assert pycolmap.__version__ == f"{pinned[1]}.{pinned[2]}"


def test_the_lowest_release_reads_and_writes_the_same(tmp_path):
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(tmp_path / "old")]
    lowest = bounds()[0]
    done = subprocess.run([*install, f"pycolmap=={lowest}.0"], capture_output=True, text=True)
    if done.returncode and re.search("connection|resolve|No matching distribution", done.stderr, re.IGNORECASE):
        pytest.skip("no package index is in reach")
    assert done.returncode == 0, done.stderr
    ours = os.environ.get("PYTHONPATH", "")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(tmp_path / "old"), ours]))}
    version = [sys.executable, "-c", "import pycolmap; print(pycolmap.__version__)"]
    told = subprocess.run(version, capture_output=True, text=True, env=environment, check=True)
    assert told.stdout.strip() == f"{lowest}.0"
    tests = [str(Path(__file__).with_name(name)) for name in FILES]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--import-mode=importlib",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
    ]
    done = subprocess.run([*command, *tests], capture_output=True, text=True, env=environment, cwd=ROOT)
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout or "100%" in done.stdout
