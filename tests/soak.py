"""Runs a small study and kills what it is made of, again and again, until it is done: is anything lost or doubled?

    python -m tests.soak --kills 60 --seed 0

Kills are SIGKILL at random moments: of Snakemake, of a job (the `viewbench` that Snakemake started or the process that
the fork server made for it), of the fork server, of the writers to MLflow during the run (`follow`) and at its end, of
MLflow's server, of the whole process group; and what a terminal does: Ctrl-C, and closing it. After each the user's
command is given again, at once or when everything is quiet. Prints counts, and ends with status 1 where something is
not as in an undisturbed run.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests import soak_checks
from tests.conftest import ROOM
from tests.reports.mlflow_server import Server
from tests.workflow.clones import Clone, take_frames
from viewbench.reports._tracking import NO_TRACKING

STUDY = """
title: Killed again and again
scenes: [walk]
selectors: [uniform, maxmin, logdet]
ratios: [0.2]
seeds: [0, 1]
backends:
  - {backend: splat, options: {gaussians: 600}}
  - {name: longer, backend: splat, options: {gaussians: 900}, budget: {iterations: 400}}
width: 64
budget: {iterations: 200}
reference: false
reports: [psnr_over_ratio, cameras]
"""
SETTINGS = """
[scenes.walk]
path = {walk!r}
holdout = "every:4"

[features]
cache = "results/features"
"""
SMALL = {
    "[uniform, maxmin, logdet]": "[uniform, maxmin]",
    "seeds: [0, 1]": "seeds: [0]",
    "reference:": "encoder: none\nreference:",
}
OF_GROUP = {"group": signal.SIGKILL, "Ctrl-C": signal.SIGINT, "hang-up": signal.SIGHUP}
KINDS = {  # and how often each is tried
    **{"snakemake": 3, "group": 2, "Ctrl-C": 1, "hang-up": 1, "select": 2, "train": 3, "evaluate": 3},
    **{"forked job": 3, "fork server": 1, "follow": 3, "track": 2, "mlflow server": 1},
}
QUIET_S = 60.0  # in which the jobs of a killed run must be gone
FIND_S = 6.0  # in which a process of a kind may come
RUN_S = 600.0


def main() -> int:
    """Exit status 0 where nothing was lost."""
    parser = argparse.ArgumentParser(description="Kill a small study again and again until it is done.")
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder to work in, kept; else a temporary one")
    given = parser.parse_args()
    folder = given.out or Path(tempfile.mkdtemp(prefix="viewbench-soak-"))
    try:
        soak = Soak(folder, random.Random(given.seed))
        soak.work(given.kills)
    finally:
        if given.out is None:
            shutil.rmtree(folder, ignore_errors=True)
    print(f"seed {given.seed}: {soak.report()}")
    for fault in soak.faults:
        print(f"fault: {fault}")
    return int(bool(soak.faults))


class Soak:
    """A study without disturbance, and the same under kills, round after round."""

    def __init__(self, folder: Path, random: random.Random, small: bool = False):
        self.random = random
        study = STUDY
        for old, new in SMALL.items() if small else ():
            study = study.replace(old, new)
        self.small, self.cells = small, 4 if small else 12
        self.clone = Clone(folder / "killed", study)
        walk = take_frames(ROOM, folder / "walk", 24)
        (self.clone.folder / "environment.toml").write_text(SETTINGS.format(walk=str(walk)), encoding="utf-8")
        self.quiet = self.clone.copied(folder / "quiet")
        self.log = folder / "said.txt"
        self.kills: Counter = Counter()
        self.faults: list[str] = []
        self.script: list[str] = []  # kinds of kills to come; at random when it is empty
        self.rounds = self.resumes = self.looked = 0
        self.per_cell: Counter = Counter()
        self.differences = 0

    def work(self, kills: int) -> None:
        """Rounds until so many kills were made."""
        self.quiet.run(**self.untracked())
        if self.small:  # kernels need not be compiled twice
            shutil.copytree(self.quiet.folder.parent / "cache", self.clone.folder.parent / "cache", dirs_exist_ok=True)
        expected = soak_checks.content(self.quiet.results)
        assert sum(name.endswith("metrics.json") for name in expected) == self.cells
        while sum(self.kills.values()) < kills and not self.faults:
            left = kills - sum(self.kills.values())
            self.round(min(left, self.random.randint(8, 14)), self.rounds % 2 == 1, self.rounds % 3 == 2)
            different = soak_checks.differences(expected, soak_checks.content(self.clone.results))
            self.differences += len(different)
            self.faults += [f"differs: {name}" for name in different]

    def round(self, kills: int, server: bool, alone: bool) -> None:
        """The study from nothing to its end, with so many kills on the way; with a tracking `server`, or jobs that
        run `alone`, without a fork server."""
        self.rounds += 1
        shutil.rmtree(self.clone.folder / "results", ignore_errors=True)
        watcher = soak_checks.Watcher(self.clone.results)
        watcher.start()
        tracker = Server(self.clone.folder.parent / f"mlflow-{self.rounds}").start() if server else None
        variables = {"VIEWBENCH_TRACKING_URI": tracker.url} if tracker else self.untracked()
        variables |= {"VIEWBENCH_FORK_SERVER": ""} if alone else {}
        sessions: list[int] = []
        try:
            done = False
            for _ in range(12 * (kills + 2)):
                run = self.start(variables)
                sessions.append(run.pid)
                done = self.disturb(run, kills, tracker)
                kills = self.to_go
                self.resumes += not done
                if done:
                    break
                if self.random.random() < 0.5 and not soak_checks.gone(run.pid, QUIET_S):
                    self.faults.append(f"jobs of a killed run go on: {soak_checks.processes(run.pid)}")
            if not done:
                self.faults.append(f"round {self.rounds} did not come to its end; see {self.log}")
            self.faults += [
                f"orphan: {soak_checks.processes(pid)}" for pid in sessions if not soak_checks.gone(pid, 60)
            ]
            time.sleep(2.5)  # younger temporary files may be somebody's
            planned = self.clone.snakemake("-n", **variables)
            self.faults += (
                [] if "Nothing to be done" in planned.stdout + planned.stderr else ["something is to be done"]
            )
            last = self.start(variables)
            self.faults += [] if last.wait(RUN_S) == 0 else ["the last run failed"]
            if not self.small:
                self.logged(tracker.url if tracker else f"sqlite:///{self.clone.folder}/results/mlflow.db")
        finally:
            if tracker:
                tracker.stop(signal.SIGKILL)
            watcher.stop()
        self.looked += watcher.looked
        self.faults += watcher.wrong
        self.faults += [f"left over: {path}" for path in soak_checks.left_over(self.clone.folder / "results")]

    def untracked(self) -> dict[str, str]:
        """The small soak is in make test, which has no time for MLflow's imports."""
        return {"VIEWBENCH_TRACKING_URI": ""} if self.small else {}

    def logged(self, uri: str) -> None:
        """Every cell has one run, and that is finished."""
        found = soak_checks.runs(uri, "mini")
        self.per_cell.update(Counter(f"{count} {status}" for (_, status), count in found.items()))
        if len(found) != self.cells or set(found.values()) != {1} or {status for _, status in found} != {"FINISHED"}:
            self.faults.append(f"runs in MLflow: {dict(found)}")

    def start(self, variables: dict[str, str]) -> subprocess.Popen:
        """The user's command, in a session of its own."""
        with open(self.log, "ab") as log:
            log.write(f"--- round {self.rounds}\n".encode())
            log.flush()
            return self.clone.begin(log, **variables)

    def disturb(self, run: subprocess.Popen, kills: int, tracker: Server | None) -> bool:
        """Kills up to so many of the run's processes at random; whether it came to its end and all was logged.

        `to_go` is then how many are left.
        """
        self.to_go = kills
        until = time.monotonic() + RUN_S
        while run.poll() is None:
            if time.monotonic() > until:
                self.faults.append("a run hangs")
                os.killpg(run.pid, signal.SIGKILL)
            if self.to_go == 0:
                time.sleep(0.1)
                continue
            kind = self.script.pop(0) if self.script else self.random.choices(list(KINDS), list(KINDS.values()))[0]
            # At a random moment of the run, and where it is of a job, of that; another kind where none comes.
            time.sleep(self.random.uniform(0, 3))
            until_found = time.monotonic() + FIND_S
            while run.poll() is None and time.monotonic() < until_found:
                if self.kill(kind, run, tracker):
                    self.kills[kind] += 1
                    self.to_go -= 1
                    with open(self.log, "a", encoding="utf-8") as log:
                        log.write(f"--- killed: {kind}\n")
                    break
                time.sleep(0.02)
        text = (self.clone.results / "tracked.json").read_text() if run.returncode == 0 else "skipped"
        return ("skipped" not in text or (self.small and NO_TRACKING in text)) and (
            self.clone.results / "reports" / "index.html"
        ).is_file()

    def kill(self, kind: str, run: subprocess.Popen, tracker: Server | None) -> bool:
        """Kills one process of this kind; whether there was one."""
        if kind == "mlflow server":
            if tracker is not None:
                tracker.stop(signal.SIGKILL)
                tracker.start()
            return tracker is not None
        if kind == "snakemake":
            run.kill()
            return True
        if kind in OF_GROUP:
            if kind != "group" and not self._jobs(run):
                return False  # stopped before its jobs it is stopped as any program
            os.killpg(run.pid, OF_GROUP[kind])
            return True
        found = {pid: of for pid, of in soak_checks.processes(run.pid).items() if is_of(kind, *of, run)}
        if not found:
            return False
        pid = self.random.choice(sorted(found))
        time.sleep(self.random.uniform(0, 0.6))
        if soak_checks.processes(run.pid).get(pid) != found[pid]:
            return False
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            return False
        return True

    def _jobs(self, run: subprocess.Popen) -> bool:
        lines = [line for _, line in soak_checks.processes(run.pid).values()]
        return any("/viewbench " in line and "_fork_server" not in line for line in lines)

    def report(self) -> str:
        """The counts, in one line."""
        kinds = ", ".join(f"{self.kills[kind]} {kind}" for kind in KINDS if self.kills[kind])
        cells = ", ".join(f"{count} cells with {what}" for what, count in self.per_cell.items())
        return (
            f"{sum(self.kills.values())} kills ({kinds}), {self.resumes} resumes, {self.rounds} rounds of {self.cells} "
            f"cells, {self.looked} files looked at as they appeared, {self.differences} differences, MLflow: {cells}, "
            f"{len(self.faults)} faults"
        )


def is_of(kind: str, parent: int, line: str, run: subprocess.Popen) -> bool:
    """Whether a process is what `kind` names: the fork server's jobs have its command line."""
    if "_fork_server" in line:
        return kind == ("fork server" if parent == run.pid else "forked job")
    if " --follow " in line:
        return kind == "follow"
    return "viewbench" in line and f" {kind} " in line and not line.startswith(("/bin/bash", "bash", "/bin/sh"))


if __name__ == "__main__":
    sys.exit(main())
