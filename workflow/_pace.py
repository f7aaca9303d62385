"""What a run has done and what is left of it, by rule: which jobs run now, in words, and how long the rest takes."""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

# What a job of a rule is called while it runs; of those that are many, which it is.
MANY = {"select": "choosing", "train": "training", "evaluate": "scoring", "report": "drawing"}
ONE = {
    "study": "checking the study",
    "describe": "describing {scene}",
    "features": "features of {scene}",
    "warm": "preparing the kernels",
    "warm_selector": "preparing {plugin}",
    "collect": "gathering the results",
    "track": "logging to MLflow",
    "page": "putting the page together",
    "publish": "putting the page into MLflow",
}
# Seconds that a job takes where none of its rule has ended yet; those of a cell are scaled by what cells took.
TYPICAL = {"warm": 20.0, "features": 10.0, "track": 4.0, "report": 2.0, "page": 2.0, "publish": 3.0}
OF_A_CELL = {"select": 0.5, "train": 5.0, "evaluate": 1.5}
OTHERWISE = 1.0


@dataclass
class Running:
    """A job that has begun."""

    rule: str
    wildcards: Mapping[str, str]
    began: float


@dataclass
class Pace:
    """Counts and times the jobs of one run."""

    clock: Callable[[], float] = time.monotonic
    planned: Counter = field(default_factory=Counter)
    finished: Counter = field(default_factory=Counter)
    failed: Counter = field(default_factory=Counter)
    running: dict[int, Running] = field(default_factory=dict)
    took: dict[str, float] = field(default_factory=lambda: defaultdict(float))  # seconds of finished jobs, by rule
    busy: float = 0.0  # seconds of jobs since the first training began, whatever has become of them
    looked: float | None = None  # when `busy` was added up last
    training_since: float | None = None

    def plan(self, stats: Mapping[str, Any]) -> None:
        """Takes the number of jobs by rule, beside which there may be other entries."""
        self.planned = Counter({rule: value for rule, value in stats.items() if isinstance(value, int)})

    def begin(self, job: int, rule: str, wildcards: Mapping[str, str]) -> None:
        self._add_up()
        if rule == "train" and self.training_since is None:
            self.training_since = self.looked = self.clock()
        self.running[job] = Running(rule, wildcards, self.clock())

    def end(self, job: int, failed: bool = False) -> str:
        """Notes the end of a job; returns its rule, "" where it is not known."""
        self._add_up()
        ended = self.running.pop(job, None)
        if ended is None:
            return ""
        (self.failed if failed else self.finished)[ended.rule] += 1
        if not failed:
            self.took[ended.rule] += self.clock() - ended.began
        return ended.rule

    def _add_up(self) -> None:
        now = self.clock()
        if self.looked is not None:
            self.busy += len(self.running) * (now - self.looked)
            self.looked = now

    def left(self, rule: str) -> int:
        """Jobs of the rule that have not ended; a model that failed has no score to wait for."""
        lost = self.failed["train"] if rule == "evaluate" else 0
        return max(0, self.planned[rule] - self.finished[rule] - self.failed[rule] - lost)

    def seconds_of(self, rule: str) -> float:
        """What a job of the rule takes, as far as one can say now."""
        if self.finished[rule]:
            return self.took[rule] / self.finished[rule]
        if rule not in OF_A_CELL:
            return TYPICAL.get(rule, OTHERWISE)
        typical = sum(OF_A_CELL[step] * self.finished[step] for step in OF_A_CELL)
        measured = sum(self.took[step] for step in OF_A_CELL)
        return OF_A_CELL[rule] * (measured / typical if typical else 1.0)

    @property
    def seconds_left(self) -> float | None:
        """The work that is left at the pace since the first training began; None before one has ended."""
        if self.training_since is None or not self.finished["train"]:
            return None
        self._add_up()
        elapsed = self.clock() - self.training_since
        lanes = self.busy / elapsed if elapsed > 0 and self.busy > 0 else 1.0
        work = sum(self.left(rule) * self.seconds_of(rule) for rule in self.planned if rule != "total")
        for job in self.running.values():
            work -= min(self.clock() - job.began, self.seconds_of(job.rule))
        return max(0.0, work) / lanes

    def doing(self) -> str:
        """The jobs that run now, in words; "" when none does."""
        words: dict[str, None] = {}  # a set that keeps its order
        for rule, count in Counter(job.rule for job in self.running.values()).items():
            if rule in MANY:
                ended = self.finished[rule] + self.failed[rule]
                words[f"{MANY[rule]}: {ended + count} of {max(self.planned[rule], ended + count)}"] = None
        for job in self.running.values():
            if job.rule not in MANY:
                words[ONE.get(job.rule, job.rule).format_map(_Known(job.wildcards))] = None
        return ", ".join(words)


class _Known(dict):
    """Wildcards; those that a job does not have are left out of its words."""

    def __missing__(self, key: str) -> str:
        return "…"


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours and minutes of what takes long."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d} h" if minutes >= 100 else f"{minutes}:{rest:02d} min"
