"""A run whose jobs a scheduler such as Slurm starts: what is done before, and what a job there does otherwise.

Snakemake puts several cells into one allocation (`groups` of the profile). Of such a group it knows only whether all
of it went well. So that a cell that fails, or an allocation that is killed, costs no other cell: the jobs of a group do
not wait for each other's success, what is there stays (`keep-incomplete` of the profile; files appear whole or not at
all), and a second attempt makes what is missing. What is to be made again is removed before the first.
"""

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

SLURM = "slurm"  # the executor
RUNS = Path(".snakemake") / "slurm_runs"  # names of this folder's runs whose jobs may be in the queue, one a line
PATIENCE_S = 300.0  # for cancelled jobs to end
POLL_S = 1.0


class Unforced(set):
    """Takes nothing in."""

    def update(self, *_: object) -> None:
        pass


class Nodes(set):
    """Nodes that failed, which the plugin (2.8.0) has sbatch avoid. It asks sacct for the node of a job that is in the
    queue again, which has none: "None assigned", with which sbatch refuses every job of the run."""

    def add(self, name: str) -> None:
        if " " not in name:
            super().add(name)


def inside(workflow: Any) -> None:
    """In a process that the scheduler has started for a job or a group: to be called when its jobs are looked up, since
    these settings are not there yet when the workflow is read."""
    workflow.execution_settings.keep_going = True
    os.environ["VIEWBENCH_COMPUTE_RETRIES"] = "0"  # the scheduler's next attempt has more memory, and time of its own
    if workflow.execution_settings.attempt > 1:
        # Snakemake has such a process make all jobs of its group, whatever is there. (Where another release keeps that
        # elsewhere, all are made again.)
        workflow.dag.forcefiles = Unforced()


def start(workflow: Any) -> None:
    """Before the first job, when Snakemake has the folder locked, so that no other run is at it."""
    if not workflow.is_main_process or workflow.executor_plugin.name != SLURM:
        return
    _check_scheduler()
    cancel_leftovers(RUNS)
    executor = workflow.scheduler._executor
    # The plugin gives all jobs of a run one name.
    RUNS.write_text(f"{executor.run_uuid}\n", encoding="utf-8")
    executor._failed_nodes = Nodes(getattr(executor, "_failed_nodes", ()))
    if workflow.execution_settings.keep_incomplete:
        for job in workflow.dag.needrun_jobs():
            if not job.is_local:
                for file in job.output:
                    Path(file).unlink(missing_ok=True)


def _check_scheduler() -> None:
    """Raises WorkflowError where Slurm does not answer: the plugin would wait without a word."""
    from snakemake.exceptions import WorkflowError

    try:
        _queued(["nobody"])
    except (OSError, subprocess.SubprocessError) as error:
        said = str(getattr(error, "stderr", None) or error).strip().splitlines()
        raise WorkflowError(
            f"Slurm does not answer here, squeue says: {said[-1] if said else 'nothing'}; type this on a login node"
        ) from None


def cancel_leftovers(runs: Path) -> None:
    """Cancels the jobs of an earlier run that was killed before them, and waits for their end: two jobs that write one
    cell's files must not run at once. Raises TimeoutError where they do not end."""
    names = runs.read_text(encoding="utf-8").split() if runs.is_file() else []
    deadline, told = time.monotonic() + PATIENCE_S, False
    while names and (left := _queued(names)):
        if not told:
            print(f"viewbench: {len(left)} jobs of an earlier run are in Slurm's queue; cancelling", file=sys.stderr)
            told = True
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run(["scancel", "--quiet", *left], check=False, timeout=60)
        if time.monotonic() > deadline:
            raise TimeoutError(f"jobs of an earlier run do not end, cancel them by hand: scancel {' '.join(left)}")
        time.sleep(POLL_S)


def _queued(names: list[str]) -> list[str]:
    """Numbers of the jobs of these names in Slurm's queue; those that are ending still are in it."""
    command = ["squeue", "--noheader", "--user", str(os.getuid()), "--name", ",".join(names), "--format", "%i"]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.split()
