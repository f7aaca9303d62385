"""Choose views of a capture and write them as a capture of the same format."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ...common.errors import UserError
from . import _choice_options, _lists, _next, _options

FEW_POINTS = 1000  # fewer tell a trainer little of a room


@click.command(cls=_choice_options.AutoCommand)
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write the chosen subset to.")
@click.option("--selector", default="maxmin", show_default=True, help="Way of choosing (viewbench list selectors).")
@click.option("--ratio", type=float, help="Share of the training views, in (0, 1].")
@click.option("--count", type=int, help="Number of views, instead of --ratio.")
@_choice_options.auto_option
@_options.count_rule_option
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the choice.")
@_choice_options.comparison_options
@click.option("--sample", is_flag=True, help="Draw logdet's views from the k-DPP instead of maximising.")
@click.option("--set", "options", multiple=True, metavar="KEY=VALUE", help="Parameter of the selector; repeatable.")
@_lists.list_options
@click.option("--max-gap", metavar="S", help="No gap over so many seconds (0.8, 0.8s) or frames (30f) in the capture.")
@click.option(
    "--check-matches/--no-check-matches",
    default=None,
    help="Match neighbours of the choice; without a word where it has no poses and OpenCV is installed.",
)
@click.option("--dry-run", is_flag=True, help="Choose and print, write nothing.")
@click.option("--selection", type=click.Path(path_type=Path), help="Write only selection.json, to this file.")
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    help="Picture of the choice in space and time: .png, .pdf, .svg or .html (3D).",
)
@click.option("--sheet", type=click.Path(path_type=Path), help="Thumbnails of the choice: .jpg, .png, .webp or .html.")
@click.option(
    "--points",
    type=click.Choice(["all", "chosen", "triangulate"]),
    default="all",
    show_default=True,
    help="Which 3D points go along: all that the training views saw, those that two chosen views see, or new ones.",
)
@_options.links_options
@click.option("--force", is_flag=True, help="Replace --out when it is not empty.")
@_options.scene_options
@_options.thinning_options
def command(**given: Any) -> None:
    """Choose views of SCENE and write them to --out, in the format that was read, with selection.json.

    How many: a share (--ratio), a number (--count), or as many as it takes (--auto), which `viewbench redundancy SCENE`
    shows beforehand. --plot and --sheet show what was chosen.
    """
    import numpy as np

    from ...common import settings as settings_file
    from ...common.files import sealed, write_json
    from ...scenes.subset import check_target, written_format  # no source: it writes what was chosen
    from ...scenes.validate import check_present
    from ...selectors import _run
    from ...selectors._selection import count_of

    _check_options(given)
    writes = bool(given["out"]) and not given["dry_run"]
    settings = settings_file.load()
    scene = given["scene"].open(settings)
    n = len(scene.train)
    count = given["count"] if given["ratio"] is None else count_of(given["ratio"], n, given["count_rule"])
    parameters = _options.settings_of(given["options"]) | _choice_options.parameters_of(given)
    if given["sample"]:
        parameters["sample"] = True
    if isinstance(parameters.get("factors"), str):
        parameters["factors"] = [parameters["factors"]]
    _run.checked(scene, given["selector"], count, parameters, given["auto"])
    keep = _lists.kept(scene, given)
    candidates = _candidates(scene, given, keep)
    if writes:
        check_target(scene, given["out"], written_format(scene), given["force"])
    # The others' images are not even opened.
    looked_at = scene if candidates is None else replace(scene, train=scene.train.subset(np.flatnonzero(candidates)))
    check_present(looked_at)
    looks = _looks(scene, given, writes)
    features = _choice_options.features_of(looked_at, given["selector"], given, parameters, settings)
    sharp = _choice_options.sharpness_of(looked_at, settings) if parameters.get("sharpness") else None
    features, sharp = _of_all(features, candidates), _of_all(sharp, candidates)

    def choose(number: int | None) -> dict[str, Any]:
        return _run.run(
            scene,
            given["selector"],
            number,
            given["seed"],
            parameters,
            features,
            sharp,
            given["auto"],
            candidates,
            keep,
        )

    if given["max_gap"] is None:
        record = choose(count)
    else:
        from ._gaps import without_gaps

        assert count is not None
        record = without_gaps(choose, scene, count, given["max_gap"], candidates, sharp)
        if not set(keep) <= set(record["indices"]):
            raise UserError("the views to keep leave no room to fill the gaps; raise --count or --max-gap")
    _say(record, given)
    if writes:
        _write(scene, record, given)
    if given["selection"]:
        write_json(given["selection"], sealed(record))
    if looks:
        from . import _matches  # no source: it looks at what was chosen

        _matches.check(scene, record, given["out"] if writes else None, given["selection"])
    if given["plot"] or given["sheet"]:
        if features is None and not scene.posed:
            features = _of_all(_choice_options.features_of(looked_at, "maxmin", given, {}, settings), candidates)
        _draw(given, scene, record, features)
    if writes:
        click.echo(f"viewbench: {record['count']} of {n} views are in {given['out']}; in the order chosen:", err=True)
    if given["dry_run"] or not given["selection"]:
        for name in record["names"]:
            click.echo(name)
    if writes:
        for line in _next.commands(given["out"], written_format(scene), bool(len(scene.test)), scene.depth_unit):
            click.echo(f"viewbench: next, {line}", err=True)


def _check_options(given: dict[str, Any]) -> None:
    """Raises UserError for options that do not go together, and for what cannot be written, before any work is done."""
    if sum(given[key] is not None for key in ("ratio", "count", "auto")) != 1:
        raise UserError("give either --ratio or --count, or --auto to have the count found")
    if not (given["out"] or given["selection"] or given["dry_run"]):
        raise UserError("give --out FOLDER, or --dry-run to see the choice without writing it")
    if given["auto"] is not None and given["max_gap"] is not None:
        raise UserError("--max-gap fills gaps of a count; give --ratio or --count in place of --auto")
    if given["plot"]:
        from ...reports._selection_plot import kind_of  # no source: it draws what was chosen

        kind_of(given["plot"])
    if given["sheet"]:
        from ...reports import _contact_sheet  # no source: likewise

        _contact_sheet.kind_of(given["sheet"])
    for option in ("plot", "sheet", "selection"):
        _choice_options.check_file(f"--{option}", given[option])
    if given["out"] and not given["dry_run"]:
        _choice_options.check_folder("--out", given["out"].absolute().parent)


def _candidates(scene: Any, given: dict[str, Any], keep: list[int]) -> Any:
    """(N,) bool, the views that may be chosen: looked at (--stride, --fps) and not excluded, or kept; None for all."""
    masks = [_options.looked_at(given["scene"], scene), _lists.allowed(scene, given, keep)]
    masks = [mask for mask in masks if mask is not None]
    if not masks:
        return None
    allowed = masks[0] & masks[-1]
    allowed[keep] = True
    return allowed


def _of_all(values: Any, candidates: Any) -> Any:
    """(N, …) values of all training views, of which those that were not looked at are ones that nobody reads."""
    import numpy as np

    if values is None or candidates is None or len(values) == len(candidates):
        return values
    every = np.ones((len(candidates), *values.shape[1:]), dtype=values.dtype)
    every[candidates] = values
    return every


def _looks(scene: Any, given: dict[str, Any], writes: bool) -> bool:
    """Whether neighbours are matched."""
    asked = given["check_matches"]
    if asked is False or (asked is None and not (writes and not scene.posed)):
        return False
    from . import _matches  # no source: it looks at what was chosen

    return _matches.possible(asked)


def _say(record: dict[str, Any], given: dict[str, Any]) -> None:
    """What a user must know of the choice."""
    for name, note in record.get("notes", {}).items():
        if name != "auto":
            shown = ", ".join(f"{key} {value:g}" for key, value in note.items()) if isinstance(note, dict) else note
            click.echo(f"viewbench: {name.replace('_', ' ')}: {shown}", err=True)
    if given["auto"] is not None:
        reached = record["notes"]["auto"]["reached"]
        among = f"{record['count']:,} of {record.get('candidates', record['n_views']):,} views"
        among += " looked at" if "candidates" in record else ""
        words = f"every one left out is within {given['auto']:g} of a chosen one (the farthest {reached:.4f})"
        click.echo(f"viewbench: {among}: {words}", err=True)


def _write(scene: Any, record: dict[str, Any], given: dict[str, Any]) -> None:
    """Writes the subset with the points that --points asks for, and says what of it is not as it was."""
    from ...scenes import chosen_points  # no source: it writes what was chosen
    from ...scenes.subset import write_subset  # no source: likewise

    before = 0 if scene.points is None else len(scene.points)
    if given["points"] == "chosen":
        scene = chosen_points.seen(scene, record["indices"])
    elif given["points"] == "triangulate":
        scene = chosen_points.triangulated(scene, record["indices"], _options.progress("triangulate"))
    if given["points"] != "all":
        after = 0 if scene.points is None else len(scene.points)
        few = "; that is few to start training from" if after < FEW_POINTS else ""
        click.echo(f"viewbench: {after:,} points ({given['points']}) in place of {before:,}{few}", err=True)
    written, notes = write_subset(scene, record, given["out"], given["links"], given["force"])
    if written != scene.format:
        notes.insert(0, f"format {scene.format} is only read; the subset is written as {written}")
    for note in notes:
        click.echo(f"viewbench: {note}", err=True)


def _draw(given: dict[str, Any], scene: Any, record: dict[str, Any], features: Any) -> None:
    """Draws what --plot and --sheet ask for."""
    import numpy as np

    from ...reports._picked import picked  # no source: it draws what was chosen
    from ...selectors._covering import compared  # no source: it looks at what was chosen

    title = f"{scene.name}: {record['count']:,} of {record['n_views']:,} views by {record['selector']}"
    similar = compared(scene, record["parameters"], features)
    choice = picked(scene, title, np.asarray(record["indices"]), similar, given["auto"])
    if given["plot"]:
        from ...reports._selection_plot import plot  # no source: likewise

        plot(given["plot"], choice)
    if given["sheet"]:
        from ...reports import _contact_sheet  # no source: likewise

        for line in _contact_sheet.draw(given["sheet"], choice, _options.progress("sheet")):
            click.echo(f"viewbench: {line}", err=True)
