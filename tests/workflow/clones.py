"""Copies of the package in which tests run studies, edit files and see what runs again."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.conftest import copy_package, environment_of

ROOT = Path(__file__).parents[2]


class Clone:
    """A copy of viewbench with a study of its own, `workflow/studies/mini.yaml`."""

    def __init__(self, parent: Path, study: str):
        self.folder = copy_package(parent)
        (self.folder / "workflow" / "studies" / "mini.yaml").write_text(study, encoding="utf-8")

    @property
    def results(self) -> Path:
        return self.folder / "results" / "mini"

    def copied(self, parent: Path) -> "Clone":
        """The same in another folder; times of files are kept, so that nothing looks changed."""
        other = Clone.__new__(Clone)
        other.folder = parent / "viewbench"
        parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-a", str(self.folder), str(other.folder)], check=True)
        return other

    def environment(self, **variables: str) -> dict[str, str]:
        """Variables under which Python, `viewbench` and the tests' own modules are those of this copy."""
        found = environment_of(self.folder)
        paths = os.pathsep.join([found["PYTHONPATH"], str(ROOT)])
        return {**found, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(self.folder.parent / "cache"), **variables}

    def call(self, *command: str, **variables: str) -> subprocess.CompletedProcess:
        """Runs a module of Python in the copy."""
        environment = self.environment(**variables)
        return subprocess.run(
            [sys.executable, "-m", *command],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=600,
        )

    def snakemake(self, *arguments: str, study: str = "mini", **variables: str) -> subprocess.CompletedProcess:
        return self.call("snakemake", "-j2", *arguments, "--config", f"study={study}", "--", "reports", **variables)

    def begin(self, output: Any = subprocess.DEVNULL, **variables: str) -> subprocess.Popen:
        """The same command begun and not waited for, in a session of its own, as a terminal's programs begin."""
        command = [sys.executable, "-m", "snakemake", "-j2", "--config", "study=mini", "--", "reports"]
        return subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment(**variables),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            preexec_fn=_usual,
        )

    def run(self, **variables: str) -> str:
        """Runs the study to its end; returns what was printed."""
        done = self.snakemake(**variables)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def planned(self, **variables: str) -> dict[str, int]:
        """Jobs by rule that a run would do now."""
        done = self.snakemake("-n", **variables)
        assert done.returncode == 0, done.stdout + done.stderr
        table = done.stdout + done.stderr
        jobs = {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)}
        jobs.pop("total", None)
        return jobs

    def edit(self, name: str, old: str = "", new: str = "\n# edited\n") -> None:
        """Replaces a text in a file of the copy, or appends to it."""
        path = self.folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{name} has no {old!r}"
        path.write_text(text.replace(old, new, 1) if old else text + new, encoding="utf-8")


def _usual() -> None:
    """As a terminal starts a program, and not as a shell's background does, where some signals are ignored."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def take_frames(room: Path, folder: Path, count: int) -> Path:
    """A capture of its own, without a test split: so many frames of the generated room in one transforms.json."""
    import json

    table = json.loads((room / "transforms_train.json").read_text(encoding="utf-8"))
    table["frames"] = table["frames"][:: len(table["frames"]) // count][:count]
    (folder / "train").mkdir(parents=True)
    for frame in table["frames"]:
        shutil.copy(room / frame["file_path"], folder / frame["file_path"])
    shutil.copy(room / "points3d.ply", folder / "points3d.ply")
    (folder / "transforms.json").write_text(json.dumps(table), encoding="utf-8")
    return folder
