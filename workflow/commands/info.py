"""Say what a capture is: format, frames, sizes, extent, points."""

import json

import click

from . import _options


@click.command()
@_options.scene_argument
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@_options.format_option
@_options.holdout_option
@_options.outside_option
def command(scene: str, as_json: bool, format_: str | None, holdout: str | None, allow_outside: bool) -> None:
    """Say what was detected in SCENE, a folder or a name of environment.toml."""
    from ...common import settings as settings_file
    from ...common.files import plain
    from ...scenes.load import open_scene
    from ...scenes.summary import summary

    facts = summary(
        open_scene(scene, settings_file.load(), format=format_, holdout=holdout, allow_outside=allow_outside)
    )
    if as_json:
        click.echo(json.dumps(plain(facts), indent=1))
        return
    for name, value in facts.items():
        shown = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else value
        click.echo(f"{name.replace('_', ' '):<20}{'none' if value in (None, [], ()) else shown}")
