"""What is recorded as the version of an external program."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from viewbench.backends._program import named_files, program_version


def git(folder: Path, *arguments: str) -> str:
    name = ["-c", "user.name=x", "-c", "user.email=x@example.org"]
    done = subprocess.run(["git", "-C", str(folder), *name, *arguments], check=True, capture_output=True, text=True)
    return done.stdout.strip()


def test_a_console_script_has_the_version_of_its_package():
    """ns-train is the same few lines in every release of nerfstudio."""
    script = Path(sys.executable).with_name("pytest")
    version = program_version([str(script), "--data", "{scene}"])
    assert version.startswith(f"pytest {pytest.__version__}, python {sys.version.split()[0]} with packages ")


def test_variables_before_a_program_do_not_change_what_it_is():
    command = [sys.executable, str(Path(__file__))]
    assert named_files(["env", "A=/bin/sh", *command]) == named_files(command)
    assert named_files([]) == []


def test_packages_beside_a_python_program_are_part_of_it(tmp_path):
    """A rasteriser that is built again changes models, and no file that the command line names."""
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "env")], check=True)
    command = [str(python), "-c", "pass"]
    before = program_version(command)
    site = next((tmp_path / "env" / "lib").glob("python*/site-packages"))
    (site / "rasteriser-2.0.dist-info").mkdir()
    (site / "rasteriser-2.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: rasteriser\nVersion: 2.0\n"
    )
    assert program_version(command) != before


def test_the_rest_of_a_checkout_is_part_of_its_script(tmp_path):
    (tmp_path / "train.py").write_text("import other")
    (tmp_path / "other.py").write_text("a = 1")
    command = ["sh", str(tmp_path / "train.py")]
    alone = program_version(command)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "x")
    first = program_version(command)
    assert first == f"{git(tmp_path, 'rev-parse', '--short=12', 'HEAD')}, {alone}"
    (tmp_path / "other.py").write_text("a = 2")
    changed = program_version(command)
    (tmp_path / "other.py").write_text("a = 3")
    assert len({first, changed, program_version(command)}) == 3


def test_a_checkout_around_a_program_is_not_its_own(tmp_path):
    """A virtual environment in a clone of viewbench: no commit of ours makes another program another one."""
    git(tmp_path, "init", "-q")
    (tmp_path / ".gitignore").write_text("env/")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "x")
    (tmp_path / "env").mkdir()
    (tmp_path / "env" / "train.py").write_text("pass")
    assert program_version(["sh", str(tmp_path / "env" / "train.py")]).startswith("sha256:")


def test_untracked_code_and_binary_changes_are_seen(tmp_path):
    (tmp_path / "train.py").write_text("import other")
    (tmp_path / "data.bin").write_bytes(b"\xff\xfe\x00")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "x")
    command = ["sh", str(tmp_path / "train.py")]
    seen = {program_version(command)}
    (tmp_path / "data.bin").write_bytes(b"\xff\xfe\x01")
    seen.add(program_version(command))
    (tmp_path / "other.py").write_text("a = 1")
    seen.add(program_version(command))
    (tmp_path / "other.py").write_text("a = 2")
    seen.add(program_version(command))
    assert len(seen) == 4


def test_a_word_that_is_also_a_program_is_a_word(tmp_path, monkeypatch):
    tool = tmp_path / "black"
    tool.write_text("#!/bin/sh\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert tool not in named_files(["sh", "--background-color", "black"])
    assert named_files(["black"]) == [tool]


def test_a_script_whose_name_begins_like_python_is_not_run_as_one(tmp_path):
    script = tmp_path / "python_train.sh"
    script.write_text(f"#!/bin/sh\ntouch {tmp_path}/ran\n")
    script.chmod(0o755)
    assert program_version([str(script)]).startswith("sha256:")
    assert not (tmp_path / "ran").exists()


def test_a_binary_has_a_hash(tmp_path):
    tool = tmp_path / "tool"
    tool.write_bytes(b"\x7fELF one")
    tool.chmod(0o755)
    first = program_version([str(tool), "{scene}"])
    assert first.startswith("sha256:")
    tool.write_bytes(b"\x7fELF two")
    assert program_version([str(tool), "{scene}"]) != first
    assert named_files([str(tool), "no such file", "x" * 5000]) == [tool]
