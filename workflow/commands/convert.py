"""Read a capture in any format and write it in another."""

from pathlib import Path

import click

from . import _options


@click.command()
@_options.out_option
@click.option("--to", required=True, metavar="FORMAT", help="Format to write: transforms or colmap.")
@_options.links_options
@click.option("--force", is_flag=True, help="Replace --out when it is not empty.")
@_options.scene_options
def command(
    scene: _options.Capture,
    out: Path,
    to: str,
    links: str,
    force: bool,
) -> None:
    """Write all views of SCENE to --out in the format --to."""
    import numpy as np

    from ...common import settings as settings_file
    from ...scenes.subset import write_scene

    opened = scene.open(settings_file.load())
    for note in write_scene(opened, np.arange(len(opened.train)), out, to, links, force):
        click.echo(f"viewbench: {note}", err=True)
    if to == "colmap" and opened.points is None:
        click.echo("viewbench: the scene has no points; nerfstudio's and gsplat's COLMAP readers want some", err=True)
    click.echo(f"{len(opened.train)} training and {len(opened.test)} test views in {out}")
