"""Embed the training views once, for the semantic factor."""

from pathlib import Path

import click

from . import _options


@click.command()
@_options.encoder_option
@click.option("--out", type=click.Path(path_type=Path), help="Also write them as N x D array to this .npy file.")
@click.option("--beside", is_flag=True, help="Also write them into SCENE's folder, for everyone who gets the capture.")
@_options.scene_options
@_options.thinning_options
def command(scene: _options.Capture, encoder: str | None, beside: bool, out: Path | None) -> None:
    """Embed the training views of SCENE; what is in the cache already is not embedded again."""
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...scenes import features, shipped_features

    settings = settings_file.load()
    opened = scene.open(settings)
    _options.refuse_thinning(scene, opened)
    name = encoder or settings.features.encoder
    cache, batch, device = Path(settings.features.cache), settings.features.batch, settings.compute.device
    if beside and (":" in name or not opened.root.is_dir() or opened.details.get("extracted")):
        raise UserError("--beside is for folders of images, and for encoders by NAME (not NAME:MODEL)")
    if beside:
        shipped_features.check_place(opened.root)
    root = None if beside else opened.root
    rows = features.features(opened.train, name, cache, batch, _options.progress("features"), device, root)
    if beside:
        pictures = [features.content_hash(path) for path in opened.train.paths]
        click.echo(shipped_features.write(opened.root, name, features.of_encoder(name), pictures, rows))
    if out is not None:
        features.save(out, rows)
    click.echo(f"{len(rows)} x {rows.shape[1]} features by {name}")
