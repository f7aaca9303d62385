"""How much memory and time a job asks of a scheduler such as Slurm: by its pictures, and twice as much after a failure.

Runs on one machine do not look at these numbers. They are generous: what a job is given and does not use is lost for
an hour, what it lacks kills it. What Slurm counted is beside them in workflow/profiles/slurm/README.md.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ._study import REFERENCE, BackendEntry

MB = 1 << 20
OURS = "splat"  # the backend whose needs are known
GAUSSIANS = 28_000  # that it has where a study names no number
LARGE_ENCODERS = ("open_clip",)
DAY = 24 * 60  # minutes


@dataclass(frozen=True)
class Size:
    """What a scene's jobs depend on."""

    views: int  # for training
    tests: int
    width: int  # pixels of the pictures as they are
    height: int


def doubled(value: float, attempt: int) -> int:
    """Of a first attempt, for a later one."""
    return math.ceil(value) << (attempt - 1)


def shown(size: Size, entry: BackendEntry) -> tuple[int, int]:
    """Width and height in pixels of what is trained on."""
    width = entry.width or size.width
    return width, max(1, round(size.height * width / size.width))


def train_mb(size: Size, entry: BackendEntry, ratio: float, gpu: bool) -> float:
    """Megabytes of a training."""
    width, height = shown(size, entry)
    views = max(1, math.ceil(ratio * size.views))
    read = 64 * size.width * size.height / MB  # a picture in full, in some stages of its making
    if entry.backend == OURS:
        # backends/_pictures.py and backends/splat/stages.py bound what is kept of the pictures.
        kept = min(3 * views * width * height / MB, 512) + min(12 * views * width * height / MB, 640)
        return 700 + read + kept + 5e3 * gaussians(entry) / MB
    return (8000 if gpu else 4000) + read + 12 * views * width * height / MB


def evaluate_mb(size: Size, entry: BackendEntry, gpu: bool) -> float:
    """Megabytes of a scoring; LPIPS, where its weights are there, comes in torch."""
    width, height = shown(size, entry)
    start = 2000 if entry.backend == OURS else 8000 if gpu else 4000
    return start + 64 * size.width * size.height / MB + 256 * width * height / MB + 2e3 * gaussians(entry) / MB


def train_minutes(size: Size, entry: BackendEntry, gpu: bool, timeout_s: float = 0) -> float:
    """Minutes of a training, its start and the slowest of usual processors included."""
    width, height = shown(size, entry)
    if entry.seconds is not None:
        return 5 + 1.5 * entry.seconds / 60
    if timeout_s:
        return 5 + timeout_s / 60
    if entry.backend == OURS:
        step_s = 5e-3 + 3e-7 * width * height + 1e-6 * gaussians(entry)  # backends/splat/README.md
        return 5 + 3 * step_s * (entry.iterations or 0) / 60
    return 5 + 4e-3 * (entry.iterations or 30_000) if gpu else 4 * 60


def evaluate_minutes(size: Size, entry: BackendEntry) -> float:
    """Minutes of a scoring."""
    width, height = shown(size, entry)
    return (3 if entry.backend == OURS else 15) + size.tests * (0.2 + 1e-5 * width * height) / 60


def gaussians(entry: BackendEntry) -> int:
    """The most that a model has."""
    return int(entry.options.get("gaussians", GAUSSIANS))


class Needs:
    """Resource functions of the rules that depend on a scene: `rule_mb` in megabytes, `rule_minutes`.

    `size` gives the size of a scene by its name, or None where it is not to be looked up: in a process that a scheduler
    runs, which has what it asked for.
    """

    def __init__(self, study: Any, settings: Any, size: Callable[[str], Size | None], gpu: Callable[[str], int]):
        self.study, self.settings, self._size, self._gpu = study, settings, size, gpu

    def _asked(self, wildcards: Any, attempt: int, needed: Callable[[Size], float]) -> int:
        """What is needed for a scene of this size, and more after a failure."""
        size = self._size(wildcards.scene)
        return doubled(needed(size), attempt) if size else 1

    def _trainer(self, wildcards: Any) -> tuple[BackendEntry, bool]:
        """The cell's entry of the study, and whether its trainer runs on a GPU."""
        entry = self.study.backend(wildcards.backend)
        return entry, bool(self._gpu(entry.backend))

    def train_mb(self, wildcards: Any, attempt: int) -> int:
        entry, gpu = self._trainer(wildcards)
        ratio = 1.0 if wildcards.selector == REFERENCE else float(wildcards.ratio)
        return self._asked(wildcards, attempt, lambda size: train_mb(size, entry, ratio, gpu))

    def train_minutes(self, wildcards: Any, attempt: int) -> int:
        entry, gpu = self._trainer(wildcards)
        command = self.settings.command.get(entry.backend.removeprefix("command:"))
        timeout = command.timeout if command and entry.backend.startswith("command:") else 0
        return self._asked(wildcards, attempt, lambda size: train_minutes(size, entry, gpu, timeout))

    def evaluate_mb(self, wildcards: Any, attempt: int) -> int:
        entry, gpu = self._trainer(wildcards)
        return self._asked(wildcards, attempt, lambda size: evaluate_mb(size, entry, gpu))

    def evaluate_minutes(self, wildcards: Any, attempt: int) -> int:
        entry, _ = self._trainer(wildcards)
        return self._asked(wildcards, attempt, lambda size: evaluate_minutes(size, entry))

    def select_mb(self, wildcards: Any, attempt: int) -> int:
        return self._asked(wildcards, attempt, lambda size: 1000 + 24e3 * size.views / MB)

    def select_minutes(self, wildcards: Any, attempt: int) -> int:
        return self._asked(wildcards, attempt, lambda size: min(5 + (size.views / 10_000) ** 2, DAY))

    @property
    def _large_encoder(self) -> bool:
        return self.study.encoder.partition(":")[0] in LARGE_ENCODERS

    def features_mb(self, wildcards: Any, attempt: int) -> int:
        least, batch = 8000 if self._large_encoder else 2000, self.settings.features.batch
        return self._asked(wildcards, attempt, lambda size: least + 64 * size.width * size.height * batch / MB)

    def features_minutes(self, wildcards: Any, attempt: int) -> int:
        a_picture_s = 5 if self._large_encoder else 1
        return self._asked(wildcards, attempt, lambda size: 10 + a_picture_s * size.views / 60)

    def describe_mb(self, wildcards: Any, attempt: int) -> int:
        return self._asked(wildcards, attempt, lambda size: 1500 + 24e3 * size.views / MB)

    @staticmethod
    def fixed(value: int) -> Callable[..., int]:
        """A resource of a job that depends on no scene: so much, and more when it failed."""

        def of_attempt(wildcards: Any, attempt: int) -> int:
            return doubled(value, attempt)

        return of_attempt
