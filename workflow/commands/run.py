"""Run a study anywhere: the workflow that ships with viewbench, in a folder of yours."""

import json
import os
import shlex
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import click

NEEDED = ("snakemake", "jsonschema", "yaml", "numba", "skimage", "matplotlib", "jinja2", "mlflow")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
COMMAND = "VIEWBENCH_COMMAND"  # workflow/_progress_file.py
CATALOGUE = "VIEWBENCH_CATALOGUE"  # common/catalogue.py
# Settings that name what is read; what is written (results/...) belongs to the folder of the study.
READ = {
    "VIEWBENCH_DATA": ("data", "root"),
    "VIEWBENCH_ROOMS_PYTHON": ("rooms", "python"),
    "VIEWBENCH_METRICS_LPIPS_WEIGHTS": ("metrics", "lpips_weights"),
    "VIEWBENCH_INSTANT_NGP_PATH": ("instant_ngp", "path"),
    "VIEWBENCH_INSTANT_NGP_PYTHON": ("instant_ngp", "python"),
}


@click.command()
@click.argument("study")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=".", help="Folder to run in.")
@click.option("-j", "--jobs", type=click.IntRange(min=1), help="Jobs at once; one for each processor without it.")
@click.option("--verify", is_flag=True, help="Read every model and render again, to find what was altered since.")
@click.argument("options", nargs=-1, metavar="[-- OPTIONS OF SNAKEMAKE]")
@click.pass_context
def command(
    context: click.Context, study: str, out: Path, jobs: int | None, verify: bool, options: tuple[str, ...]
) -> None:
    """Run STUDY, the name of one that ships or a file, and print where its page is.

    --out gets results/STUDY, as a clone does, with results/features and results/mlflow.db beside it; without it the
    study runs where you stand. The same command again runs what is missing or changed, and nothing else.

    Settings are those in force where you stand, whatever --out is: the file that VIEWBENCH_ENVIRONMENT names, or
    environment.toml here, or the one that ships. Relative paths of what is read count from here, those of what is
    written from --out.

    What stands behind -- goes to snakemake: viewbench run quick -- --dry-run
    """
    from ...common import extras
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...scenes.whereabouts import absence
    from .. import _alone, _study

    extras.need(*NEEDED, use="running a study needs", extra="study")
    settings = settings_file.load()
    loaded = _study.load(study, settings)
    name, absent = loaded.name, absence(loaded.scenes, settings, study=True)
    if absent:
        raise UserError(absent)
    _alone.refused(out / "results" / name, unlock="--unlock" in options)
    out.mkdir(parents=True, exist_ok=True)
    status = _wait(subprocess.Popen(arguments(study, out, jobs, options, verify), env=environment(settings)))
    page = out / "results" / name / "reports" / "index.html"
    if status == 0 and page.is_file():
        click.echo(page)
    context.exit(status)


def arguments(
    study: str, out: Path, jobs: int | None, options: tuple[str, ...] = (), verify: bool = False
) -> list[str]:
    """The command line that runs the study in the folder `out`."""
    from ...common.settings import PACKAGE

    given = str(Path(study).absolute()) if study.endswith((".yaml", ".yml")) else study
    profile = PACKAGE / "workflow" / "profiles" / "default"
    command = [sys.executable, "-m", "snakemake", "--snakefile", PACKAGE / "Snakefile", "--workflow-profile", profile]
    command += ["--directory", out, "--cores", jobs or "all"]
    # Of several --config the last counts alone, and values are YAML, in which a path may hold " #" or ": ".
    config = ["--config", f"study={json.dumps(given)}", *(["verify=true"] if verify else [])]
    if "--config" in options:
        at = options.index("--config") + 1
        options = (*options[:at], *config[1:], *options[at:])
        config = []
    return [str(part) for part in (*command, *options, *config)]


def environment(settings: Any) -> dict[str, str]:
    """Variables for Snakemake and its jobs, which run in another folder: these settings, this `viewbench`.

    One thread a job as `compute.threads` says, unless the caller has set otherwise.
    """
    from ...common.settings import at_home

    found = dict(os.environ)
    # Where pip puts `viewbench`: beside Python, or with --user in a folder of the user's.
    user = sysconfig.get_preferred_scheme("user")
    scripts = [str(Path(sys.executable).parent), sysconfig.get_path("scripts", user)]
    found["PATH"] = os.pathsep.join([*scripts, found.get("PATH", os.defpath)])
    found["VIEWBENCH_ENVIRONMENT"] = str(settings.source.absolute())
    found[COMMAND] = shlex.join(["viewbench", *sys.argv[1:]]) + f"\n{Path.cwd()}"  # for `viewbench status` to say
    if CATALOGUE in found:
        found[CATALOGUE] = str(Path(found[CATALOGUE]).absolute())
    for variable, (section, key) in READ.items():
        value = getattr(getattr(settings, section), key)
        path = at_home(value)
        if value and not path.is_absolute() and path.exists():
            found[variable] = str(path.absolute())
    return dict.fromkeys(THREADS, str(settings.compute.threads)) | found


def _wait(process: subprocess.Popen) -> int:
    """Exit status of Snakemake, 130 when it was interrupted; it ends its jobs before it ends."""
    interrupted = False

    def interrupt(number: int, frame: object) -> None:
        nonlocal interrupted
        interrupted = True
        if not os.isatty(0):  # from a terminal Ctrl-C has reached Snakemake too
            process.send_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, lambda *_: process.send_signal(signal.SIGTERM))
    status = process.wait()
    if interrupted:
        raise KeyboardInterrupt
    return status if status >= 0 else 128 - status
