"""Log a study to MLflow."""

import contextlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from . import _options


@click.command()
@click.argument("study", required=False)
@click.option("--results", type=click.Path(path_type=Path), default="results", show_default=True)
@click.option("--only", type=click.Choice(["cells", "page"]), help="The cells and their summaries, or the page.")
@click.option("--follow", is_flag=True, help="Log cells as they are scored, until this is stopped (Ctrl-C).")
@click.option("--import", "recording", metavar="FOLDER", type=click.Path(path_type=Path), help="Log what is there.")
@click.option("--as", "name", metavar="NAME", help="Experiment that --import makes; else its name with what it is.")
@click.option("--stamp", type=click.Path(path_type=Path), help="File to write when done, for the workflow.")
@click.option("--of-run", is_flag=True, hidden=True, help="With --follow: cells that are stale come in by stdin.")
def command(
    study: str | None,
    results: Path,
    only: str | None,
    follow: bool,
    recording: Path | None,
    name: str | None,
    stamp: Path | None,
    of_run: bool,
) -> None:
    """Log the finished cells of STUDY, and its page: what is new or has changed; a cell never has two runs.

    The experiment shows the study as it is now: runs of what has changed are replaced (MLflow keeps them as deleted).
    With --import a folder is logged instead, into an experiment of its own: recorded results (about.json and
    results.csv), or results/STUDY of another machine.
    """
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...common.files import write_json
    from ...reports import _about, _tracking
    from .. import _study

    settings = settings_file.load()
    asked = settings.tracking
    if recording is not None:
        given = {"STUDY": study, "--only": only, "--follow": follow, "--stamp": stamp}
        others = [option for option, value in given.items() if value]
        if others:
            raise UserError(f"--import does not go with {others[0]}; --as NAME names the experiment")
        _import(recording, name, settings)
        return
    if name is not None:
        raise UserError("--as names what --import makes; an experiment has the name of its study")
    if study is None:
        raise UserError("name a study, or a folder with --import")
    checked = _study.load(study, settings)
    folder, cells = results / checked.name, checked.cells()
    about = _about.of_study(checked.record(), cells, _called(checked), settings.place_of)
    if not folder.is_dir():
        raise UserError(f"there is no folder '{folder}': run the study first, or name another one by --results")
    if follow:
        _follow(about, cells, folder, asked, of_run)
        return
    try:
        done: dict[str, Any] = {"skipped": _tracking.NO_TRACKING}
        if asked.uri:
            done = _given_up(folder) if only == "page" and stamp else {}
        if not done and only != "page":
            done |= _log(about, cells, folder, asked)
        if "skipped" not in done and only != "cells" and (only or (folder / "reports" / "index.html").is_file()):
            done |= _publish(about, folder, asked)
    except UserError as error:
        if stamp is None:
            raise
        # The study's results do not depend on the log: say what happened and go on.
        done = {"skipped": str(error)}
        _say(f"{error}; repeat with: viewbench track {study}")
    if stamp is not None:
        write_json(stamp, done)
    else:
        _tell(done)


def _called(study: Any) -> str:
    """What `viewbench run` is given to run it."""
    from .. import _study

    return study.name if study.source.parent == _study.STUDIES else study.source.name


def _log(about: Any, cells: list[dict[str, str]], folder: Path, tracking: Any) -> dict[str, Any]:
    """The cells that are sound, and where they are to be seen."""
    from ...reports import _tracked_link, _tracking
    from .. import _collect

    sound = _collect.without_stale(cells, folder)
    stale = [cell for cell in cells if cell not in sound]
    with _turn(about, folder, tracking):
        done = _tracking.track(about, sound, folder, tracking, _progress(), _say, stale)
    figure = _tracked_link.address(tracking.uri, str(done["experiment"]))
    return {**done, "store": _tracked_link.store(tracking.uri), "figure": figure}


def _publish(about: Any, folder: Path, tracking: Any) -> dict[str, str]:
    from ...reports import _tracking_page

    with _turn(about, folder, tracking):
        return _tracking_page.publish(about, folder, tracking)


def _given_up(folder: Path) -> dict[str, Any]:
    """Why the cells were not logged a moment ago: the page need not wait for the same."""
    from ...reports import _tracking_stamp

    told = _tracking_stamp.newest(folder)
    return {"skipped": told["skipped"]} if "skipped" in told else {}


def _turn(about: Any, folder: Path, tracking: Any) -> contextlib.AbstractContextManager[bool]:
    """While the body runs nobody else on this machine logs the study."""
    from ...reports import _tracking_turn

    return _tracking_turn.turn(tracking, about.name, folder, f"process {os.getpid()}")


def _import(recording: Path, name: str | None, settings: Any) -> None:
    from ...reports import _tracking_import

    _tell(_tracking_import.bring(recording, name, settings.tracking, _progress(), _say))


def _follow(about: Any, cells: list[dict[str, str]], folder: Path, tracking: Any, of_run: bool) -> None:
    """Until the run that started this process has ended, or the user stops it."""
    import time

    from ...common.errors import UserError
    from ...reports import _tracking_follow
    from .. import _tracker

    if not tracking.uri:
        raise UserError("tracking.uri is empty: there is nothing to log to")
    stale, stopped = _tracker.led() if of_run else ((), lambda wait_s: bool(time.sleep(wait_s)))
    progress = (lambda done, total, text: None) if of_run else _progress()
    follower = _tracking_follow.Follower(about, cells, folder, tracking, stale, _say, progress)
    _tracker.give_way()
    follower.go_on(stopped)


def _tell(done: dict[str, Any]) -> None:
    words = [f"{value} {key}" for key, value in done.items() if key in ("logged", "kept")]
    words += [str(done["skipped"])] if "skipped" in done else []
    words += ["the page"] if "run" in done else []
    click.echo(", ".join(words))
    if "figure" in done:
        click.echo(f"Figure 4 in MLflow: {done['figure']}")


def _progress() -> Callable[[int, int | None, str], None]:
    return _options.progress("track")


def _say(text: str) -> None:
    print(f"viewbench: {text}", file=sys.stderr, flush=True)
