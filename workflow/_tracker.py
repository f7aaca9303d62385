"""The process that logs a run's cells to MLflow while the run goes on, and ends with it.

It is told over its standard input which cells are about to be made anew; the end of that input is the end of the run,
however it comes. What it says is in results/STUDY/logs/track/follow.log.
"""

import atexit
import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..common.cells import AXES

GRACE_S = 5.0  # for a request that is under way when the run ends
NICE = 5  # below the trainings, whose seconds are measured


def start(workflow: Any, study: str, results: Path, uri: str) -> None:
    """Starts it, where runs are logged at all."""
    if not uri or not workflow.is_main_process:
        return
    log = results / "logs" / "track" / "follow.log"
    command = [sys.executable, "-P", "-m", "viewbench", "track", study, "--results", str(results.parent), "--follow"]
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        with open(log, "wb") as said:
            # A group of its own: Ctrl-C is for the run, whose end it hears of.
            process = subprocess.Popen(
                [*command, "--of-run"],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=said,
                env=_environment(),
                process_group=0,
            )
    except OSError:
        return  # the end of the study logs all of it
    assert process.stdin
    with contextlib.suppress(OSError):
        process.stdin.write(json.dumps(_stale(workflow)).encode() + b"\n")
        process.stdin.flush()
    ours = os.getpid()

    def stop() -> None:
        if os.getpid() == ours and process.stdin:
            with contextlib.suppress(OSError):
                process.stdin.close()

    atexit.register(stop)


def say_where(results: str, uri: str) -> None:
    """Where Figure 4 of the study is to be seen, once it has been logged."""
    from ..reports import _tracked_link
    from ..reports._tracking_log import is_remote

    folder = Path(results)
    found = _tracked_link.figures(folder.parent, uri).get(folder.name) if uri else None
    if found:
        here = "" if is_remote(uri) else " (while `viewbench dashboard` runs)"
        print(f"Figure 4 in MLflow{here}: {found}", file=sys.stderr, flush=True)


def led() -> tuple[list[str], Callable[[float], bool]]:
    """In that process: the cells that are about to be made anew, and what waits for the end of the run."""
    over = threading.Event()
    try:
        told = json.loads(sys.stdin.buffer.readline() or b"[]")
    except ValueError:
        told = []

    def listen() -> None:
        with contextlib.suppress(OSError, ValueError):
            sys.stdin.buffer.read()
        over.set()
        threading.Event().wait(GRACE_S)
        os._exit(0)

    threading.Thread(target=listen, name="end of the run", daemon=True).start()
    return [name for name in told if isinstance(name, str)], over.wait


def give_way() -> None:
    """Lets the trainings go first, whose seconds are measured."""
    with contextlib.suppress(OSError, AttributeError):
        os.nice(NICE)


def _environment() -> dict[str, str]:
    """One thread is enough, and this is no job of the run."""
    from ._follow import RUN
    from ._fork_client import ADDRESS

    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {key: value for key, value in os.environ.items() if key not in (RUN, ADDRESS)} | one


def _stale(workflow: Any) -> list[str]:
    """Names of the cells that have a score, and that this run will score anew."""
    found = []
    with contextlib.suppress(Exception):  # another release: all scores that are there are taken for sound
        for job in workflow.dag.needrun_jobs():
            if job.rule.name == "evaluate":
                found.append("/".join(job.wildcards_dict[axis] for axis in AXES))
    return found
