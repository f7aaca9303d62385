"""Draw a study's figures and tables, and its page."""

from pathlib import Path

import click


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--only", metavar="NAME", help="One report (viewbench list reports), without the page.")
@click.option("--page", is_flag=True, help="Only put the page together from the reports already drawn.")
def command(folder: Path, only: str | None, page: bool) -> None:
    """Draw the reports of the study in FOLDER (results/STUDY) and put them into reports/index.html."""
    from ...common.errors import UserError
    from ...common.files import read_json
    from ...reports._run import page as put_together
    from ...reports._run import run as draw

    if not (folder / "results.csv").is_file():
        raise UserError(f"'{folder}' has no results.csv; give the folder of a study, such as results/quick")
    if not page:
        names = [only] if only else read_json(folder / "study.json", "study")["reports"]
        for name in names:
            draw(folder, name)
    if not only:
        put_together(folder)
        click.echo(folder / "reports" / "index.html")
