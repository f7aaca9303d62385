"""Train one scene model on chosen views."""

from pathlib import Path
from typing import Any

import click

from . import _options


@click.command()
@click.option("--selection", type=click.Path(path_type=Path), required=True, help="selection.json of viewbench select.")
@click.option("--ratio", type=float, help="Take the first views of the selection only: this share of all.")
@click.option("--count", type=int, help="Take so many of its first views, instead of --ratio.")
@_options.count_rule_option
@click.option("--backend", default="splat", show_default=True, help="Trainer (viewbench list backends).")
@_options.out_option
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the training.")
@click.option("--iterations", type=click.IntRange(min=1), help="Stop after so many steps.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="Stop after so long, set-up not counted.")
@click.option("--width", type=click.IntRange(min=16), help="Resize images to so many pixels; else as they are.")
@_options.threads_option
@click.option("--set", "options", multiple=True, metavar="KEY=VALUE", help="Option of the backend; repeatable.")
@_options.scene_options
def command(**given: Any) -> None:
    """Train one model on the chosen views of SCENE and write it, with train.json, into one folder.

    --ratio and --count take the first views of a greedy selector's order, which are what it would choose for that
    number. Without --iterations and --seconds the backend's own default number of iterations is used.
    """
    from ...backends import _registry
    from ...backends._train import train
    from ...backends._types import Budget, Job
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...selectors._selection import count_of, first_views, load_selection

    settings = _options.with_threads(settings_file.load(), given["threads"])
    budget = Budget(given["iterations"], given["seconds"])
    if budget == Budget():
        budget = Budget(_registry.load(given["backend"], settings).CAPABILITIES.default_iterations)
    scene = given["scene"].open(settings)
    chosen = load_selection(given["selection"])
    count = given["count"]
    if given["ratio"] is not None and count is not None:
        raise UserError("give --ratio or --count, not both")
    if given["ratio"] is not None:
        count = count_of(given["ratio"], len(scene.train), given["count_rule"])
    chosen = chosen if count is None else first_views(chosen, count)
    job = Job(given["backend"], given["seed"], budget, given["width"], _options.settings_of(given["options"]))
    record = train(scene, chosen, job, given["out"], settings=settings, progress=_options.progress("train"))
    primitives = "" if record["n_primitives"] is None else f", {record['n_primitives']} primitives"
    click.echo(f"{record['iterations']} iterations in {record['seconds']:.1f} s{primitives}")
    seeding = record["seeding"]
    if seeding["count"]:
        click.echo(f"started from {seeding['count'] - seeding['shell_points']} points by {seeding['source']}")
    if seeding["fallback"]:
        click.echo(f"note: {seeding['fallback']}")
