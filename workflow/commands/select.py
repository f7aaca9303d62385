"""Choose views of a capture and write them as a capture of the same format."""

from pathlib import Path
from typing import Any

import click

from . import _choice_options, _options


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write the chosen subset to.")
@click.option("--selector", default="maxmin", show_default=True, help="Way of choosing (viewbench list selectors).")
@click.option("--ratio", type=float, help="Share of the training views, in (0, 1].")
@click.option("--count", type=int, help="Number of views, instead of --ratio.")
@_options.count_rule_option
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the choice.")
@_choice_options.comparison_options
@click.option("--sample", is_flag=True, help="Draw logdet's views from the k-DPP instead of maximising.")
@click.option("--set", "options", multiple=True, metavar="KEY=VALUE", help="Parameter of the selector; repeatable.")
@click.option("--dry-run", is_flag=True, help="Choose and print, write nothing.")
@click.option("--selection", type=click.Path(path_type=Path), help="Write only selection.json, to this file.")
@click.option("--plot", type=click.Path(path_type=Path), help="Picture of the choice: .png, .pdf, .svg or .html (3D).")
@click.option("--copy", is_flag=True, help="Copy images instead of linking them.")
@click.option("--force", is_flag=True, help="Replace --out when it is not empty.")
@_options.scene_options
def command(**given: Any) -> None:
    """Choose views of SCENE and write them to --out, in the format that was read, with selection.json."""
    import numpy as np

    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...common.files import sealed, write_json
    from ...scenes.validate import check_present
    from ...selectors import _run
    from ...selectors._selection import count_of

    if (given["ratio"] is None) == (given["count"] is None):
        raise UserError("give either --ratio or --count")
    if not (given["out"] or given["selection"] or given["dry_run"]):
        raise UserError("give --out FOLDER, or --dry-run to see the choice without writing it")
    if given["plot"]:
        from ...reports._selection_plot import kind_of, plot  # no source: it draws what was chosen

        kind_of(given["plot"])
    settings = settings_file.load()
    scene = given["scene"].open(settings)
    check_present(scene)
    n = len(scene.train)
    count = given["count"] if given["ratio"] is None else count_of(given["ratio"], n, given["count_rule"])
    parameters = _options.settings_of(given["options"]) | _choice_options.parameters_of(given)
    if given["sample"]:
        parameters["sample"] = True
    if isinstance(parameters.get("factors"), str):
        parameters["factors"] = [parameters["factors"]]
    features = _choice_options.features_of(scene, given["selector"], given, parameters, settings)
    sharp = _choice_options.sharpness_of(scene, settings) if parameters.get("sharpness") else None
    record = _run.run(scene, given["selector"], count, given["seed"], parameters, features, sharp)
    for name, note in record.get("notes", {}).items():
        click.echo(f"viewbench: {name.replace('_', ' ')}: {note}", err=True)
    if given["selection"]:
        write_json(given["selection"], sealed(record))
    if given["out"] and not given["dry_run"]:
        from ...scenes.subset import write_subset  # no source: it writes what was chosen

        written = write_subset(scene, record, given["out"], copy=given["copy"], force=given["force"])
        if written != scene.format:
            click.echo(f"viewbench: format {scene.format} is only read; the subset is written as {written}", err=True)
        if (given["out"] / "transforms_test.json").is_file():
            hint = "the 3DGS authors' train.py trains on transforms_test.json too unless it is given --eval"
            click.echo(f"viewbench: {hint}", err=True)
    if given["plot"]:
        title = f"{scene.name}: {count} of {n} views by {given['selector']}"
        cameras = scene.train.cameras
        plot(given["plot"], title, cameras.positions, cameras.forward, np.asarray(record["indices"]))
    if given["out"] and not given["dry_run"]:
        click.echo(f"viewbench: {count} of {n} views are in {given['out']}, in the order chosen:", err=True)
    if given["dry_run"] or not given["selection"]:
        for name in record["names"]:
            click.echo(name)
