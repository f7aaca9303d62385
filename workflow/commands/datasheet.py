"""Describe a data set to its readers: a table of its captures, maps, example views."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from ...common.settings import Settings
    from ...reports._datasheet import Capture


@click.command()
@click.argument("scenes", nargs=-1, required=True)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for the table, maps and views.")
def command(scenes: tuple[str, ...], out: Path) -> None:
    """Write a datasheet of SCENES: captures by name or folder, whose unit is taken to be the metre.

    captures.md, .csv and .tex have a row a capture (frames, seconds, metres walked, percentiles of speed and turn rate,
    how much of the test views training views see), maps.jpg the ways from above, views.jpg what they see.
    """
    from ...common import extras
    from ...common import settings as settings_file

    extras.need("matplotlib", use="a datasheet needs", extra="plot")
    from ...reports import _datasheet, _tables

    settings = settings_file.load()
    captures = [_capture(name, settings) for name in scenes]
    out.mkdir(parents=True, exist_ok=True)
    table = _datasheet.table(captures)
    keys = _keys(table)
    plain = [[entry.text if entry.value is None else entry.value for entry in row] for row in table.rows]
    records = [dict(zip(keys, values, strict=True)) for values in plain]
    _tables.save(table, out, "captures", records)
    _datasheet.maps(captures, out)
    _datasheet.views(captures, out)
    click.echo(_tables.markdown(table), nl=False)


def _keys(table) -> list[str]:
    """Names of columns for programs."""
    return [column.replace(" (m)", "_m").replace(" (m/s)", "").replace(" (deg/s)", "") for column in table.columns]


def _capture(name: str, settings: "Settings") -> "Capture":
    from ...reports._datasheet import Capture
    from ...scenes.load import open_scene
    from ...scenes.seen import shares_of

    scene = open_scene(name, settings)
    seen = shares_of(scene.root, scene.test.names) or ()
    entry = settings.entry(name)
    title = name if entry else scene.name
    return Capture(title, settings.room_of(name) if entry else "", settings.walk_of(name), scene, tuple(seen))
