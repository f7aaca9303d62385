"""Puts a study's page into its experiment, with the verdict and a link to the page in what the experiment says."""

from pathlib import Path

from ..common.errors import UserError
from ..common.settings import Tracking
from . import _page, _study
from ._about import About
from ._tracked_cell import StudyCells
from ._tracked_study import Tracked
from ._tracking import RETRIES, explained, open_log

ALSO = ("results.csv",)  # beside the page


def publish(about: About, results: Path, tracking: Tracking) -> dict[str, str]:
    """Logs results/STUDY/reports/index.html as a run of its own; returns the ids of "experiment" and "run".

    Raises UserError where there is no page, and where MLflow does not take it: the call can be repeated.
    """
    page = results / "reports" / "index.html"
    if not page.is_file():
        raise UserError(f"there is no page '{page}' yet; run the study, or `viewbench report {results}`")
    verdict = _page.verdict(_study.load(results))
    with explained(tracking.uri):
        log = open_log(about.name, tracking, RETRIES, tracking.patience)
        log.start()
        tracked = Tracked(about, StudyCells(about, results, tracking), log)
        run = tracked.page(page, [results / name for name in ALSO])
        tracked.describe(verdict, run)
    return {"experiment": log.experiment, "run": run}
