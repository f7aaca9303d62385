"""Compile a backend's or a selector's kernels once, before several jobs start on them."""

import click


@click.command()
@click.option("--backend", help="Trainer to prepare; splat where no selector is named either.")
@click.option("--selector", help="Way of choosing to prepare.")
def command(backend: str | None, selector: str | None) -> None:
    """Compile and cache whatever BACKEND and SELECTOR compile; those that compile nothing return at once."""
    from ...backends import _registry
    from ...common import plugins
    from ...common import settings as settings_file

    prepared, settings = [], settings_file.load()
    if backend or not selector:
        trainer = _registry.load(backend or "splat", settings)
        _registry.hold_gpu(trainer, settings)
        prepared.append(trainer)
    if selector:
        prepared.append(plugins.load("selectors", selector))
    for plugin in prepared:
        warm = getattr(plugin, "warm", None)
        if warm is not None:
            warm()
