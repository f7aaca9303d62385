"""Tries the Slurm profile for real: `make test-slurm`, a quarter of an hour on two cores that are busy otherwise.

    python -m tests.slurm [--install] [--keep FOLDER]

Needs root, and Debian's packages slurmctld, slurmd, slurmdbd, slurm-client, munge and mariadb-server, which --install
has apt install. A cluster of two nodes is started on this machine, in a temporary folder (cluster.py), and stopped in
the end, whatever happens. A study of 24 cells is run on one machine, and again by Slurm, where

* choices get too little memory at first, and are killed;
* the main process is killed while jobs run and wait, and started again;
* of the jobs with cells one is cancelled, one hangs until its time is up, and one loses its node.

Then both must have the same results, bit for bit; a job asks for a GPU only where its rule does; what Slurm counted is
printed, and summed.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from .accounts import Allocation, allocations, sums, table
from .cluster import Cluster, install, missing
from .compare import differences

ROOT = Path(__file__).resolve().parents[2]
STUDY = Path(__file__).with_name("study.yaml")
SLURM = ROOT / "workflow" / "profiles" / "slurm"
LOCAL = ROOT / "workflow" / "profiles" / "default"
CELLS = 24
GROUP = 4  # cells an allocation
PATIENCE_S = 1800.0
# Choices are given 20 MB at first, which Python alone exceeds.
STARVED = "select:mem_mb=20 if attempt == 1 else 1500"


def main() -> int:
    """Returns the number of things that went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--install", action="store_true", help="install missing packages by apt")
    parser.add_argument("--keep", type=Path, help="run here and leave all files")
    given = parser.parse_args()
    if os.getuid() != 0:
        print("This starts Slurm's daemons, which want root: sudo make test-slurm", file=sys.stderr)
        return 1
    if packages := missing():
        if not given.install:
            print(f"Not installed: apt-get install {' '.join(packages)}, or make test-slurm INSTALL=1", file=sys.stderr)
            return 1
        install(packages)
    folder = given.keep or Path(tempfile.mkdtemp(prefix="viewbench-slurm-", dir="/tmp"))
    folder.chmod(0o755)  # munge refuses a socket that others do not get to
    try:
        return attempt(folder)
    finally:
        if not given.keep:
            shutil.rmtree(folder, ignore_errors=True)


def attempt(folder: Path) -> int:
    """Runs everything in `folder`."""
    wrong: list[str] = []
    say("the study on one machine")
    one, two = folder / "one", folder / "two"
    with Cluster(folder / "slurm") as cluster:
        done = run(one, os.environ.copy(), LOCAL, "-j2")
        wrong += [] if done.wait(PATIENCE_S) == 0 else ["the run on one machine failed"]
        say("the same by Slurm; its main process is killed when the first cells are trained")
        main_process = by_slurm(two, cluster)
        wait(main_process, lambda: cells_jobs(cluster, "RUNNING"), "cells")
        os.killpg(main_process.pid, signal.SIGKILL)
        main_process.wait()
        left = cluster.call("squeue", "--noheader", "--format=%i %T").splitlines()
        say(f"killed; {len(left)} jobs are left in the queue; starting it again")
        wrong += [] if left else ["no job was left when the main process was killed"]
        before = {line.split()[0] for line in left}
        main_process = by_slurm(two, cluster)
        harm(main_process, cluster, before)
        status = main_process.wait(PATIENCE_S)
        wrong += [] if status == 0 else [f"the run by Slurm ended with {status}"]
        found = allocations(cluster.environment)
    print(table(found), sums(found), sep="\n\n")
    wrong += check(found)
    wrong += differences(one / "results" / "study", two / "results" / "study")
    scored = len(list((two / "results" / "study" / "cells").rglob("metrics.json")))
    wrong += [] if scored == CELLS else [f"{scored} of {CELLS} cells are scored"]
    last = [one for one in found if one.purpose == "cells" and one.state == "COMPLETED"]
    say(f"{scored} cells in {len(last)} allocations that completed")
    for line in wrong or ["all is as it should be"]:
        say(line)
    return len(wrong)


def harm(main_process: subprocess.Popen, cluster: Cluster, seen: set[str]) -> None:
    """Cancels a job with cells, shortens the time of another, and kills a third one's node; none of those `seen`."""

    def another() -> str:
        def running() -> list[str]:
            return [job for job in cells_jobs(cluster, "RUNNING") if job not in seen]

        number = wait(main_process, running, "another job with cells")[0]
        seen.add(number)
        return number

    number = another()
    cluster.call("scancel", number)
    say(f"cancelled job {number}")
    number = another()
    cluster.call("scontrol", "update", f"JobId={number}", "TimeLimit=1")
    cluster.call("scancel", "--full", "--signal=STOP", number)
    say(f"job {number} hangs, and has a minute")
    number = another()
    node = cluster.call("squeue", "--noheader", "--jobs", number, "--format=%N").strip()
    cluster.fail(node)
    say(f"{node} has failed, which had job {number}")
    time.sleep(20)
    cluster.node(node)


def cells_jobs(cluster: Cluster, state: str) -> list[str]:
    """Numbers of the jobs with cells."""
    listed = cluster.call("squeue", "--noheader", f"--states={state}", "--format=%i %k").splitlines()
    return [line.split()[0] for line in listed if " rule_cells-" in line or " group_cells-" in line]


def wait(main_process: subprocess.Popen, found, what: str) -> list[str]:
    """What `found` finds, once it does; raises RuntimeError where the run ends first."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline and main_process.poll() is None:
        with suppress(subprocess.SubprocessError):
            if jobs := found():
                return jobs
        time.sleep(1)
    raise RuntimeError(f"the run ended or hung before there were {what}")


def check(found: list[Allocation]) -> list[str]:
    """What Slurm's accounts must show."""
    wrong = []
    states = {one.state.split()[0] for one in found if one.purpose == "cells"}
    wrong += [f"no job with cells is {state}" for state in ("CANCELLED", "NODE_FAIL") if state not in states]
    # The step is ended first, and its script may fail before Slurm says TIMEOUT.
    late = [one for one in found if one.limit_minutes == 1 and one.elapsed_s >= 60 and one.state != "COMPLETED"]
    wrong += [] if late else ["no job ran out of time"]
    choices = [one for one in found if one.purpose == "choices"]
    starved = [one for one in choices if one.state != "COMPLETED" and one.asked_mb < 100]
    wrong += [] if starved else ["no choice was killed for want of memory"]
    wrong += [f"job {one.number} has a GPU" for one in found if "gres/gpu" in one.tres]
    return wrong


def by_slurm(folder: Path, cluster: Cluster) -> subprocess.Popen:
    # All groups, since these take the place of the profile's.
    groups = [f"cells-{{backend}}-{{scene}}-{{selector}}={GROUP}", "choices-{scene}-{selector}=50"]
    options = ["--set-resources", STARVED, "--group-components", *groups]
    quick = ["--slurm-init-seconds-before-status-checks", "3", "--latency-wait", "10"]
    return run(folder, environment(cluster), SLURM, *options, *quick)


def environment(cluster: Cluster) -> dict[str, str]:
    return {**cluster.environment, "TMPDIR": "/tmp"}


def run(folder: Path, variables: dict[str, str], profile: Path, *options: str) -> subprocess.Popen:
    """Starts a run of the study in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    return subprocess.Popen(command(folder, profile, *options), cwd=folder, env=variables, start_new_session=True)


def command(folder: Path, profile: Path, *options: str) -> list[str]:
    start = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    start += ["--workflow-profile", str(profile), *options]
    return [*start, "--config", f"study={STUDY}", "--", "reports"]


def say(words: str) -> None:
    print(f"-- {time.strftime('%H:%M:%S')} {words}", flush=True)


if __name__ == "__main__":
    sys.exit(min(main(), 1))
