"""Write what reports need of a scene: its cameras, a sample of its points, its content hash."""

from pathlib import Path

import click

from . import _options

SAMPLE = 5000  # points kept for the figures


@click.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="JSON file to write.")
@click.option("--width", type=click.IntRange(min=16), help="Also write the test images at this width beside it.")
@_options.scene_options
def command(scene: _options.Capture, out: Path, width: int | None) -> None:
    """Write positions and viewing directions of both splits of SCENE as JSON."""
    import numpy as np

    from ...common import settings as settings_file
    from ...common.files import sealed, write_json
    from ...scenes.digest import scene_sha256
    from ...scenes.seen import shares_of
    from ...scenes.types import Split

    settings = settings_file.load()
    opened = scene.open(settings, notes=False)

    def split(part: Split) -> dict:
        return {
            "names": part.names,
            "positions": np.round(part.cameras.positions, 5),
            "forward": np.round(part.cameras.forward, 5),
        }

    points = None
    if opened.points is not None and len(opened.points):
        step = max(1, len(opened.points) // SAMPLE)
        points = np.hstack([np.round(opened.points.xyz[::step], 3), opened.points.rgb[::step]])[:SAMPLE]
    if width is not None and len(opened.test):
        _write_truth(opened.test, width, out.with_suffix(""))
    record = {
        "schema": 1,
        "scene": opened.name,
        "dataset": settings.dataset_of(scene.name, opened.name),
        "room": settings.room_of(scene.name),
        "walk": settings.walk_of(scene.name),
        "format": opened.format,
        "holdout": opened.holdout,
        "n_train": len(opened.train),
        "n_test": len(opened.test),
        "width": int(opened.train.cameras.width[0]),
        "height": int(opened.train.cameras.height[0]),
        "sha256": scene_sha256(opened),
        "notes": opened.notes,
        "train": split(opened.train),
        "test": split(opened.test),
        "points": points,
        "seen": shares_of(opened.root, opened.test.names),
    }
    write_json(out, sealed(record))


def _write_truth(test, width: int, folder: Path) -> None:
    """The test images as they are compared with, for the pictures in the reports."""
    import numpy as np

    from ...scenes.images import load_images
    from ...scenes.pictures import picture_name, save_png, to_uint8

    images, _ = load_images(test, np.arange(len(test)), width)
    for number, (name, image) in enumerate(zip(test.names, images, strict=True)):
        save_png(to_uint8(image, image.shape, name), folder / picture_name(number, name))
