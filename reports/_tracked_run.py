"""What MLflow is told in one run, and the requests that tell it."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KIND = "viewbench.kind"  # one of the three below
CELL, SUMMARY, REPORT = "viewbench.cell", "viewbench.summary", "viewbench.report"  # tags with a name, by kind
KINDS = {"cell": CELL, "summary": SUMMARY, "report": REPORT}
FINGERPRINT, WRITER, BEGUN = "viewbench.fingerprint", "viewbench.writer", "viewbench.begun"
SHARE = "ratio_percent"  # metric of the share of views: 0.5 % has no step of its own
POINT = "viewbench.point."  # and a ratio: what tells the point of a summary from another one
# MLflow's own tags (mlflow/utils/mlflow_tags.py, and constants.ts of its page for the colour).
PARENT, COLOUR, USER = "mlflow.parentRunId", "mlflow.runColor", "mlflow.user"
SOURCE, SOURCE_TYPE, COMMIT, DIRTY = (
    "mlflow.source.name",
    "mlflow.source.type",
    "mlflow.source.git.commit",
    "mlflow.source.git.dirty",
)
LONGEST = 6000  # letters of a parameter that MLflow takes
LONGEST_DIGEST = 16  # letters of a data set's digest that people compare

Number = tuple[str, float, int, int]  # name, value, time stamp in milliseconds since 1970, step


@dataclass(frozen=True)
class DataSet:
    """A scene as MLflow lists it beside a run; `digest` begins the scene's hash."""

    name: str
    digest: str
    place: str
    profile: dict[str, Any]  # numbers by what they count


@dataclass(frozen=True)
class Content:
    """A run as it is logged; `files` are pairs of a path and a folder among the artifacts, None for the first one.

    Those of `linked` are as good as immutable: where artifacts lie on the same file system they take no room.
    """

    kind: str
    key: str  # what is unique among the runs of its kind
    name: str
    tags: dict[str, str]
    params: dict[str, str]
    metrics: Sequence[Number]
    started_ms: int
    ended_ms: int
    files: Sequence[tuple[Path, str | None]] = ()
    linked: Sequence[tuple[Path, str | None]] = ()
    data: DataSet | None = None
    also: dict[str, str] = field(default_factory=dict)  # tags that are set with the rest, and are no part of the hash

    def fingerprint(self, *more: object) -> str:
        """Hash of what makes two runs differ for whoever looks at them, but for numbers and files: see `more`."""
        told = [self.kind, self.key, self.name, sorted(self.tags.items()), sorted(self.params.items()), *more]
        return hashlib.sha256(json.dumps(told, default=str).encode()).hexdigest()


def params(values: dict[str, Any]) -> dict[str, str]:
    """Values as MLflow takes them; those that are None are left out."""
    return {key: str(value)[:LONGEST] for key, value in values.items() if value is not None}


def write(client: Any, experiment: str, told: Content, tags: dict[str, str], made: Callable[[str], None]) -> str:
    """Logs a run with `tags` besides its own, calls `made` with its id as soon as it has one, and ends it.

    The run is finished when all of it is there, and not before. As few requests as MLflow's limits allow: one to begin
    it, one for up to 1000 numbers, one for its data set, one a file, one to end it.
    """
    from mlflow.entities import Metric, Param
    from mlflow.exceptions import MlflowException
    from mlflow.store.artifact.artifact_repository_registry import get_artifact_repository

    own = {KIND: told.kind, KINDS[told.kind]: told.key, **told.tags, **told.also}
    begun = client.create_run(experiment, start_time=told.started_ms, tags=own | tags, run_name=told.name)
    run = begun.info
    made(run.run_id)
    if told.metrics or told.params:
        # The client itself cuts this into requests of at most 1000 metrics and 100 parameters.
        client.log_batch(
            run.run_id,
            metrics=[Metric(*metric) for metric in told.metrics],
            params=[Param(key, value) for key, value in told.params.items()],
        )
    if told.data:
        datasets = [_input(told.data)]
        try:
            client.log_inputs(run.run_id, datasets=datasets)
        except MlflowException:  # of two who bring one that is not there only one succeeds
            client.log_inputs(run.run_id, datasets=datasets)
    # What client.log_artifact does, without asking for the run again to learn where its artifacts go.
    store = get_artifact_repository(run.artifact_uri, tracking_uri=client.tracking_uri)
    for path, where in told.files:
        store.log_artifact(os.fspath(path), where)
    for path, where in told.linked:
        if not _link(store, path, where):
            store.log_artifact(os.fspath(path), where)
    client.set_terminated(run.run_id, "FINISHED", end_time=told.ended_ms)
    return run.run_id


def _link(store: Any, path: Path, where: str | None) -> bool:
    """Whether the file is among the artifacts as a second name of itself, which takes no room."""
    folder = getattr(store, "artifact_dir", None)  # of a LocalArtifactRepository
    if folder is None:
        return False
    try:
        target = Path(folder) / (where or "")
        target.mkdir(parents=True, exist_ok=True)
        (target / path.name).hardlink_to(path)
    except OSError:
        return False
    return True


def _input(data: DataSet) -> Any:
    from mlflow.entities import Dataset, DatasetInput, InputTag

    given = Dataset(
        name=data.name,
        digest=data.digest,
        source_type="local",
        source=json.dumps({"uri": data.place}),
        profile=json.dumps(data.profile),
    )
    return DatasetInput(given, [InputTag("mlflow.data.context", "train")])
