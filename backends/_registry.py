"""Backends by name: the modules of this folder, and `command:NAME` for programs that environment.toml describes."""

from types import ModuleType
from typing import Any

from ..common import gpu, plugins
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


def hold_gpu(backend: Any, settings: Settings) -> gpu.Lease | None:
    """Takes a device for a backend that needs one; comes before it is asked whether it is available.

    A program of its own takes one whatever is said of ours.
    """
    if backend.CAPABILITIES.device != "cuda":
        return None
    return gpu.hold("cuda" if settings.compute.device == "cpu" else settings.compute.device)


def configuration_of(backend: Any) -> dict[str, dict[str, Any]]:
    """Settings of the machine that the backend's models ("train") and its renders ("render") depend on."""
    return {"train": {}, "render": {}} | getattr(backend, "configuration", dict)()


def drawn_by(name: str, backend: Any) -> str:
    """What draws the models of the backend called `name` here: it does, where it says nothing else."""
    return getattr(backend, "drawn_by", lambda: name)()


def version_of(backend: Any) -> str | None:
    """The backend's version; None where what would tell it is not installed here."""
    try:
        return backend.version()
    except Exception:  # a package, a program or a checkout that is not there: each backend fails in its own way
        return None
