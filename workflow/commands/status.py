"""Say how far a study is: cells done, running, failed and why, and the time that is left."""

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from .._progress_file import Run
    from .._standing import Standing
    from .._study import Study

DONE, FAILED, UNFINISHED = 0, 1, 3  # exit statuses
SHOWN = 20  # cells of a kind


@click.command()
@click.argument("study", default="quick")
@click.option("--results", type=click.Path(path_type=Path), default="results", show_default=True)
@click.option("--all", "everything", is_flag=True, help=f"List all cells that run or failed, not {SHOWN} at most.")
@click.option("--json", "as_json", is_flag=True, help="The same as JSON, with every cell.")
@click.pass_context
def command(context: click.Context, study: str, results: Path, everything: bool, as_json: bool) -> None:
    """Say how far STUDY is, while it runs or afterwards; nothing is changed.

    A cell counts as done when its files fit to what the study, the settings, the data and the code are now. Exit
    status: 0 when all cells are done, 1 when something failed, 3 when some are still to be done and none failed.
    """
    from ...common import settings as settings_file
    from ...common.errors import printable
    from .. import _progress_file, _standing, _study

    settings = settings_file.load()
    checked = _study.load(study, settings)
    folder = results / checked.name
    if not folder.is_dir() and (results / "results" / checked.name).is_dir():
        folder = results / "results" / checked.name  # what `viewbench run --out DIR` was given
    run = _progress_file.read(folder)
    cells = _standing.standing(checked, folder, settings, run)
    counts = _standing.counts(cells)
    others = _standing.beside(checked, run)
    if as_json:
        record = _record(checked, run, cells, counts, _left(run))
        click.echo(json.dumps({**record, "failed_beside": [asdict(job) for job in others]}, indent=1))
    else:
        lines = _lines(checked, folder, study, run, cells, counts, None if everything else SHOWN)
        lines += [f"failed: {job.rule}: {job.words or 'it left no word'} ({job.log})" for job in others]
        click.echo("\n".join(map(printable, lines)))
    unfinished = len(cells) - counts["done"]
    context.exit(FAILED if counts["failed"] or others else UNFINISHED if unfinished else DONE)


def _left(run: "Run | None") -> float | None:
    """Seconds that the run has still to go, where one is at it and can say."""
    if run is None or not run.alive or run.seconds_left is None:
        return None
    return max(0.0, run.seconds_left - (time.time() - run.said))


def _lines(
    study: "Study",
    folder: Path,
    given: str,
    run: "Run | None",
    cells: "list[Standing]",
    counts: dict[str, int],
    most: int | None,
) -> list[str]:
    from .._standing import work_left

    parts = [f"{counts['done']} of {len(cells)} cells done"]
    parts += [f"{count} {state}" for state, count in counts.items() if count and state != "done"]
    left = _left(run)
    lines = [f"{study.name}: {', '.join(parts)}" + ("" if left is None else f"; about {_spoken(left)} left")]
    page = folder / "reports" / "index.html"
    if run is not None and run.alive:
        at = time.strftime("%H:%M", time.localtime(run.began))
        lines.append(f"running since {at} (process {run.pid} on {run.host}): {run.doing}")
        if run.scheduler:
            lines.append(f"jobs that {run.scheduler} was given are counted as running; some may wait in its queue")
    elif counts["done"] < len(cells):
        lines.append(_stopped(folder, given, run))
        work = work_left(cells)
        if work is not None and work >= 60:
            lines.append(f"about {_spoken(work)} of training and scoring are left for one job at a time")
    elif page.is_file():
        lines.append(f"the page: {page}")
    for state in ("running", "failed", "stale"):
        of_state = [cell for cell in cells if cell.state == state]
        for cell in of_state[:most]:
            ago = "" if cell.since is None else f" for {_spoken(time.time() - cell.since)}"
            lines.append(f"{state}: {cell.cell}: {cell.words}{ago}" + (f" ({cell.log})" if cell.log else ""))
        if most is not None and len(of_state) > most:
            lines.append(f"{state}: {len(of_state) - most} more; --all lists them")
    return lines


def _stopped(folder: Path, given: str, run: "Run | None") -> str:
    if run is None:
        nothing = "" if folder.is_dir() else f"there is no '{folder}' here (--results names the folder that it is in); "
        return f"nothing runs; {nothing}it begins by: snakemake -j2 --config study={given} -- reports"
    at = time.strftime("%Y-%m-%d %H:%M", time.localtime(run.said))
    how = f"has {run.ended}" if run.ended in ("finished", "failed") else "was stopped" if run.ended else "was killed"
    where = f", in {run.folder}" if run.folder and Path(run.folder) != Path.cwd() else ""
    return f"nothing runs: the last run {how}, {at}; the same command goes on from here: {run.command}{where}"


def _spoken(seconds: float) -> str:
    """`3 s`, `2 min 41 s`, `5 h 3 min`."""
    minutes, rest = divmod(max(0, round(seconds)), 60)
    if minutes >= 60:
        return f"{minutes // 60} h {minutes % 60} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _record(
    study: "Study", run: "Run | None", cells: "list[Standing]", counts: dict[str, int], left: float | None
) -> dict[str, Any]:
    about = None
    if run is not None:
        about = {key: getattr(run, key) for key in ("alive", "pid", "host", "began", "said", "ended", "doing")}
    return {
        "schema": 1,
        "study": study.name,
        "counts": counts,
        "seconds_left": left,
        "run": about,
        "cells": [asdict(cell) for cell in cells],
    }
