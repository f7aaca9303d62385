"""One line for the whole study: cells done of all, the time left and what is being done; and what failed, in words.

Snakemake tells its loggers about every job. The default profile silences what it would print of them, and a handler
of ours counts the jobs instead (`_pace.py`). The line is drawn from the moment that the workflow is read, and again
every second, so that it moves also where no job ends; nothing that goes wrong with it reaches the run.
"""

import atexit
import contextlib
import logging
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

from ._pace import Pace, clock
from ._progress_file import EVERY_S, Job, RunFile

TICK_S = 1.0  # between two drawings on a terminal
LITTLE = 1 << 20  # bytes of free space in which no job can be done
LINE_S = 20.0  # between two lines elsewhere
BAR = 20  # characters
# Last words of jobs that ended with their run, and did not fail.
STOPPED = ("viewbench: stopped", "viewbench: the process that ran this is gone", "KeyboardInterrupt")


class Progress(logging.Handler):
    """Counts cells from Snakemake's log records; draws a bar on a terminal, a line now and then otherwise."""

    def __init__(self, study: str, stream: Any = None, clock: Any = time.monotonic):
        super().__init__(logging.INFO)
        self.stream, self.clock = stream or sys.stderr, clock
        self.cells: int | None = None  # known when the study is read
        self.phase = f"reading the study {study}"  # what is done where no job runs
        self.pace = Pace(clock)
        self.failures: set[str] = set()  # outputs of jobs; some releases report one failure twice
        self.began = clock()
        self.last_line = -1e9
        self.width = 0  # of what stands on the terminal's line
        self.over = threading.Event()
        self.folder: Path | None = None  # results/STUDY, of a real run
        self.scheduler = ""  # that jobs are handed to
        self.file: RunFile | None = None  # what `viewbench status` reads, once the folder is this run's alone

    def start(self) -> None:
        """Draws the first line, and one every second from now on, in a thread that ends with the run."""
        self.tick()
        threading.Thread(target=self._keep_ticking, name="progress", daemon=True).start()

    def _keep_ticking(self) -> None:
        while not self.over.wait(TICK_S) and threading.main_thread().is_alive():
            self.tick()

    def tick(self) -> None:
        """Draws the line as it is now."""
        with contextlib.suppress(Exception), self._alone():
            if not self.over.is_set():
                self._show()
                self._tell()

    def says(self, phase: str, cells: int | None = None) -> None:
        """What is being done before the jobs, and the number of cells when that is known."""
        self.phase, self.cells = phase, cells if cells is not None else self.cells
        self.tick()

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(Exception):  # a line that cannot be drawn, or a record of another form: no matter
            self._take(record)

    def _take(self, record: logging.LogRecord) -> None:
        event = getattr(getattr(record, "event", None), "name", None)
        if event == "RUN_INFO":
            self.pace.plan(getattr(record, "stats", None) or {})
            self.phase = "starting"
            if self.folder and not self.file:
                self.file = RunFile(self.folder, self.scheduler)
                atexit.register(self.ends, "stopped")
            self._show(at_once=True)
            self._tell(at_once=True)
        elif event == "JOB_INFO":
            job = vars(record)
            output = _listed(record, "output")
            if output in self.failures:  # it is tried once more
                self.failures.discard(output)
                self.pace.failed[job["rule_name"]] -= 1
                if self.file:
                    self.file.failed.pop(output, None)
            self.pace.begin(job["jobid"], job["rule_name"], dict(job.get("wildcards") or {}))
        elif event == "JOB_FINISHED":
            rule = self.pace.end(getattr(record, "job_id", -1))
            self.phase = "looking for what is next"
            self._show(final=rule == "publish")
        elif event == "JOB_ERROR":
            self._fail(record)
        elif event == "GROUP_ERROR":  # its jobs follow, each with its error
            logs = list(getattr(record, "aux_logs", []) or [])
            self._clear()
            name = getattr(record, "groupid", "?")
            words = said_by_scheduler(logs) or f"see {', '.join(map(str, logs))}"
            print(f"failed: {name}: {words}", file=self.stream, flush=True)

    def _tell(self, at_once: bool = False) -> None:
        """Writes the run's file; a second here or there does not matter to who reads it."""
        if self.file:
            at_once = at_once or (bool(self.pace.running) and time.time() - self.file.wrote > EVERY_S)
            left = self.pace.seconds_left if self.cells is None or self.done < self.cells else None
            self.file.write(self.pace, left, self.pace.doing() or self.phase, at_once)

    def ends(self, how: str) -> None:
        """The run is "finished", or has "failed" or "stopped", whichever is said first."""
        with contextlib.suppress(Exception), self._alone():
            if self.file and not self.file.ended:
                self.file.ended = how
                self._tell(at_once=True)

    def _fail(self, record: logging.LogRecord) -> None:
        files = list(getattr(record, "output", []) or [])
        # A group fails as a whole, and results are there whole or not at all.
        made = getattr(record, "indent", False) and bool(files) and all(Path(file).exists() for file in files)
        ended = self.pace.running.get(getattr(record, "jobid", -1))
        self.pace.end(getattr(record, "jobid", -1), failed=not made)
        rule = getattr(record, "rule_name", "?")
        logs = list(getattr(record, "log", []) or [])
        words = said_by_scheduler(logs) or last_line([log for log in logs if ".snakemake" not in str(log)])
        output = ", ".join(files)
        if made or output in self.failures or words in STOPPED:
            return
        self.failures.add(output)
        if self.file:
            given = dict(ended.wildcards) if ended else {}
            self.file.failed[output] = Job(rule, given, time.time(), words, str(logs[-1]) if logs else "")
            self._tell(at_once=True)
        self._clear()
        print(f"failed: {rule} of {output}: {words or _no_room() or 'see its log'}", file=self.stream, flush=True)

    @property
    def done(self) -> int:
        """Cells that have their files: those of earlier runs and those of this one."""
        return (self.cells or 0) - self.pace.planned["evaluate"] + self.pace.finished["evaluate"]

    def text(self) -> str:
        """The line: cells, failures, elapsed time, time left, and what runs."""
        so_far = f"{clock(self.clock() - self.began)} so far"
        if self.cells is None or not self.pace.planned:
            return f"{self.phase}, {so_far}"
        parts = [f"{self.done} of {self.cells} cells"]
        if self.failures:
            parts.append(f"{len(self.failures)} failed")
        parts.append(so_far)
        left = self.pace.seconds_left if self.done < self.cells else None
        if left is not None:
            parts.append(f"about {clock(left)} left")
        return f"{', '.join(parts)}; {self.pace.doing() or self.phase}"

    def _show(self, at_once: bool = False, final: bool = False) -> None:
        now = self.clock()
        if final:
            self.phase = "the report is there"
            self.over.set()
        if bool(getattr(self.stream, "isatty", lambda: False)()):
            share = self.done / self.cells if self.cells and self.pace.planned else 0.0
            line = f"[{'#' * round(BAR * share):<{BAR}}] {self.text()}"
            line = line[: max(BAR, shutil.get_terminal_size().columns - 1)]  # one that wraps cannot be drawn over
            print("\r" + line.ljust(self.width), end="\n" if final else "", file=self.stream, flush=True)
            self.width = 0 if final else len(line)
        elif final or at_once or now - self.last_line >= LINE_S:
            self.last_line = now
            print(self.text(), file=self.stream, flush=True)

    def _clear(self) -> None:
        if self.width:
            print("\r" + " " * self.width + "\r", end="", file=self.stream, flush=True)
            self.width = 0

    def stop(self) -> None:
        """No line after this; the terminal's is removed."""
        with contextlib.suppress(Exception), self._alone():
            self.over.set()
            self._clear()

    @contextlib.contextmanager
    def _alone(self) -> Any:
        """While the body runs, no other thread draws: Python's logging holds the same lock around `emit`."""
        self.acquire()
        try:
            yield
        finally:
            self.release()

    def passes(self, record: logging.LogRecord) -> bool:
        """Whether Snakemake may print this record, for which the line makes room."""
        worth = _worth_reading(record)
        if worth and "Nothing to be done" in str(record.msg):
            self.stop()
        elif worth:
            with contextlib.suppress(Exception), self._alone():
                self._clear()
        return worth


def attach(workflow: Any, study: str) -> Progress:
    """The run's progress line; in a real run of the main process it is drawn, and the chatter around it silenced."""
    from snakemake.logging import logger

    for handler in logger.handlers:
        if isinstance(handler, Progress):
            return handler
    progress = Progress(study)
    if workflow.output_settings.dryrun or not workflow.is_main_process:
        progress.over.set()
        return progress
    for handler in logger.handlers:
        if handler.name == "DefaultStreamHandler":
            handler.addFilter(progress.passes)
    logger.addHandler(progress)
    progress.folder = Path("results") / study
    progress.scheduler = "" if workflow.local_exec else str(getattr(workflow.executor_plugin, "name", "scheduler"))
    progress.start()
    return progress


def _worth_reading(record: logging.LogRecord) -> bool:
    """Of what Snakemake itself would print: warnings, its own errors (those of jobs are ours), and the end."""
    event = getattr(record, "event", None)
    if event is not None:
        # A job's failure is an error of Snakemake's too, which the line with the job's last words says better.
        of_a_job = getattr(record, "exception", "") == "RuleException" and "CalledProcessError" in str(record.msg)
        return getattr(event, "name", "") == "ERROR" and not of_a_job
    return record.levelno >= logging.WARNING or "Nothing to be done" in str(record.msg)


def farewell(progress: Progress) -> None:
    """After a run that did not come to its end: whether it was stopped, for which Snakemake says that jobs failed."""
    progress.stop()
    progress.ends("failed" if progress.failures else "stopped")
    if not progress.failures:
        print("viewbench: stopped; the same command goes on from here", file=sys.stderr, flush=True)


def salvage(study: Any, given: str) -> None:
    """After a failure: gathers, tracks and reports the cells that are there, so that nothing finished is lost."""
    results = Path("results") / study.name
    # A scene that could not be described, or rendered, has no cells either.
    described = [scene for scene in study.scenes if (results / "scenes" / f"{scene}.json").is_file()]
    if not any(any(results.glob(f"cells/*/{scene}/**/metrics.json")) for scene in described):
        return
    print("Reporting the cells that are finished; the same command takes up the rest.", file=sys.stderr)
    for arguments in (
        ["collect", given, "--partial"],
        ["track", given, "--only", "cells", "--stamp", str(results / "tracked.partial.json")],
        ["report", str(results)],
        ["track", given, "--only", "page", "--stamp", str(results / "published.partial.json")],
    ):
        subprocess.run([sys.executable, "-m", "viewbench", *arguments], check=False)


def _listed(record: logging.LogRecord, what: str) -> str:
    return ", ".join(getattr(record, what, []) or [])


def said_by_scheduler(logs: list[str]) -> str:
    """Why a scheduler ended a job: the last line of Slurm's own in the logs; "" where there is none."""
    found = ""
    for log in logs:
        path = Path(str(log).split(" ", 1)[0])
        if path.is_file():
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            found = next((line for line in reversed(lines) if line.startswith(("slurmstepd", "srun: error"))), found)
    return found


def _no_room() -> str:
    """Why a job that failed may have said nothing: its log had no room either."""
    with contextlib.suppress(OSError):
        return "no space is left in results/" if shutil.disk_usage("results").free < LITTLE else ""
    return ""


def last_line(logs: list[str]) -> str:
    """Last line of the last of the logs that has one."""
    for log in reversed(logs):
        path = Path(str(log).split(" ", 1)[0])
        if path.is_file():
            lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
            if lines:
                return lines[-1]
    return ""
