"""Log a study's cells to MLflow."""

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
    import sys

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
    try:
        if settings.tracking.uri:
            done = dict(
                _tracking.track(
                    checked.name, cells, results / checked.name, settings.tracking, _options.progress("track")
                )
            )
    except UserError as error:
        if stamp is None:
            raise
        # The study's results do not depend on the log: say what happened and go on.
        done = {"skipped": str(error)}
        print(f"viewbench: {error}; repeat with: viewbench track {study}", file=sys.stderr)
    if stamp is not None:
        write_json(stamp, done)
    else:
        click.echo(", ".join(f"{value} {key}" if key != "skipped" else str(value) for key, value in done.items()))
