"""Check a study file and show its grid."""

import json
from pathlib import Path

import click


@click.command()
@click.argument("study", default="quick")
@click.option("--out", type=click.Path(path_type=Path), help="Write the checked study as JSON.")
def command(study: str, out: Path | None) -> None:
    """Check STUDY, the name of one that ships or a file, and print it with its defaults filled in."""
    from ...common import settings as settings_file
    from ...common.files import plain, sealed, write_json
    from .. import _study

    record = _study.load(study, settings_file.load()).record()
    if out is not None:
        write_json(out, sealed(record))
    else:
        click.echo(json.dumps(plain(record), indent=1))
