"""Backends by name: the modules of this folder, and `command:NAME` for programs that environment.toml describes."""

from types import ModuleType
from typing import Any

from ..common import plugins
from ..common.settings import Settings


def names(settings: Settings) -> list[str]:
    """Every backend that can be asked for; one of family "command" is named for each [command.NAME] section."""
    found = []
    for name in plugins.names("backends"):
        configured = [f"{name}:{entry}" for entry in settings.command] if name == "command" else []
        found += configured or [name]
    return found


def load(name: str, settings: Settings) -> ModuleType | Any:
    """The backend: a module, or what its `configured(argument, settings)` makes of the part behind the colon.

    Raises UserError for a name that is not there.
    """
    family, _, argument = name.partition(":")
    module = plugins.load("backends", family)
    configure = getattr(module, "configured", None)
    return configure(argument, settings) if configure else module
