"""Where a study is to be seen in MLflow, as its page, the end of a run and `viewbench dashboard` say."""

import contextlib
import sqlite3
from pathlib import Path

from ..common.errors import UserError
from ..common.files import read_json
from . import _tracked_view, _tracking_sqlite
from ._tracking_errors import masked
from ._tracking_log import is_remote
from ._tracking_stamp import FOLLOWED, STAMPS, newest_first

PORT = 5000
HERE = f"http://127.0.0.1:{PORT}"


def address(uri: str, experiment: str, here: str = HERE) -> str:
    """Of Figure 4 of an experiment in the store `uri`; `here` is where `viewbench dashboard` serves a database."""
    return _tracked_view.link(masked(uri).replace("***@", "") if is_remote(uri) else here, experiment)


def store(uri: str) -> str:
    """What stamps say of the store that an experiment is in; without a password."""
    return masked(uri, uri)


def figures(results: Path, uri: str, here: str = HERE) -> dict[str, str]:
    """Addresses of Figure 4 of all studies that have been logged to `uri`, by the name of their experiment.

    A database that is a file is asked itself; of a server it is known what the studies in `results` have said.
    """
    path = _tracking_sqlite.path_of(uri)
    if path is not None:
        found = _in_database(path)
    else:
        found = {folder.name: _experiment(folder, uri) for folder in sorted(results.glob("*")) if folder.is_dir()}
    return {name: address(uri, experiment, here) for name, experiment in found.items() if experiment}


def _in_database(path: Path) -> dict[str, str]:
    """Ids of the experiments that have the view of Figure 4, by name, the one changed last at the end."""
    if not path.is_file():
        return {}
    asked = (
        "SELECT e.name, e.experiment_id FROM experiments e JOIN experiment_tags t ON t.experiment_id = e.experiment_id "
        "WHERE t.key = ? AND e.lifecycle_stage = 'active' ORDER BY e.last_update_time"
    )
    where = f"{path.as_uri()}?mode=ro"
    with (
        contextlib.suppress(sqlite3.Error),
        contextlib.closing(sqlite3.connect(where, uri=True, timeout=5)) as database,
    ):
        key = _tracked_view.PREFIX + _tracked_view.KEY
        return {str(name): str(experiment) for name, experiment in database.execute(asked, (key,))}
    return {}


def _experiment(results: Path, uri: str) -> str:
    """The id of a study's experiment, as the last that logged it to this store has said; empty where none has."""
    for path in newest_first(results, *STAMPS, FOLLOWED):
        with contextlib.suppress(UserError, AttributeError):
            told = read_json(path)
            found = told.get("experiment")
            if isinstance(found, str) and found.isdigit() and told.get("store") == store(uri):
                return found
    return ""
