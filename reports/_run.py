"""Draws one report of a study, or puts the drawn ones together into the page."""

from pathlib import Path

from ..common import plugins
from . import _items, _page, _study


def run(study_dir: Path, name: str) -> None:
    """Draws the report `name` of the study in `study_dir` (results/STUDY) into its reports folder.

    The list of what was drawn, NAME.items.json, is written last. Raises UserError for an unknown report and for a
    study that cannot be read.
    """
    report = plugins.load("reports", name)
    study = _study.load(Path(study_dir))
    out = study.folder / "reports"
    out.mkdir(parents=True, exist_ok=True)
    _items.write(out, name, report.build(study, out))


def page(study_dir: Path) -> None:
    """Writes reports/index.html from the reports that were drawn."""
    _page.build(Path(study_dir))
