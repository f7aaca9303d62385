"""Log a study's cells to MLflow."""

import sys
from pathlib import Path

import click

from . import _options


@click.command()
@click.argument("study")
@click.option("--results", type=click.Path(path_type=Path), default="results", show_default=True)
@click.option("--cell", metavar="B/SCENE/SEL/RATIO/SEED", help="Log this cell only; a store that is down is no error.")
@click.option("--stamp", type=click.Path(path_type=Path), help="File to write when done, for the workflow.")
def command(study: str, results: Path, cell: str | None, stamp: Path | None) -> None:
    """Log the finished cells of STUDY: new ones and changed ones; a cell never has two runs."""
    from ...common import settings as settings_file
    from ...common.cells import cell_name
    from ...common.errors import UserError
    from ...common.files import write_json
    from ...reports import _tracking
    from .. import _collect, _study

    settings = settings_file.load()
    checked = _study.load(study, settings)
    cells = checked.cells()
    if cell is not None:
        cells = [row for row in cells if cell_name(row) == cell]
        if not cells:
            raise UserError(f"study '{study}' has no cell '{cell}'")
    else:
        cells = _collect.without_stale(cells, results / checked.name)
    done: dict = {"skipped": _tracking.NO_TRACKING}
    asked, folder = settings.tracking, results / checked.name
    try:
        if asked.uri and cell is not None:
            done = dict(_tracking.track_cell(checked.name, cells[0], folder, asked))
        elif asked.uri:
            done = dict(_tracking.track(checked.name, cells, folder, asked, _options.progress("track"), _say))
    except UserError as error:
        if stamp is None:
            raise
        # The study's results do not depend on the log: say what happened and go on.
        done = {"skipped": str(error)}
        later = "the end of the study tries again" if cell else f"repeat with: viewbench track {study}"
        _say(f"{error}; {later}")
    if stamp is not None:
        write_json(stamp, done)
    else:
        click.echo(", ".join(f"{value} {key}" if key != "skipped" else str(value) for key, value in done.items()))


def _say(text: str) -> None:
    print(f"viewbench: {text}", file=sys.stderr, flush=True)
