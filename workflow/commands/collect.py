"""Gather the cells of a study into results.csv."""

from pathlib import Path

import click


@click.command()
@click.argument("study")
@click.option("--results", type=click.Path(path_type=Path), default="results", show_default=True)
@click.option("--partial", is_flag=True, help="Keep unfinished cells as rows that say what is missing.")
def command(study: str, results: Path, partial: bool) -> None:
    """Write results.csv of STUDY: one row a cell, read from the cells' JSON files."""
    from ...common import settings as settings_file
    from .. import _collect, _study

    settings = settings_file.load()
    checked = _study.load(study, settings)
    rows = _collect.collect(checked, results / checked.name, settings, partial=partial)
    failed = sum(row["status"] != "ok" for row in rows)
    click.echo(f"{len(rows) - failed} of {len(rows)} cells in {results / checked.name / 'results.csv'}")
