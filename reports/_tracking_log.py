"""One study's experiment in MLflow, which any number of processes write to at once, be they killed or not heard.

Who ends a run looks for others of its cell, and all writers keep the same one. Requests whose answer was lost, and
which MLflow's client therefore repeats, leave runs that nobody knows: they carry the mark of their writer, who removes
them. What a killed writer leaves is removed by whoever begins next.
"""

import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..common.cells import cell_name
from ..common.errors import UserError
from ..common.settings import Tracking
from . import _tracked_run, _tracking_errors
from ._tracked_run import CELL, FINGERPRINT, WRITER
from ._tracking_errors import Kind

TRIES = 10  # of a cell, whose run others took for one that a crash had left


def is_remote(uri: str) -> bool:
    """Whether runs are logged to a server, cell by cell, rather than into a file beside the results."""
    return uri.startswith(("http://", "https://"))


@dataclass(frozen=True)
class Run:
    """What the log knows of a run."""

    id: str
    finished: bool
    fingerprint: str
    writer: str
    started: int  # milliseconds since 1970, by the clock of its writer


class _GoneError(Exception):
    """Another writer took this run for one that a crash had left."""


class Log:
    """The experiment of one study. What MLflow raises passes through (`_tracking_errors.errors`)."""

    def __init__(self, client: Any, uri: str, study: str, tracking: Tracking):
        self.client, self.uri, self.study, self.tracking = client, uri, study, tracking
        self.experiment, self.writer = "", uuid.uuid4().hex

    def answers(self) -> None:
        """Raises what MLflow does when the store is away."""
        self.client.get_experiment_by_name(self.study)

    def start(self, name: str | None = None) -> dict[str, list[Run]]:
        """The finished runs by cell, of cell `name` alone where it is given; those that crashes have left are removed.

        A live writer's run may be among these: it finds out, and begins another one.
        """
        self.experiment = self._experiment()
        runs = self._runs(name)
        self._delete(run for found in runs.values() for run in found if not run.finished)
        return {name: [run for run in found if run.finished] for name, found in runs.items()}

    def cell(self, cell: dict[str, str], folder: Path, known: list[Run], fresh: bool = False) -> bool:
        """Makes the cell have one finished run, that of its files; whether it had none before.

        `known` are its finished runs as `start` returned them, `fresh` where that was a moment ago.
        """
        name, new = cell_name(cell), False
        for attempt in range(TRIES):
            now = _fingerprint(folder, name)
            if not (fresh and not attempt) and not any(run.fingerprint == now for run in known):
                known = self._finished(name)  # others may have been here since
            if not any(run.fingerprint == now for run in known):
                told = _content(cell, folder, self.tracking.renders)
                try:
                    self._write(told, {FINGERPRINT: now, WRITER: self.writer})
                except _GoneError:
                    continue
                new, known = True, self._finished(name)
            current = [run for run in known if run.fingerprint == now]
            if not current or _fingerprint(folder, name) != now:
                continue  # the cell was made anew meanwhile, or somebody removed the run just made
            keep = min(current, key=lambda run: (run.started, run.id))
            self._delete(run for run in known if run is not keep)
            return new
        raise UserError(f"other writers removed the run of {name} {TRIES} times")

    def _write(self, told: _tracked_run.Content, tags: dict[str, str]) -> None:
        made = ""

        def note(run_id: str) -> None:
            nonlocal made
            made = run_id

        try:
            _tracked_run.write(self.client, self.experiment, told, tags, note)
        except _tracking_errors.errors() as error:
            away = _tracking_errors.kind(error) is not Kind.CELL
            if away or not made or self.client.get_run(made).info.lifecycle_stage == "active":
                raise
            raise _GoneError from None

    def _experiment(self) -> str:
        """The id of the experiment, made where there is none; others may be making it too, or restoring it."""
        from mlflow.exceptions import MlflowException

        for last in (False, False, True):
            found = self.client.get_experiment_by_name(self.study)
            try:
                if found is None:
                    return self.client.create_experiment(self.study, artifact_location=self._artifacts())
                if found.lifecycle_stage == "deleted":
                    self.client.restore_experiment(found.experiment_id)
                return found.experiment_id
            except MlflowException:  # "already exists", also where only the answer to making it was lost
                if last:
                    raise
        raise AssertionError

    def _artifacts(self) -> str | None:
        return None if is_remote(self.uri) else (Path(self.tracking.artifacts).resolve() / self.study).as_uri()

    def _runs(self, name: str | None = None) -> dict[str, list[Run]]:
        """All runs by cell; unfinished ones too."""
        known: dict[str, list[Run]] = {}
        asked = f"tags.`{CELL}` = '{name}'" if name else f"tags.`{CELL}` != ''"
        token = None
        while True:
            page = self.client.search_runs([self.experiment], filter_string=asked, max_results=1000, page_token=token)
            for run in page:
                tags, info = run.data.tags, run.info
                finished = info.status == "FINISHED"
                found = Run(info.run_id, finished, tags.get(FINGERPRINT, ""), tags.get(WRITER, ""), info.start_time)
                known.setdefault(tags[CELL], []).append(found)
            token = page.token
            if not token:
                return known

    def _finished(self, name: str) -> list[Run]:
        """The finished runs of a cell; what this writer left of it unfinished is removed."""
        runs = self._runs(name).get(name, [])
        self._delete(run for run in runs if run.writer == self.writer and not run.finished)
        return [run for run in runs if run.finished]

    def _delete(self, runs: Iterable[Run]) -> None:
        for run in list(runs):
            self.client.delete_run(run.id)


def _fingerprint(folder: Path, name: str) -> str:
    try:
        return _tracked_run.fingerprint(folder)
    except OSError as error:
        raise UserError(f"cell {name} cannot be read: {error.strerror}: {error.filename}") from None


def _content(cell: dict[str, str], folder: Path, renders: int) -> _tracked_run.Content:
    try:
        return _tracked_run.content(cell, folder, renders)
    except (KeyError, TypeError, AttributeError) as error:
        raise UserError(f"the files of cell {cell_name(cell)} are not as viewbench writes them ({error!r})") from None
