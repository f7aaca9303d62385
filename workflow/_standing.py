"""How far a study is: what has become of each cell, read without changing anything."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ..common.cells import RECORDS, cell_folder, cell_name, read_records
from ..common.errors import UserError
from ..common.settings import Settings
from ._heal import damage
from ._progress_file import Job, Run
from ._stale import Asked
from ._study import Study

STATES = ("done", "running", "failed", "stale", "to come")


@dataclass(frozen=True)
class Standing:
    """One cell: one of STATES, and why."""

    cell: str  # BACKEND/SCENE/SELECTOR/RATIO/SEED
    state: str
    words: str = ""  # last line of the log of what failed, or what is stale; the step of what runs
    log: str = ""
    since: float | None = None  # seconds since 1970, of what runs
    seconds: float | None = None  # of training and scoring, of what is done


def standing(study: Study, results: Path, settings: Settings, run: Run | None) -> list[Standing]:
    """Every cell of the study, in the order of the grid; `results` is results/STUDY.

    A cell is done when its files fit together and to what the study, the settings, the data and the code are now, as
    `collect` would have it, and model and renders are there and as long as they were; "stale" when not, and nothing is
    at it.
    """
    asked = Asked(study, results, settings)
    running = run.running if run is not None and run.alive else ()
    failed = run.failed if run is not None else ()
    return [_of(cell, study, results, asked, running, failed) for cell in study.cells()]


def beside(study: Study, run: Run | None) -> list[Job]:
    """Jobs of the run that failed and are no cell's: a report, the page, the log."""
    failed = run.failed if run is not None else ()
    return [job for job in failed if not any(job.of(cell, study) for cell in study.cells())]


def counts(cells: list[Standing]) -> dict[str, int]:
    """Cells by state."""
    found = Counter(cell.state for cell in cells)
    return {state: found[state] for state in STATES}


def work_left(cells: list[Standing]) -> float | None:
    """Seconds of training and scoring that are left for one job at a time, where cells of the same backend tell."""
    known: dict[str, list[float]] = {}
    for cell in cells:
        if cell.seconds is not None:
            known.setdefault(cell.cell.split("/")[0], []).append(cell.seconds)
    left = [cell.cell.split("/")[0] for cell in cells if cell.state != "done"]
    if not left or not all(backend in known for backend in left):
        return None
    return sum(sum(known[backend]) / len(known[backend]) for backend in left)


def _of(
    cell: dict[str, str], study: Study, results: Path, asked: Asked, running: tuple[Job, ...], failed: tuple[Job, ...]
) -> Standing:
    name, folder = cell_name(cell), cell_folder(results, cell)
    here = next((job for job in running if job.rule in ("train", "evaluate") and job.of(cell, study)), None)
    if here is not None:
        return Standing(name, "running", here.rule, here.log, here.since)
    lost = next((job for job in failed if job.of(cell, study)), None)
    if all((folder / file).is_file() for file in RECORDS):
        try:
            records = read_records(folder)
            asked.check(cell, folder, *records)
            seconds = records[1]["seconds"] + records[2]["seconds"]
            wrong = damage(folder)
        except UserError as error:
            wrong = _brief(str(error))
        except (KeyError, TypeError, AttributeError) as error:
            wrong = f"its files are not what viewbench writes ({type(error).__name__})"
        else:
            if not wrong:
                return Standing(name, "done", seconds=seconds)
        if lost is None:
            return Standing(name, "stale", wrong)
    if lost is not None:  # also where files of an earlier run are there: what was asked for now has failed
        return Standing(name, "failed", f"{lost.rule}: {lost.words or 'it left no word'}", lost.log)
    return Standing(name, "to come")


def _brief(text: str) -> str:
    """What `collect` says of a stale cell, without the cell and without what to do, which the next run does."""
    if text.startswith("cell '"):
        text = text.partition("' is stale: ")[2] or text.partition("': ")[2]
    return text.partition("; delete ")[0].partition("; make it again")[0]
