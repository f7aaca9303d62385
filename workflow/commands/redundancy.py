"""Say how much of a capture repeats itself, and how many views are enough."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from . import _choice_options, _options

RUNS = 5


@click.command()
@_choice_options.comparison_options
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the first view.")
@click.option(
    "--at",
    multiple=True,
    type=float,
    metavar="S",
    help="Similarity to say it for; repeatable. The highest ends the curve.",
)
@click.option("--runs", type=click.IntRange(min=0), default=RUNS, show_default=True, help="Stretches to name.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--plot", type=click.Path(path_type=Path), help="Figure of the curve: .png, .pdf, .svg or .html.")
@click.option("--out", type=click.Path(path_type=Path), help="The curve as a table (.csv).")
@_options.scene_options
@_options.thinning_options
def command(**given: Any) -> None:
    """Say how much of SCENE repeats itself: how many views are enough for every frame to be so similar to one of them.

    The views are those of `viewbench select` with the same options (selector maxmin), in its order; the similarity is
    the one that it chooses by, 1 for two views in one place that show one thing. The curve has for every count the
    uncovered distance: that (1 - similarity) of the frame left out that is farthest from the views chosen, which
    `viewbench select --auto` stops at. Without poses image content alone is compared.
    """
    import numpy as np

    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...scenes.validate import check_present
    from ...selectors import _covering, _redundancy, _run

    wanted = given["at"] or _redundancy.LEVELS
    for s in wanted:
        if not 0 < s < 1:
            raise UserError(f"--at {s:g}: expected a similarity in (0, 1); 0.95 is an uncovered distance of 0.05")
    _choice_options.check_file("--out", given["out"], (".csv",))
    if given["plot"]:
        from ...reports._selection_plot import kind_of

        kind_of(given["plot"])
        _choice_options.check_file("--plot", given["plot"])
    settings = settings_file.load()
    scene = given["scene"].open(settings)
    looked_at = _options.looked_at(given["scene"], scene)
    if looked_at is not None:
        scene = replace(scene, train=scene.train.subset(np.flatnonzero(looked_at)))
    parameters = _choice_options.parameters_of(given)
    _run.checked(scene, "maxmin", 1, parameters)
    check_present(scene)
    features = _choice_options.features_of(scene, "maxmin", given, parameters, settings)
    sharp = _choice_options.sharpness_of(scene, settings) if parameters.get("sharpness") else None
    record, curve, similar = _covering.order_within(scene, 1 - max(wanted), given["seed"], parameters, features, sharp)
    for name, note in record.get("notes", {}).items():
        click.echo(f"viewbench: {name.replace('_', ' ')}: {note}", err=True)
    n = len(scene.train)
    found = _redundancy.levels(curve, n, wanted)
    at = _redundancy.level_of_runs(found, n)
    centres = record["indices"][: next(level.views for level in found if level.similarity == at)]
    longest = _redundancy.runs(similar, centres, at, given["runs"]) if given["runs"] else []
    if given["out"]:
        from ...reports._tables import write_csv

        write_csv(given["out"], _rows(record, curve, scene))
    if given["plot"]:
        from ...reports._redundancy_plot import plot

        plot(given["plot"], f"{scene.name}: what the first views leave uncovered", curve, n, found)
    if given["as_json"]:
        click.echo(json.dumps(_facts(scene, record, similar, found, at, longest), indent=1))
        return
    click.echo("\n".join(_text(scene, found, at, longest)))


def _rows(record: dict[str, Any], curve: Any, scene: Any) -> list[dict[str, object]]:
    rows = enumerate(zip(record["indices"], record["names"], curve, strict=True), start=1)
    return [
        {"views": k, "uncovered": float(left), "similarity": 1 - float(left), "index": index, "name": name}
        for k, (index, name, left) in rows
    ]


def _facts(scene: Any, record: dict[str, Any], similar: Any, found: Any, at: float, longest: Any) -> dict[str, Any]:
    n, names, times = len(scene.train), scene.train.names, scene.train.times
    return {
        "scene": scene.name,
        "views": n,
        "weights": similar.weights,
        "parameters": record["parameters"],
        "seed": record["seed"],
        "levels": [
            {"similarity": level.similarity, "enough": level.views, "nothing_new": n - level.views} for level in found
        ],
        "runs_at": at,
        "runs": [
            {
                "first": run.first,
                "last": run.last,
                "frames": len(run),
                "like": run.centre,
                "similarity": round(run.similarity, 6),
                "names": [names[i] for i in (run.first, run.last, run.centre)],
                **({} if times is None else {"seconds": [float(times[run.first]), float(times[run.last])]}),
            }
            for run in longest
        ],
    }


def _text(scene: Any, found: Any, at: float, longest: Any) -> list[str]:
    n, names, times = len(scene.train), scene.train.names, scene.train.times
    lines = [
        f"{scene.name}: {n} training views",
        "",
        "similarity   views enough    frames that say nothing new",
    ]
    for level in found:
        enough, rest = level.views, n - level.views
        lines.append(f"{level.similarity:>9g}{enough:>9,} {enough / n:>6.0%}{rest:>12,} {rest / n:>6.0%}")
    if longest:
        lines += ["", f"longest stretches at least {at:g} similar to one of their frames:"]
    for run in longest:
        span = "" if times is None else f", {times[run.first]:.1f} to {times[run.last]:.1f} s"
        lines.append(
            f"  frames {run.first} to {run.last} ({names[run.first]} to {names[run.last]}{span}): {len(run)} frames "
            f"within {run.similarity:.3f} of frame {run.centre}"
        )
    return lines
