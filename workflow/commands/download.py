"""Download scenes of the field's data sets, by name."""

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from . import _options

if TYPE_CHECKING:
    from ...common.catalogue import DataSet, Listed
    from ...scenes.download.bring import Progress


@click.command()
@click.argument("names", nargs=-1, metavar="DATASET[/SCENE]...")
@click.option("--to", "folder", type=click.Path(path_type=Path, file_okay=False), help="Folder of captures; data.root.")
@click.option("--list", "listing", is_flag=True, help="Print the data sets (of NAMES, if any) and stop.")
@click.option(
    "--accept-licence", "--accept-license", is_flag=True, help="Accept the licences that are printed; for scripts."
)
@click.option("--force", is_flag=True, help="Fetch again what is there.")
def command(names: tuple[str, ...], folder: Path | None, listing: bool, accept_licence: bool, force: bool) -> None:
    """Download scenes by name, such as mipnerf360/room, or all scenes of a data set; print where they are.

    Of an archive with many scenes only the wanted one is fetched where the server can give a part. What is there is
    left alone, and a call that was stopped is gone on with by the same command.
    """
    from ...common import catalogue
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...scenes.download.bring import Place, bring
    from ...scenes.download.receipt import is_there

    settings = settings_file.load()
    root = folder or (settings_file.at_home(settings.data.root) if settings.data.root else None)
    if listing:
        _list(names, root)
        return
    if not names:
        raise UserError(
            "name a scene, such as mipnerf360/room, or a data set; `viewbench download --list` has them all"
        )
    scenes = list({scene.name: scene for name in names for scene in catalogue.expand(name)}.values())
    if root is None:
        raise UserError("there is no folder of captures yet; give --to FOLDER, or set VIEWBENCH_DATA or data.root")
    known = catalogue.read()
    missing = [scene for scene in scenes if force or not is_there(scene, known[scene.dataset], root)]
    for scene in scenes:
        if scene not in missing:
            click.echo(f"viewbench: {scene.name} is there already", err=True)
    for dataset in dict.fromkeys(scene.dataset for scene in missing):
        _consent(known[dataset], [scene for scene in missing if scene.dataset == dataset], accept_licence)
    place = Place(root, lambda text: click.echo(f"viewbench: {text}", err=True), _progress())
    try:
        for scene in scenes:
            if scene in missing:
                bring(scene, known[scene.dataset], place, force)
            click.echo(root / scene.path)
    except KeyboardInterrupt:
        click.echo("\nviewbench: what came is kept; the same command goes on from there", err=True)
        raise
    named = scenes[0].name if folder is None else shlex.quote(str(root / scenes[0].path))
    click.echo(f"viewbench: next: viewbench select {named} --ratio 0.1 --out {scenes[0].scene}_tenth", err=True)


def _consent(data: "DataSet", scenes: "list[Listed]", accepted: bool) -> None:
    """Prints what is fetched and its licence, and asks. Raises UserError where nobody can answer."""
    from ...common.errors import UserError

    size = data.size if len(scenes) == len(data.scenes) else ", ".join(dict.fromkeys(scene.size for scene in scenes))
    count = f"{len(scenes)} scenes of " if len(scenes) > 1 else ""
    licence = data.licence
    click.echo(f"viewbench: {count}{data.title} ({data.home}): {size}", err=True)
    click.echo(f"viewbench: licence: {licence.name}: {licence.says} ({licence.address})", err=True)
    click.echo(f"viewbench: to cite: {data.citation}", err=True)
    if accepted:
        return
    if sys.stdin is None or not sys.stdin.isatty():
        raise UserError(
            f"the licence of {data.title} is to be accepted: read {licence.address}, and give --accept-licence"
        )
    if not click.confirm("viewbench: do you accept the licence?", err=True):
        raise UserError("not accepted, nothing was downloaded")


def _list(names: tuple[str, ...], root: Path | None) -> None:
    """One line a data set and one a scene, for the data sets that are named or for all."""
    from ...common import catalogue

    known = catalogue.read()
    chosen = {name.split("/")[0] for name in names} or set(known)
    for name in sorted(chosen - set(known)):
        catalogue.expand(name)  # says what is wrong with it
    for data in known.values():
        if data.name not in chosen:
            continue
        size = data.size if data.scenes else "on request"
        click.echo(f"{data.name}: {data.title}, {size}, {data.licence.name} ({data.licence.address})")
        click.echo(f"  {data.home}")
        width = max((len(scene.name) for scene in data.scenes.values()), default=0)
        for scene in data.scenes.values():
            here = " [here]" if root is not None and (root / scene.path).exists() else ""
            click.echo(f"  {scene.name:<{width}}  {scene.size}{here}")
        if not data.scenes:
            click.echo(f"  {data.by_hand} goes to data.root/{data.name}/SCENE")


def _progress() -> "Progress":
    """A line of progress a scene, in megabytes."""
    shown: dict[str, Callable[..., None]] = {}

    def update(done: int, total: int | None, text: str) -> None:
        unit = 1 if text.endswith(", files") else 1_000_000
        if text not in shown:
            shown[text] = _options.progress(text if unit == 1 else f"{text}, MB")
        units = None if total is None else -(-total // unit)
        shown[text](units if units is not None and done >= (total or 0) else done // unit, units)

    return update
