"""What a run tells of itself while it goes, in results/STUDY/progress.json, and whether that run is still there."""

import contextlib
import os
import shlex
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..common import holding
from ..common.errors import UserError
from ..common.files import read_json, write_json

FILE = "progress.json"
COMMAND = "VIEWBENCH_COMMAND"  # what `viewbench run` was asked, which calls snakemake, and in which folder
EVERY_S = 2.0  # between two writings where something happens
SILENT_S = 20.0  # and where nothing does
LATEST_S = 1e11  # a time that people can be told of: the year 5138
GONE_S = 120.0  # a run on another machine that has been silent for so long is gone


@dataclass(frozen=True)
class Job:
    """A job that runs or has failed."""

    rule: str
    wildcards: Mapping[str, str]
    since: float  # time it began, or failed; seconds since 1970
    words: str = ""  # last line of its log, of one that failed
    log: str = ""

    def of(self, cell: Mapping[str, str], study: Any) -> bool:
        """Whether the cell of the `study` needs this job."""
        given, entry = self.wildcards, study.selector(cell["selector"])
        choice = repr(entry.choice_part(float(cell["ratio"]))), str(entry.choice_seed(int(cell["seed"])))
        needed = {
            **dict.fromkeys(("describe", "render", "rendered", "train", "evaluate"), True),
            "select": (given.get("part"), given.get("seed")) == choice,
            "features": study.gives_features(entry),
            "warm_selector": given.get("plugin") == entry.selector,
            "warm": given.get("trainer") == study.backend(cell["backend"]).file_name,
        }
        # The seed of a choice is not that of the cell.
        axes = ("scene", "selector") if self.rule == "select" else tuple(cell)
        return needed.get(self.rule, False) and all(given[axis] == cell[axis] for axis in axes if axis in given)


@dataclass(frozen=True)
class Run:
    """What a run said last."""

    pid: int
    host: str
    began: float  # seconds since 1970
    said: float
    ended: str  # "" while it goes; "finished", "failed", "stopped"
    seconds_left: float | None
    doing: str
    running: tuple[Job, ...]
    failed: tuple[Job, ...]
    command: str = ""  # what was typed
    folder: str = ""  # and where
    scheduler: str = ""  # that its jobs are handed to, where they wait in a queue; "" on one machine
    boot: str = ""
    started: str = ""

    @property
    def alive(self) -> bool:
        """Whether it goes on: by its process where that is on this machine, else by when it was heard of last."""
        if self.ended:
            return False
        here = holding.machine()
        if self.started and (self.host, self.boot) == (here["host"], here["boot"]):
            return holding.began(self.pid) == self.started
        return time.time() - self.said < GONE_S


class RunFile:
    """Writes the file of one run, whole each time, and not more often than anybody reads it."""

    def __init__(self, folder: Path, scheduler: str = ""):
        command, _, place = os.environ.get(COMMAND, shlex.join(["snakemake", *sys.argv[1:]])).partition("\n")
        self.file, self.wrote = folder / FILE, 0.0
        self.failed: dict[str, Job] = {}  # by what the jobs were to make
        self.ended = ""
        self.about = {
            "schema": 1,
            "pid": os.getpid(),
            **holding.machine(),
            "started": holding.began(os.getpid()),
            "command": command,
            "folder": place or str(Path.cwd()),
            "scheduler": scheduler,
            "began": time.time(),
        }

    def write(self, pace: Any, seconds_left: float | None, doing: str, at_once: bool = False) -> None:
        """Writes what is so now. A disk that does not take it costs the run nothing."""
        now, clock = time.time(), pace.clock()
        if not at_once and now - self.wrote < SILENT_S:
            return
        jobs = [] if self.ended else list(pace.running.values())
        record = {
            **self.about,
            "said": now,
            "ended": self.ended,
            "seconds_left": seconds_left,
            "doing": doing,
            "running": [asdict(Job(job.rule, dict(job.wildcards), now - (clock - job.began))) for job in jobs],
            "failed": [asdict(job) for job in self.failed.values()],
        }
        self.wrote = now
        with contextlib.suppress(OSError):
            write_json(self.file, record)


def read(folder: Path) -> Run | None:
    """What the last run of the study in results/STUDY said; None where there was none that can be read."""
    try:
        record = read_json(folder / FILE, "record of a run")
        jobs = {
            key: tuple(
                Job(
                    str(job["rule"]),
                    {str(name): str(value) for name, value in job["wildcards"].items()},
                    _seconds(job["since"]),
                    str(job.get("words", "")),
                    str(job.get("log", "")),
                )
                for job in record[key]
            )
            for key in ("running", "failed")
        }
        left = record["seconds_left"]
        return Run(
            pid=int(record["pid"]),
            host=str(record["host"]),
            began=_seconds(record["began"]),
            said=_seconds(record["said"]),
            ended=str(record["ended"]),
            seconds_left=None if left is None else _seconds(left),
            doing=str(record["doing"]),
            command=str(record.get("command", "")),
            folder=str(record.get("folder", "")),
            scheduler=str(record.get("scheduler", "")),
            boot=str(record["boot"]),
            started=str(record["started"]),
            **jobs,
        )
    except (UserError, ArithmeticError, AttributeError, KeyError, TypeError, ValueError):
        return None


def _seconds(value: Any) -> float:
    """A time, or a span of it. Raises ValueError for what is none."""
    if not abs(float(value)) <= LATEST_S:
        raise ValueError("no time")
    return float(value)
