"""Before a run: removes what a study cannot go on from, so that the jobs that made it are run again."""

import contextlib
from pathlib import Path

from ..backends._evaluate import altered_file
from ..common.cells import cell_folder
from ..common.errors import UserError
from ..common.files import read_json, unsealed
from ..common.holding import sweep
from ..reports._tracking import NO_TRACKING
from ._study import Study


def heal(study: Study, results: Path) -> None:
    """Removes selections, records and stamps that are damaged; `results` is results/STUDY.

    Choices, records and scores that were edited or cut short go, and the record of a model that has no score and whose
    files are not as training left them (evaluating it has failed, and would again), and the stamps of logging that
    failed. Models with a score are not read: that may be gigabytes.
    """
    broken = [path for path in (results / "selections").rglob("*.json") if not _sound(path)]
    sweep(results)
    for cell in study.cells():
        folder = cell_folder(results, cell)
        files = [folder / f"{name}.json" for name in ("selection", "train", "metrics")]
        broken += [path for path in files if path.is_file() and not _sound(path)]
        if files[1].is_file() and not files[2].is_file() and not _whole_model(folder):
            broken.append(files[1])
    broken += [path for path in _stamps(results) if _failed(path)]
    for path in broken:
        path.unlink(missing_ok=True)


def _sound(path: Path) -> bool:
    try:
        unsealed(read_json(path), path.name)
    except (UserError, AttributeError):
        return False
    return True


def _whole_model(folder: Path) -> bool:
    """Whether all files of the model are there and as `train.json` says."""
    with contextlib.suppress(UserError, AttributeError, KeyError, TypeError, OSError):
        return altered_file(folder, read_json(folder / "train.json")) is None
    return False


def _stamps(results: Path) -> list[Path]:
    return [results / "tracked.json", *(results / "tracked").rglob("*.json")]


def _failed(stamp: Path) -> bool:
    """Whether logging to MLflow did not work then."""
    with contextlib.suppress(UserError, AttributeError):
        return stamp.is_file() and read_json(stamp).get("skipped") not in (None, NO_TRACKING)
    return False
