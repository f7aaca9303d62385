"""Render the test split with a trained model and score it."""

from pathlib import Path

import click

from . import _options


@click.command()
@click.argument("model", type=click.Path(path_type=Path))
@_options.out_option
@_options.threads_option
@_options.scene_options
def command(model: Path, scene: _options.Capture, out: Path, threads: int | None) -> None:
    """Render the test views of SCENE with the model in the folder MODEL; write metrics.json and the renders."""
    from ...backends._evaluate import evaluate
    from ...common import settings as settings_file

    settings = _options.with_threads(settings_file.load(), threads)
    opened = scene.open(settings)
    record = evaluate(model, opened, out, settings=settings, progress=_options.progress("evaluate"))
    text = [f"{len(record['views'])} test views"]
    for metric, unit in (("psnr_db", " dB PSNR"), ("ssim", " SSIM"), ("lpips", " LPIPS")):
        if record[metric] is not None:
            text.append(f"{record[metric]:.3f}{unit}")
    click.echo(", ".join(text))
