"""Embed the training views once, for the semantic factor."""

from pathlib import Path

import click

from . import _options


@click.command()
@_options.encoder_option
@click.option("--out", type=click.Path(path_type=Path), help="Also write them as N x D array to this .npy file.")
@_options.scene_options
@_options.thinning_options
def command(scene: _options.Capture, encoder: str | None, out: Path | None) -> None:
    """Embed the training views of SCENE; what is in the cache already is not embedded again."""
    from ...common import settings as settings_file
    from ...scenes import features

    settings = settings_file.load()
    opened = scene.open(settings)
    _options.refuse_thinning(scene, opened)
    name = encoder or settings.features.encoder
    cache, batch, device = Path(settings.features.cache), settings.features.batch, settings.compute.device
    rows = features.features(opened.train, name, cache, batch, _options.progress("features"), device)
    if out is not None:
        features.save(out, rows)
    click.echo(f"{len(rows)} x {rows.shape[1]} features by {name}")
