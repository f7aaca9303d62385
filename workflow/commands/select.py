"""Choose views of a capture and write them as a capture of the same format."""

from pathlib import Path
from typing import Any

import click

from . import _options


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write the chosen subset to.")
@click.option("--selector", default="maxmin", show_default=True, help="Way of choosing (viewbench list selectors).")
@click.option("--ratio", type=float, help="Share of the training views, in (0, 1].")
@click.option("--count", type=int, help="Number of views, instead of --ratio.")
@_options.count_rule_option
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the choice.")
@click.option("--alpha", type=float, help="Weight of the position factor; 0.7.")
@click.option("--beta", type=float, help="Weight of the rotation factor; 0.2. The semantic one gets the rest.")
@click.option("--sigma", type=float, help="Width of the position factor, positions scaled to [-4, 4]; 0.5.")
@click.option("--factors", help="Factors to use, of pos,ang,sem.")
@click.option("--start", type=click.Choice(["random", "medoid"]), help="First view of maxmin and kcenter.")
@click.option("--sample", is_flag=True, help="Draw logdet's views from the k-DPP instead of maximising.")
@click.option("--sharpness", type=float, metavar="W", help="How much blurred frames lose; 0 ignores blur.")
@click.option("--max-gap", metavar="S", help="No gap over so many seconds (0.8, 0.8s) or frames (30f) in the capture.")
@click.option("--features", type=click.Path(path_type=Path), help="Your own N x D features (.npy).")
@_options.encoder_option
@click.option("--set", "options", multiple=True, metavar="KEY=VALUE", help="Parameter of the selector; repeatable.")
@click.option(
    "--check-matches/--no-check-matches",
    default=None,
    help="Match neighbours of the choice; without a word where it has no poses and OpenCV is installed.",
)
@click.option("--dry-run", is_flag=True, help="Choose and print, write nothing.")
@click.option("--selection", type=click.Path(path_type=Path), help="Write only selection.json, to this file.")
@click.option("--plot", type=click.Path(path_type=Path), help="Picture of the choice: .png, .pdf, .svg or .html (3D).")
@click.option("--copy", is_flag=True, help="Copy images instead of linking them.")
@click.option("--force", is_flag=True, help="Replace --out when it is not empty.")
@_options.scene_options
@_options.thinning_options
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
    folder = given["out"] if not given["dry_run"] else None
    looks = bool(folder and not scene.posed) if given["check_matches"] is None else given["check_matches"]
    if looks:
        from . import _matches  # no source: it looks at what was chosen

        looks = _matches.possible(given["check_matches"])
    # The frames that are candidates: of a video those that were read, of other captures those of a mask.
    # TO WIRE: where it is no video, thinning.candidates(scene.train, stride, fps) goes into _run.run.
    _options.refuse_thinning(given["scene"], scene)
    n = len(scene.train)
    count = given["count"] if given["ratio"] is None else count_of(given["ratio"], n, given["count_rule"])
    parameters = _options.settings_of(given["options"])
    named = ("alpha", "beta", "sigma", "start", "sharpness")
    parameters |= {key: given[key] for key in named if given[key] is not None}
    if given["sample"]:
        parameters["sample"] = True
    if given["factors"] is not None:
        parameters["factors"] = [part.strip() for part in given["factors"].split(",") if part.strip()]
    if isinstance(parameters.get("factors"), str):
        parameters["factors"] = [parameters["factors"]]
    features = _features(scene, given, parameters, settings)
    sharp = _sharpness(scene, settings) if parameters.get("sharpness") else None

    def choose(number: int) -> dict[str, Any]:
        return _run.run(scene, given["selector"], number, given["seed"], parameters, features, sharp)

    if given["max_gap"] is None:
        record = choose(count)
    else:
        from ._gaps import without_gaps

        record = without_gaps(choose, scene, count, given["max_gap"], None, sharp)
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
    if looks:
        from . import _matches  # no source: it looks at what was chosen

        _matches.check(scene, record, folder, given["selection"])
    if given["plot"]:
        title = f"{scene.name}: {count} of {n} views by {given['selector']}"
        cameras = scene.train.cameras
        plot(given["plot"], title, cameras.positions, cameras.forward, np.asarray(record["indices"]))
    if given["out"] and not given["dry_run"]:
        click.echo(f"viewbench: {count} of {n} views are in {given['out']}, in the order chosen:", err=True)
    if given["dry_run"] or not given["selection"]:
        for name in record["names"]:
            click.echo(name)


def _features(scene: Any, given: dict[str, Any], parameters: dict[str, Any], settings: Any) -> Any:
    """The features that the selector needs: the user's own, the cached ones, or None without the semantic factor."""
    from ...common import plugins

    if given["features"] is not None:
        from ...scenes.features import load_user_features

        return load_user_features(given["features"], len(scene.train))
    plugins.load("selectors", given["selector"])
    factors = parameters.get("factors", plugins.constant("selectors", given["selector"], "FACTORS", ()))
    encoder = given["encoder"] or settings.features.encoder
    if "sem" not in tuple(factors) or encoder == "none":
        return None
    from ...scenes.features import features

    cache = Path(settings.features.cache)
    progress = _options.progress("features")
    return features(scene.train, encoder, cache, settings.features.batch, progress, settings.compute.device)


def _sharpness(scene: Any, settings: Any) -> Any:
    """How sharp each training image is, measured once and kept."""
    from ...scenes.sharpness import sharpness

    return sharpness(scene.train, Path(settings.features.cache), _options.progress("sharpness"))
