"""Machines that log one study: each has a copy of its results, into which cells come, and processes that log them."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.reports.test_tracking import describe, write_cell
from viewbench.common.cells import cell_folder, cell_name
from viewbench.common.settings import load as load_settings
from viewbench.workflow import _study

USER, PASSWORD = "admin", "a-word-4711-nobody-says"
STUDY = """title: A study for a server
scenes: [room_human]
selectors: [uniform, random, maxmin, kcenter]
ratios: [{ratios}]
seeds: [0, 1]
backends: [{{name: splat, backend: splat, budget: {{iterations: 20}}}}]
width: 48
reference: false
"""
# `viewbench` for which a study of hours has gone by in minutes: `--follow` looks sooner, and asks again sooner.
HURRIED = """
import sys
from viewbench.reports import _tracking_follow
_tracking_follow.LOOK_S, _tracking_follow.SETTLE_S, _tracking_follow.AWAY_S = 1.0, 0.5, 3.0
from viewbench.__main__ import main
sys.argv = ["viewbench", *sys.argv[1:]]
sys.exit(main())
"""
ENDS_S = 60.0  # in which a process that follows a run ends after it


class Study:
    """A file of a study, made-up cells of it where they are wanted, and the variables under which it is logged."""

    def __init__(self, folder: Path, name: str, address: str, cells: int):
        self.name, self.folder, self.file = name, folder, folder / f"{name}.yaml"
        ratios = ", ".join(f"{0.02 + 0.01 * i:.2f}" for i in range(max(1, cells // 8)))
        self.file.write_text(STUDY.format(ratios=ratios), encoding="utf-8")
        self.cells = _study.load(str(self.file), load_settings()).cells()
        self.environment = {
            **os.environ,
            "VIEWBENCH_TRACKING_URI": address,
            "VIEWBENCH_TRACKING_PATIENCE": "240",
            "MLFLOW_TRACKING_USERNAME": USER,
            "MLFLOW_TRACKING_PASSWORD": PASSWORD,
        }

    def make_cells(self) -> Path:
        """results/STUDY with all cells, no two of which have the same score."""
        results = self.folder / "made" / "results" / self.name
        describe(results, "room_human")
        for number, cell in enumerate(self.cells):
            write_cell(results, cell, psnr_db=20.0 + number / 8)
        return results


class Machine:
    """One of those that log the study; `results` is its results/STUDY."""

    def __init__(self, study: Study, number: int, made: Path):
        self.study, self.made, self.folder = study, made, study.folder / f"{study.name}-{number}"
        self.results = self.folder / "results" / study.name
        shutil.copytree(made / "scenes", self.results / "scenes")
        self.said = self.folder / "followed.txt"
        self.process: subprocess.Popen | None = None

    def take(self, cell: Mapping[str, str]) -> None:
        """The cell is there, as a machine gets it that shares the results; times of files stay as they are."""
        target = cell_folder(self.results, cell)
        arrives = self.folder / "arrives"
        shutil.copytree(cell_folder(self.made, cell), arrives)
        target.parent.mkdir(parents=True, exist_ok=True)
        arrives.rename(target)

    def follow(self) -> None:
        """Begins the process that follows a run."""
        with open(self.said, "ab") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-c", HURRIED, *self._asked("--follow", "--of-run")],
                env=self.study.environment,
                cwd=self.folder,
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=said,
            )
        assert self.process.stdin
        self.process.stdin.write(b"[]\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        """As a crash ends the process that follows."""
        if self.process:
            self.process.send_signal(signal.SIGKILL)
            self.process.communicate()

    def end(self) -> float:
        """The end of the run: seconds in which the process that follows has ended, too."""
        assert self.process
        began = time.monotonic()
        self.process.communicate(timeout=ENDS_S)
        return time.monotonic() - began

    def account(self) -> dict[str, Any]:
        """What the process that follows says it has done."""
        path = self.results / "logs" / "track" / "follow.json"
        found = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        return found if self.process and found.get("pid") == self.process.pid else {"cells": 0, "longest_s": 0.0}

    def track(self) -> subprocess.CompletedProcess:
        """`viewbench track`, as a user calls it."""
        command = [sys.executable, "-m", "viewbench", *self._asked()]
        done = subprocess.run(command, env=self.study.environment, cwd=self.folder, capture_output=True, text=True)
        said = done.stdout + done.stderr
        assert PASSWORD not in said
        assert "Traceback" not in said, said
        return done

    def _asked(self, *options: str) -> list[str]:
        return ["track", str(self.study.file), "--results", str(self.results.parent), *options]


def all_at_once(machines: list[Machine]) -> str:
    """Each machine's `track`: their exit statuses, how many runs they made, and what those said that failed."""
    with ThreadPoolExecutor(len(machines)) as pool:
        done = list(pool.map(Machine.track, machines))
    made = sum(int(one.stdout.split()[0]) for one in done if one.stdout)
    failed = [one.stderr.strip().splitlines()[-1] for one in done if one.returncode]
    return f"exit statuses {dict(Counter(one.returncode for one in done))}, {made} new runs of cells" + "".join(
        f"\n    {words}" for words in failed
    )


def names(study: Study) -> list[str]:
    """The cells of a study, sorted."""
    return sorted(map(cell_name, study.cells))
