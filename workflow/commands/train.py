"""Train one scene model on chosen views."""

from pathlib import Path

import click

from viewbench.workflow.commands import _options


@click.command()
@_options.scene_argument
@click.option("--selection", type=click.Path(path_type=Path), required=True, help="selection.json of viewbench select.")
@click.option("--backend", default="splat", show_default=True, help="Trainer (viewbench list backends).")
@_options.out_option
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the training.")
@click.option("--iterations", type=click.IntRange(min=1), help="Stop after so many steps.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="Stop after so long, set-up not counted.")
@click.option("--width", type=click.IntRange(min=16), help="Resize images to so many pixels; else as they are.")
@click.option("--set", "options", multiple=True, metavar="KEY=VALUE", help="Option of the backend; repeatable.")
@_options.format_option
@_options.holdout_option
def command(
    scene: str,
    selection: Path,
    backend: str,
    out: Path,
    seed: int,
    iterations: int | None,
    seconds: float | None,
    width: int | None,
    options: tuple[str, ...],
    format_: str | None,
    holdout: str | None,
) -> None:
    """Train one model on the chosen views of SCENE and write it, with train.json, into one folder.

    Without --iterations and --seconds the backend's own default number of iterations is used.
    """
    from viewbench.backends import _registry
    from viewbench.backends._train import load_selection, train
    from viewbench.backends._types import Budget
    from viewbench.common import settings as settings_file
    from viewbench.scenes.load import open_scene

    settings = settings_file.load()
    if iterations is None and seconds is None:
        iterations = _registry.load(backend, settings).CAPABILITIES.default_iterations
    record = train(
        open_scene(scene, settings, format=format_, holdout=holdout),
        load_selection(selection),
        backend,
        out,
        settings=settings,
        seed=seed,
        budget=Budget(iterations, seconds),
        width=width,
        options=_options.settings_of(options),
        progress=_options.progress("train"),
    )
    primitives = "" if record["n_primitives"] is None else f", {record['n_primitives']} primitives"
    click.echo(f"{record['iterations']} iterations in {record['seconds']:.1f} s{primitives}")
    seeding = record["seeding"]
    if seeding.get("source"):
        click.echo(f"started from {seeding['count']} points by {seeding['source']}")
    if seeding.get("fallback"):
        click.echo(f"note: {seeding['fallback']}")
