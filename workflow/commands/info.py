"""Say what a capture is: format, frames, sizes, extent, points."""

import json

import click

from . import _options


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@_options.scene_options
@_options.thinning_options
def command(scene: _options.Capture, as_json: bool) -> None:
    """Say what was detected in SCENE, a folder or a name of environment.toml."""
    from ...common import settings as settings_file
    from ...common.errors import printable
    from ...common.files import plain
    from ...scenes.summary import summary

    opened = scene.open(settings_file.load(), notes=False, pictures=False)
    _options.refuse_thinning(scene, opened)
    facts = summary(opened)
    if as_json:
        click.echo(json.dumps(plain(facts), indent=1))
        return
    for name, value in facts.items():
        shown = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else value
        click.echo(f"{name.replace('_', ' '):<20}{'none' if value in (None, [], ()) else printable(str(shown))}")
