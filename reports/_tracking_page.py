"""Puts a study's page into its experiment, with the verdict and a link to the page in what the experiment says."""

import re
import shutil
import tempfile
from pathlib import Path

from ..common.errors import UserError
from ..common.settings import Tracking
from . import _page, _study
from . import _tracking_turn as turns
from ._about import About
from ._tracked_cell import StudyCells
from ._tracked_study import Tracked
from ._tracking import RETRIES, explained, open_log

ALSO = ("results.csv",)  # beside the page
# To a file: neither to another site, which has a colon, nor to a place on the page.
LINK = re.compile(r"""<a\s[^>]*href="([^"#:][^":]*)"[^>]*>(.*?)</a>""", re.DOTALL)


def publish(about: About, results: Path, tracking: Tracking) -> dict[str, str]:
    """Logs results/STUDY/reports/index.html as a run of its own; returns the ids of "experiment" and "run".

    Raises UserError where there is no page, and where MLflow does not take it: the call can be repeated.
    """
    page = results / "reports" / "index.html"
    if not page.is_file():
        raise UserError(f"there is no page '{page}' yet; run the study, or `viewbench report {results}`")
    verdict = _page.verdict(_study.load(results))
    with explained(tracking.uri), tempfile.TemporaryDirectory(prefix="viewbench-page-") as made:
        copy = Path(made) / page.name
        copy.write_text(alone(page.read_text(encoding="utf-8")), encoding="utf-8")
        shutil.copystat(page, copy)
        log = open_log(about.name, tracking, RETRIES, tracking.patience, turns.place(results))
        log.start()
        tracked = Tracked(about, StudyCells(about, results, tracking), log)
        run = tracked.page(copy, [results / name for name in ALSO])
        tracked.describe(verdict, run)
    return {"experiment": log.experiment, "run": run}


def alone(page: str) -> str:
    """The page without links to what lies beside it, where it is shown without that."""
    return LINK.sub(lambda found: found[2], page)
