"""One study's experiment in MLflow, which any number of processes write to at once, be they killed or not heard.

A run has a kind and a key (`_tracked_run.py`), and there is one finished run of each in the end. Who ends a run looks
for others of its key, and all writers keep the same one. Requests whose answer was lost, and which MLflow's client
therefore repeats, leave runs that nobody knows: they carry the mark of their writer, who removes them. What a killed
writer leaves is removed by whoever begins next.
"""

import contextlib
import hashlib
import shutil
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..common.errors import UserError
from ..common.settings import Tracking
from . import _tracked_run, _tracking_errors
from ._tracked_run import BEGUN, FINGERPRINT, KIND, KINDS, PARENT, POINT, WRITER, Content, Number
from ._tracking_errors import Kind

DEAD_S = 600.0  # after which a run that nobody has ended was left by a writer that is dead, wherever it was
TRIES = 10  # of a run that others took for one that a crash had left

Key = tuple[str, str]  # kind, and what is unique among its runs


def is_remote(uri: str) -> bool:
    """Whether runs are logged to a server rather than into a file beside the results."""
    return uri.startswith(("http://", "https://"))


@dataclass(frozen=True)
class Run:
    """What the log knows of a run."""

    id: str
    finished: bool
    fingerprint: str
    writer: str
    started: int  # milliseconds since 1970
    begun_s: float = 0.0  # since 1970, by the clock of its writer
    parent: str = ""
    points: Mapping[str, str] = field(default_factory=dict)  # of a summary: digests by ratio

    def differs(self, told: Mapping[str, str], whole: bool) -> bool:
        """Whether a summary has other points than these; without `whole` only those of the same ratios count."""
        known = self.points.items()
        return any(told.get(ratio) != point for ratio, point in known if whole or ratio in told)


class _GoneError(Exception):
    """Another writer took this run for one that a crash had left."""


class Log:
    """The experiment of one study. What MLflow raises passes through (`_tracking_errors.errors`)."""

    def __init__(self, client: Any, uri: str, study: str, tracking: Tracking, place: str = ""):
        self.client, self.uri, self.study, self.tracking = client, uri, study, tracking
        # A file of this machine has one writer at a time (`holding.alone`), and loses no answers.
        self.shared = is_remote(uri) or not uri.startswith("sqlite:")
        self.experiment, self.place, self.writer = "", place, f"{place}-{uuid.uuid4().hex}"
        self.tags: dict[str, str] = {}  # of the experiment
        self.created_ms = 0  # since 1970
        self.runs: dict[Key, list[Run]] = {}  # the finished ones, as far as this process knows

    def answers(self) -> None:
        """Raises what MLflow does when the store is away."""
        self.client.get_experiment_by_name(self.study)

    def start(self) -> None:
        """Learns of the runs that are there; those that crashes have left are removed: at once those of writers of the
        same results, which are dead, and after a while those of others, which may live."""
        self._find_experiment()
        runs = self._search("")
        self._delete(run for found in runs.values() for run in found if not run.finished and self._is_dead(run))
        self.runs = {key: [run for run in found if run.finished] for key, found in runs.items()}

    def _is_dead(self, run: Run) -> bool:
        ours = bool(self.place) and run.writer.startswith(self.place)
        return ours or not self.shared or time.time() - run.begun_s > DEAD_S

    def describe(self, tags: Mapping[str, str]) -> None:
        """Sets tags of the experiment, those that it does not have yet."""
        from mlflow.exceptions import MlflowException

        for key, value in tags.items():
            if self.tags.get(key) == value:
                continue
            try:
                self.client.set_experiment_tag(self.experiment, key, value)
            except MlflowException as error:  # two who set a tag that is not there do not both succeed
                if _tracking_errors.kind(error) is not Kind.CELL:
                    raise
                self.client.set_experiment_tag(self.experiment, key, value)
            self.tags[key] = value

    def put(self, key: Key, fingerprint: Callable[[], str], told: Callable[[], Content]) -> bool:
        """Makes the key have one finished run, that of the fingerprint; whether it had none before.

        Both are asked again where what they are made from has changed meanwhile.
        """
        known, new = self.runs.get(key, []), False
        for _ in range(TRIES):
            now = fingerprint()
            if self.shared and not any(run.fingerprint == now for run in known):
                known = self._finished(key)  # others may have been here since
            if not any(run.fingerprint == now for run in known):
                try:
                    made = self._write(told(), {FINGERPRINT: now, WRITER: self.writer, BEGUN: str(int(time.time()))})
                except _GoneError:
                    continue
                new, known = True, self._finished(key) if self.shared else [*known, made]
            current = [run for run in known if run.fingerprint == now]
            if not current or fingerprint() != now:
                continue  # it was made anew meanwhile, or somebody removed the run just made
            keep = min(current, key=lambda run: (run.started, run.id))
            self._delete(run for run in known if run is not keep)
            self.runs[key] = [keep]
            return new
        raise UserError(f"other writers removed the run of {key[1]} {TRIES} times")

    def known(self, key: Key) -> Run | None:
        """The finished run of the key, as far as this process knows."""
        return next(iter(self.runs.get(key, [])), None)

    def add(self, key: Key, points: Mapping[str, Sequence[Number]], ended_ms: int, whole: bool) -> bool:
        """Adds the points, by ratio, that the summary does not have; False, and it is no longer known, where it has
        others for these ratios, or with `whole` for any other, with which it is removed, or where it is gone.

        Repeating it does no harm: MLflow has each number of a metric, step and time once.
        """
        from mlflow.entities import Metric, RunTag

        run = self.known(key)
        told = {ratio: _digest(numbers) for ratio, numbers in points.items()}
        if run and not run.differs(told, whole) and told.keys() <= run.points.keys():
            return True
        run = self._now(key)
        if run is None or run.differs(told, whole):
            return self._forget(key, told, whole)
        missing = [ratio for ratio in told if ratio not in run.points]
        if missing:
            numbers = dict.fromkeys(number for ratio in missing for number in points[ratio])
            tags = [RunTag(f"{POINT}{ratio}", told[ratio]) for ratio in missing]
            with self._unless_gone(run.id) as gone:
                self.client.log_batch(run.id, metrics=[Metric(*number) for number in numbers], tags=tags)
                self.client.set_terminated(run.id, "FINISHED", end_time=ended_ms)
            self.runs[key] = [replace(run, points={**run.points, **told})]
            run = self._now(key)  # another may have added the same ratio with other numbers
            if gone or run is None or run.differs(told, whole):
                return self._forget(key, told, whole)
        return True

    def _now(self, key: Key) -> Run | None:
        """The run of the key as it is; None where it is gone."""
        run = self.known(key)
        if run is None or not self.shared:
            return run
        found = self.client.get_run(run.id)
        return _run(found) if found.info.lifecycle_stage == "active" else None

    def _forget(self, key: Key, told: Mapping[str, str], whole: bool) -> bool:
        """Removes the summary where it differs: another may have made it anew, and that one is right. False."""
        self._delete(found for found in self._finished(key) if found.differs(told, whole))
        self.runs.pop(key, None)
        return False

    def remove(self, key: Key) -> None:
        """Removes all finished runs of the key."""
        self._delete(self._finished(key))
        self.runs.pop(key, None)

    def adopt(self, key: Key, parent: str) -> None:
        """Makes the run of the key a child of another."""
        run = self.known(key)
        if run and run.parent != parent:
            with self._unless_gone(run.id):  # who made it anew has named its parent
                self.client.set_tag(run.id, PARENT, parent)
            self.runs[key] = [replace(run, parent=parent)]

    def _write(self, told: Content, tags: dict[str, str]) -> Run:
        made: list[str] = []
        with self._unless_gone(made) as gone:
            _tracked_run.write(self.client, self.experiment, told, tags, made.append)
        if gone:
            raise _GoneError
        parent = told.also.get(PARENT, "")
        return Run(made[0], True, tags[FINGERPRINT], self.writer, told.started_ms, time.time(), parent)

    @contextlib.contextmanager
    def _unless_gone(self, run: str | list[str]) -> Iterator[list[str]]:
        """Errors of the body are forgiven where another writer has removed the run; its id is then in what is yielded.

        `run` is an id, or a list that will have it.
        """
        gone: list[str] = []
        try:
            yield gone
        except _tracking_errors.errors() as error:
            ids = [run] if isinstance(run, str) else run
            away = _tracking_errors.kind(error) is not Kind.CELL
            if away or not ids or self.client.get_run(ids[0]).info.lifecycle_stage == "active":
                raise
            gone += ids

    def _find_experiment(self) -> None:
        """Finds the experiment, or makes it; others may be making it too, or restoring it."""
        from mlflow.exceptions import MlflowException

        for last in (False, False, True):
            found = self.client.get_experiment_by_name(self.study)
            try:
                if found is None:
                    made = self.client.create_experiment(self.study, artifact_location=self._artifacts())
                    found = self.client.get_experiment(made)
                if found.lifecycle_stage == "deleted":
                    self.client.restore_experiment(found.experiment_id)
                self.experiment, self.tags = found.experiment_id, dict(found.tags)
                self.created_ms = found.creation_time or 0
                return
            except MlflowException:  # "already exists", also where only the answer to making it was lost
                if last:
                    raise

    def _artifacts(self) -> str | None:
        return None if is_remote(self.uri) else (Path(self.tracking.artifacts).resolve() / self.study).as_uri()

    def _search(self, asked: str) -> dict[Key, list[Run]]:
        """Runs by key, unfinished ones too; those that viewbench has not made are none."""
        known: dict[Key, list[Run]] = {}
        token = None
        while True:
            page = self.client.search_runs([self.experiment], filter_string=asked, max_results=1000, page_token=token)
            for run in page:
                key = _key(run.data.tags)
                if key:
                    known.setdefault(key, []).append(_run(run))
            token = page.token
            if not token:
                return known

    def _finished(self, key: Key) -> list[Run]:
        """The finished runs of a key; what this writer left of it unfinished is removed."""
        runs = self._search(f"tags.`{KINDS[key[0]]}` = '{key[1]}'").get(key, [])
        self._delete(run for run in runs if run.writer == self.writer and not run.finished)
        return [run for run in runs if run.finished]

    def _delete(self, runs: Iterable[Run]) -> None:
        """MLflow keeps what is deleted; its files are removed where they lie beside the results."""
        for run in list(runs):
            self.client.delete_run(run.id)
            if not is_remote(self.uri) and run.id.isalnum():
                shutil.rmtree(Path(self.tracking.artifacts).resolve() / self.study / run.id, ignore_errors=True)


def _key(tags: Mapping[str, str]) -> Key | None:
    """Kind and key of a run; runs of earlier versions are all of cells, and do not say so."""
    for kind, tag in KINDS.items():
        if tag in tags and tags.get(KIND, kind) == kind:
            return kind, tags[tag]
    return None


def _digest(numbers: Sequence[Number]) -> str:
    """Tells a point from another one of the same ratio."""
    return hashlib.sha256(repr(sorted(numbers)).encode()).hexdigest()[:12]


def _run(found: Any) -> Run:
    tags, info = found.data.tags, found.info
    begun = tags.get(BEGUN, "")
    return Run(
        id=info.run_id,
        finished=info.status == "FINISHED",
        fingerprint=tags.get(FINGERPRINT, ""),
        writer=tags.get(WRITER, ""),
        started=info.start_time,
        begun_s=float(begun) if begun.isdigit() else 0.0,
        parent=tags.get(PARENT, ""),
        points={key.removeprefix(POINT): value for key, value in tags.items() if key.startswith(POINT)},
    )
