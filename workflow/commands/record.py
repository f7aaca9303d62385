"""Keep a study's results as recorded ones, to be shown beside fresh ones."""

from pathlib import Path

import click


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--name", help="Name of the recording; the study's without it.")
@click.option("--into", type=click.Path(path_type=Path), help="Folder of the recordings; reports/recorded without it.")
@click.option("--command", "commands", multiple=True, help="Command that made the results; repeatable.")
@click.option("--note", default="", help="What a reader must know.")
def command(folder: Path, name: str | None, into: Path | None, commands: tuple[str, ...], note: str) -> None:
    """Copy results.csv and the main figure of the study in FOLDER, with machine and versions, into the recordings."""
    import shutil
    from importlib import metadata

    from ...common.errors import UserError
    from ...common.files import read_json, whole_folder, write_json
    from ...common.settings import PACKAGE

    study = read_json(folder / "study.json", "study")
    trained = sorted(folder.glob("cells/*/*/*/*/*/train.json"))
    if not trained or not (folder / "results.csv").is_file():
        raise UserError(f"'{folder}' has no finished cells; give the folder of a study, such as results/quick")
    records = [read_json(path, "training record") for path in trained]
    machines = {tuple(sorted(record["machine"].items())) for record in records}
    about = {
        "title": study["title"],
        "machine": dict(machines.pop()) if len(machines) == 1 else {"several": len(machines)},
        "versions": {package: metadata.version(package) for package in ("viewbench", "numpy", "numba", "torch")},
        "backends": sorted({f"{record['backend']} {record['version']}" for record in records}),
        "commands": list(commands) or [f"snakemake -j2 --config study={study['name']} -- reports"],
        "notes": note,
    }
    target = (into or PACKAGE / "reports" / "recorded") / (name or study["name"])
    with whole_folder(target) as temporary:
        shutil.copyfile(folder / "results.csv", temporary / "results.csv")
        figure = folder / "reports" / "psnr_over_ratio.png"
        if figure.is_file():
            shutil.copyfile(figure, temporary / figure.name)
        write_json(temporary / "about.json", about)
    click.echo(target)
