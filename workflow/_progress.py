"""One line for the whole study: cells done of all, and the time left; and what failed, in words.

Snakemake tells its loggers about every job. The default profile silences what it would print of them, and a handler
of ours counts the jobs that finish cells instead.
"""

import logging
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

STEPS = {"select": 0.02, "train": 0.88, "evaluate": 0.10}  # rough share of a cell's time, so that the bar moves evenly


class Progress(logging.Handler):
    """Counts cells from Snakemake's log records; draws a bar on a terminal, a line now and then otherwise."""

    def __init__(self, cells: int, stream: Any = None, clock: Any = time.monotonic):
        super().__init__(logging.INFO)
        self.cells, self.stream, self.clock = cells, stream or sys.stderr, clock
        self.jobs: dict[int, tuple[str, list[str]]] = {}
        self.planned = dict.fromkeys(STEPS, 0)
        self.finished = dict.fromkeys(STEPS, 0)
        self.failures: set[str] = set()  # outputs of jobs; some releases report one failure twice
        self.began: float | None = None
        self.last_line = -1e9
        self.width = 0

    def emit(self, record: logging.LogRecord) -> None:
        event = getattr(getattr(record, "event", None), "name", None)
        if event == "RUN_INFO":
            self._plan(getattr(record, "stats", None) or {})
        elif event == "JOB_INFO":
            job = vars(record)
            self.jobs[job["jobid"]] = (job["rule_name"], list(job["log"] or []))
        elif event == "JOB_FINISHED":
            rule, _ = self.jobs.get(getattr(record, "job_id", -1), ("", []))
            if rule in self.finished:
                self.finished[rule] += 1
            self._show(final=rule == "page")
        elif event == "JOB_ERROR":
            self._fail(record)

    def _plan(self, stats: dict[str, Any]) -> None:
        # Stats are {"total": n, rule: n, ...} or {"stats": ...}; a rule that is not planned is missing.
        for step in STEPS:
            self.planned[step] = int(stats.get(step, 0) or 0)
        self.began = self.clock()
        self._show()

    def _fail(self, record: logging.LogRecord) -> None:
        rule = getattr(record, "rule_name", "?")
        words = last_line(list(getattr(record, "log", []) or []))
        output = ", ".join(getattr(record, "output", []) or [])
        if output in self.failures:
            return
        self.failures.add(output)
        self._clear()
        print(f"failed: {rule} of {output}: {words or 'see its log'}", file=self.stream, flush=True)

    @property
    def done(self) -> int:
        """Cells that have their files: those of earlier runs and those of this one."""
        return self.cells - self.planned["evaluate"] + self.finished["evaluate"]

    @property
    def seconds_left(self) -> float | None:
        """Estimate from the share of this run's work that is done; None before anything is."""
        whole = sum(share * self.planned[step] for step, share in STEPS.items())
        part = sum(share * self.finished[step] for step, share in STEPS.items())
        if self.began is None or not part or self.finished["train"] == 0:
            return None
        return (self.clock() - self.began) * (whole - part) / part

    def text(self) -> str:
        """The line: cells, failures, elapsed time and time left."""
        left = self.seconds_left
        parts = [f"{self.done} of {self.cells} cells"]
        if self.failures:
            parts.append(f"{len(self.failures)} failed")
        if self.began is not None:
            parts.append(f"{_clock(self.clock() - self.began)} so far")
        if self.done < self.cells:
            parts.append(f"about {_clock(left)} left" if left is not None else "starting")
        else:
            parts.append("reports")
        return ", ".join(parts)

    def _show(self, final: bool = False) -> None:
        terminal = bool(getattr(self.stream, "isatty", lambda: False)())
        now = self.clock()
        if terminal:
            share = self.done / self.cells if self.cells else 1.0
            line = f"[{'#' * round(30 * share):<30}] {self.text()}"
            print("\r" + line.ljust(self.width), end="\n" if final else "", file=self.stream, flush=True)
            self.width = len(line)
        elif final or now - self.last_line > 20:
            self.last_line = now
            print(self.text(), file=self.stream, flush=True)

    def _clear(self) -> None:
        if self.width:
            print("\r" + " " * self.width + "\r", end="", file=self.stream)


def attach(workflow: Any, cells: int) -> None:
    """Adds the progress line to a real run of the main process, and silences the chatter around it."""
    if workflow.output_settings.dryrun or not workflow.is_main_process:
        return
    from snakemake.logging import logger

    for handler in logger.handlers:
        if isinstance(handler, Progress):
            return
        if handler.name == "DefaultStreamHandler":
            handler.addFilter(_worth_reading)
    logger.addHandler(Progress(cells))


def _worth_reading(record: logging.LogRecord) -> bool:
    """Of what Snakemake itself would print: warnings, its own errors (those of jobs are ours), and the end."""
    event = getattr(record, "event", None)
    if event is not None:
        # A job's failure is an error of Snakemake's too, which the line with the job's last words says better.
        of_a_job = getattr(record, "exception", "") == "RuleException" and "CalledProcessError" in str(record.msg)
        return getattr(event, "name", "") in ("ERROR", "GROUP_ERROR") and not of_a_job
    return record.levelno >= logging.WARNING or "Nothing to be done" in str(record.msg)


def salvage(study: Any, given: str) -> None:
    """After a failure: gathers, tracks and reports the cells that are there, so that nothing finished is lost."""
    results = Path("results") / study.name
    if not any(results.glob("cells/**/metrics.json")) or not all(
        (results / "scenes" / f"{scene}.json").is_file() for scene in study.scenes
    ):
        return
    print("Reporting the cells that are finished; the same command takes up the rest.", file=sys.stderr)
    for arguments in (
        ["collect", given, "--partial"],
        ["track", given, "--stamp", str(results / "tracked.partial.json")],
        ["report", str(results)],
    ):
        subprocess.run([sys.executable, "-m", "viewbench", *arguments], check=False)


def last_line(logs: list[str]) -> str:
    """Last line of the last of the logs that has one."""
    for log in reversed(logs):
        path = Path(str(log).split(" ", 1)[0])
        if path.is_file():
            lines = [line for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
            if lines:
                return lines[-1]
    return ""


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d} h" if minutes >= 100 else f"{minutes}:{rest:02d} min"
