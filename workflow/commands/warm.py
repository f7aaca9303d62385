"""Compile a backend's kernels once, before several jobs start on them."""

import click


@click.command()
@click.option("--backend", default="splat", show_default=True, help="Trainer to prepare.")
def command(backend: str) -> None:
    """Compile and cache whatever BACKEND compiles; backends that compile nothing return at once."""
    from ...backends import _registry
    from ...common import settings as settings_file

    warm = getattr(_registry.load(backend, settings_file.load()), "warm", None)
    if warm is not None:
        warm()
