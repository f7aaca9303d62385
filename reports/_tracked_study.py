"""A study on its way into its experiment: what the experiment says of itself, its cells, their summaries, the page."""

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from ..common.cells import cell_name
from ..common.errors import UserError
from ..common.files import sha256_file
from . import _tracked_summary, _tracked_view
from ._about import About
from ._tracked_cell import Cells, user
from ._tracked_run import PARENT, SOURCE, SOURCE_TYPE, USER, Content
from ._tracked_summary import PANELS, Group, group_of, key_of
from ._tracking_log import TRIES, Key, Log

NOTE = "mlflow.note.content"
KIND_OF_EXPERIMENT = "custom_model_development"  # in MLflow's words; without it the page is one for language models


class Tracked:
    """Puts a study's cells and summaries into its log; what MLflow raises passes through."""

    def __init__(self, about: About, cells: Cells, log: Log):
        self.about, self.cells, self.log = about, cells, log

    def describe(self, verdict: Sequence[str] = (), page: str = "") -> None:
        """Says in its tags what the experiment is, what came out of it, and how Figure 4 is drawn.

        A verdict that is there already is kept where none is given. `page` is the id of the run that has the page.
        """
        tags = {
            "mlflow.experimentKind": KIND_OF_EXPERIMENT,
            "mlflow.experiment.primaryMetric.name": "psnr_db",
            "mlflow.experiment.primaryMetric.greaterIsBetter": "True",
        }
        about = self.about
        first, *further = ([about.panel(*place, key) for place in about.panels()] for key in PANELS)
        tags |= _tracked_view.tags(first, self.log.created_ms, [panel for panels in further for panel in panels])
        words = note(about, self.log.experiment, verdict, page)
        if verdict or page or not self.log.tags.get(NOTE, "").startswith(about.title):
            tags[NOTE] = words
        self.log.describe(tags)

    def cell(self, cell: Mapping[str, str]) -> bool:
        """Logs a cell; whether its run is new. Raises UserError for one that cannot be read."""
        parent = self._parent(group_of(cell), cell)
        key: Key = ("cell", cell_name(cell))
        with tempfile.TemporaryDirectory(prefix="viewbench-run-") as drawn:
            new = self.log.put(
                key,
                lambda: self.cells.fingerprint(cell),
                lambda: self.cells.content(cell, {PARENT: parent}, Path(drawn)),
            )
        self.log.adopt(key, parent)
        return new

    def drop(self, cell: Mapping[str, str]) -> None:
        """Removes the run of a cell whose files are out of date, where it is a run of these results."""
        key: Key = ("cell", cell_name(cell))
        if self.log.known(key) and self.cells.made(cell, self.log.runs[key][0].fingerprint):
            self.log.remove(key)

    def prune(self) -> None:
        """Removes the runs of cells and summaries that the study does not have, and summaries without a cell."""
        cells = {cell_name(cell) for cell in self.about.grid}
        for key in [key for key in self.log.runs if key[0] == "cell" and key[1] not in cells]:
            self.log.remove(key)
        for key in [key for key in self.log.runs if key[0] == "summary" and not self._children(key)]:
            self.log.remove(key)

    def summary(self, group: Group, members: Sequence[Mapping[str, str]], whole: bool = True) -> None:
        """Makes the points of a group's summary those of its `members`, cells that have runs; without `whole` it may
        have more."""
        key: Key = ("summary", key_of(group))
        facts = [self.cells.facts(cell) for cell in members]
        points = _tracked_summary.points(group, self.about, facts)
        ended_ms = max(cell.ended_ms for cell in facts)
        for _ in range(TRIES):
            parent = self._parent(group, members[0])
            # A number that has changed has the run made anew: the history of a metric keeps what it was.
            if self.log.add(key, points, ended_ms, whole):
                break
        else:
            raise UserError(f"other writers removed the run of {key[1]} {TRIES} times")
        for child in self._children(key):
            self.log.adopt(child, parent)

    def page(self, page: Path, also: Iterable[Path]) -> str:
        """Logs the page and what lies beside it; returns the id of the run."""
        about, key = self.about, ("report", self.about.name)
        made_ms = round(1000 * page.stat().st_mtime)
        told = Content(
            kind="report",
            key=about.name,
            name=f"report · {about.name}",
            tags={SOURCE: about.source, SOURCE_TYPE: "LOCAL", USER: user()},
            params={},
            metrics=(),
            started_ms=made_ms,
            ended_ms=made_ms,
            files=[(file, None) for file in (page, *also) if file.is_file()],
        )
        self.log.put(key, lambda: told.fingerprint(sha256_file(page)), lambda: told)
        return self.log.runs[key][0].id

    def _children(self, summary: Key) -> list[Key]:
        """Keys of the cells that have a run and belong to a summary."""
        return [key for key in self.log.runs if key[0] == "cell" and key[1].startswith(f"{summary[1]}/")]

    def _parent(self, group: Group, cell: Mapping[str, str]) -> str:
        """The id of the run of a group's summary, which is made where there is none."""
        key: Key = ("summary", key_of(group))
        asked = _tracked_summary.fingerprint(group, self.about)
        if [run.fingerprint for run in self.log.runs.get(key, [])] != [asked]:
            told = _tracked_summary.content(group, self.about, self.cells.facts(cell), self.cells.scene(group[1]))
            self.log.put(key, lambda: asked, lambda: told)
        return self.log.runs[key][0].id


def note(about: About, experiment: str, verdict: Sequence[str] = (), page: str = "") -> str:
    """What the experiment says of itself, in Markdown: title, links to figure and page, verdict and description.

    MLflow shows the first line alone until one asks for the rest. `page` is the id of the run that has the page.
    """
    links = [f"[Figure 4]({_tracked_view.link('', experiment)})"]
    links += [f"[the page]({_tracked_view.run_link('', experiment, page, '/artifacts/index.html')})"] if page else []
    parts = [" · ".join([about.title, *links]), " ".join(verdict), about.description]
    return "\n\n".join(part for part in parts if part)
