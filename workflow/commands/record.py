"""Keep a study's results as recorded ones, to be shown beside fresh ones."""

from pathlib import Path

import click

FIGURES = ("psnr_over_ratio", "over_rooms")  # of those that the study has
VERSIONS = ("viewbench", "numpy", "numba", "torch")  # of those that are installed


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--name", help="Name of the recording; the study's without it.")
@click.option("--into", type=click.Path(path_type=Path), help="Folder of the recordings; a clone's reports/recorded.")
@click.option("--command", "commands", multiple=True, help="Command that made the results; repeatable.")
@click.option("--note", default="", help="What a reader must know.")
def command(folder: Path, name: str | None, into: Path | None, commands: tuple[str, ...], note: str) -> None:
    """Copy results.csv and the main figures of the study in FOLDER, with machine and versions, into the recordings."""
    import importlib.util
    import shutil
    from importlib import metadata

    from ...common.errors import UserError
    from ...common.files import read_json, whole_folder, write_json
    from ...common.provenance import now
    from ...common.settings import PACKAGE

    clone = (PACKAGE / "pyproject.toml").is_file()
    if into is None and not clone:
        raise UserError("viewbench is installed here as a package, which keeps no recordings; name a folder by --into")
    study = read_json(folder / "study.json", "study")
    trained = sorted(folder.glob("cells/*/*/*/*/*/train.json"))
    if not trained or not (folder / "results.csv").is_file():
        raise UserError(f"'{folder}' has no finished cells; give the folder of a study, such as results/quick")
    records = [read_json(path, "training record") for path in trained]
    machines = {tuple(sorted(record["machine"].items())) for record in records}
    made_by = f"snakemake -j2 --config study={study['name']} -- reports" if clone else f"viewbench run {study['name']}"
    about = {
        "title": study["title"],
        "date": max(record.get("began") or "" for record in records) or now(),
        "machine": dict(machines.pop()) if len(machines) == 1 else {"several": len(machines)},
        "versions": {name: metadata.version(name) for name in VERSIONS if importlib.util.find_spec(name)},
        "backends": sorted({f"{record['backend']} {record['version']}" for record in records}),
        "commands": list(commands) or [made_by],
        "notes": note,
    }
    target = (into or PACKAGE / "reports" / "recorded") / (name or study["name"])
    with whole_folder(target) as temporary:
        shutil.copyfile(folder / "results.csv", temporary / "results.csv")
        for figure in (folder / "reports" / f"{name}.png" for name in FIGURES):
            if figure.is_file():
                shutil.copyfile(figure, temporary / figure.name)
        write_json(temporary / "about.json", about)
    click.echo(target)
