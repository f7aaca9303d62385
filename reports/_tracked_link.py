"""Where a study is to be seen in MLflow, as its page, the end of a run and `viewbench dashboard` say."""

import contextlib
from pathlib import Path

from ..common.errors import UserError
from ..common.files import read_json
from . import _tracked_view
from ._tracking_errors import masked
from ._tracking_log import is_remote

PORT = 5000
HERE = f"http://127.0.0.1:{PORT}"


def address(uri: str, experiment: str, here: str = HERE) -> str:
    """Of Figure 4 of an experiment in the store `uri`; `here` is where `viewbench dashboard` serves a database."""
    return _tracked_view.link(masked(uri).replace("***@", "") if is_remote(uri) else here, experiment)


def figures(results: Path, uri: str, here: str = HERE) -> dict[str, str]:
    """Addresses of Figure 4 of all studies in a folder of results that have been logged, by name."""
    found = {folder.name: _experiment(folder) for folder in sorted(results.glob("*")) if folder.is_dir()}
    return {name: address(uri, experiment, here) for name, experiment in found.items() if experiment}


def _experiment(results: Path) -> str:
    """The id of a study's experiment, as the last that logged it has said."""
    for name in ("tracked.json", "tracked.partial.json"):
        with contextlib.suppress(UserError, AttributeError):
            found = read_json(results / name).get("experiment") if (results / name).is_file() else None
            if isinstance(found, str) and found.isdigit():
                return found
    return ""
