"""List scenes, data sets, formats, selectors, encoders, backends, reports, studies or rooms."""

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from ...common.settings import SceneEntry, Settings

KINDS = ("scenes", "datasets", "formats", "selectors", "encoders", "backends", "reports", "studies", "rooms")


@click.command()
@click.argument("kind", type=click.Choice(KINDS))
def command(kind: str) -> None:
    """Print what there is of KIND, one line each, and why something is unavailable."""
    special = {
        "scenes": _scenes,
        "datasets": _datasets,
        "backends": _backends,
        "reports": _reports,
        "studies": _studies,
        "rooms": _rooms,
    }
    rows = special.get(kind, lambda: _plugins(kind))()
    width = max((len(name) for name, _ in rows), default=0)
    for name, text in rows:
        click.echo(f"{name:<{width}}  {text}".rstrip())


def _plugins(kind: str) -> list[tuple[str, str]]:
    from ...common import plugins

    package = {"formats": "scenes.formats", "encoders": "scenes.encoders"}.get(kind, kind)
    rows = []
    for name in plugins.names(package):
        reason = getattr(plugins.load(package, name), "available", lambda: None)()
        rows.append((name, plugins.summary(package, name) + (f" [unavailable: {reason}]" if reason else "")))
    return rows


def _reports() -> list[tuple[str, str]]:
    from ...common import extras, plugins

    reason = extras.missing("matplotlib", "jinja2")
    state = f" [unavailable: {reason}]" if reason else ""
    return [(name, plugins.summary("reports", name) + state) for name in plugins.names("reports")]


def _rooms() -> list[tuple[str, str]]:
    from ...common import plugins
    from ...scenes.rooms._rendering import available

    reason = available()
    state = f" [unavailable: {reason}]" if reason else ""
    return [(name, plugins.summary("scenes.rooms", name) + state) for name in plugins.names("scenes.rooms")]


def _scenes() -> list[tuple[str, str]]:
    from ...common import catalogue
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...scenes.load import open_scene

    settings = settings_file.load()
    rows = []
    entries = {**{name: entry for name in catalogue.names() if (entry := _here(name, settings))}, **settings.scenes}
    for name, entry in entries.items():
        try:
            scene = open_scene(name, settings)
            text = f"{len(scene.train)} training and {len(scene.test)} test views, {scene.format} ({entry.path})"
        except UserError as error:
            text = f"[unavailable: {error}]"
        rows.append((name, text))
    return rows


def _here(name: str, settings: "Settings") -> "SceneEntry | None":
    """What is known of a scene of the catalogue, where it is there and environment.toml has no name for it."""
    entry = settings.entry(name)
    folder = settings.folder_of(entry) if entry else None
    named = any(other.path == entry.path for other in settings.scenes.values()) if entry else True
    return entry if folder is not None and folder.exists() and not named else None


def _datasets() -> list[tuple[str, str]]:
    from ...common import catalogue

    rows = []
    for data in catalogue.read().values():
        scenes = (
            f"{len(data.scenes)} scenes, {data.size}" if data.scenes else "[unavailable: given by its authors only]"
        )
        rows.append((data.name, f"{data.title}: {scenes}, licence: {data.licence.name} ({data.home})"))
    return rows


def _backends() -> list[tuple[str, str]]:
    from ...backends import _registry
    from ...common import plugins
    from ...common import settings as settings_file

    settings = settings_file.load()
    rows = []
    for name in _registry.names(settings):
        about = plugins.summary("backends", name.split(":")[0])
        backend = _registry.load(name, settings)
        reason = backend.available()
        state = f"[unavailable: {reason}]" if reason else f"[{backend.version()}, {backend.CAPABILITIES.device}]"
        rows.append((name, f"{about} {state}"))
    return rows


def _studies() -> list[tuple[str, str]]:
    from ...common import extras
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from .. import _study

    settings = settings_file.load()
    reason = extras.missing("snakemake", "jsonschema", "yaml")
    if reason:
        return [(name, f"[unavailable: {reason}]") for name in _study.names()]
    rows = []
    for name in _study.names():
        try:
            study = _study.load(name, settings)
            rows.append((name, f"{study.title} ({len(study.cells())} cells)"))
        except UserError as error:
            rows.append((name, f"[unavailable: {error}]"))
    return rows
