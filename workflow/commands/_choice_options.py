"""Options that say how views are compared, which several commands share, and what those options stand for."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from . import _options

COMPARISON = (
    click.option("--alpha", type=float, help="Weight of the position factor; 0.7."),
    click.option("--beta", type=float, help="Weight of the rotation factor; 0.2. The semantic one gets the rest."),
    click.option("--sigma", type=float, help="Width of the position factor, positions scaled to [-4, 4]; 0.5."),
    click.option("--factors", help="Factors to use, of pos,ang,sem."),
    click.option("--start", type=click.Choice(["random", "medoid"]), help="First view of maxmin and kcenter."),
    click.option("--sharpness", type=float, metavar="W", help="How much blurred frames lose; 0 ignores blur."),
    click.option("--features", type=click.Path(path_type=Path), help="Your own N x D features (.npy)."),
    _options.encoder_option,
)
NAMED = ("alpha", "beta", "sigma", "start", "sharpness")


def comparison_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of COMPARISON, handed to the command under their own names."""
    for option in reversed(COMPARISON):
        command = option(command)
    return command


def parameters_of(given: dict[str, Any]) -> dict[str, Any]:
    """Parameters of a selector from the options that were given; those left out keep the selector's default."""
    parameters = {key: given[key] for key in NAMED if given[key] is not None}
    if given["factors"] is not None:
        parameters["factors"] = [part.strip() for part in given["factors"].split(",") if part.strip()]
    return parameters


def features_of(scene: Any, selector: str, given: dict[str, Any], parameters: dict[str, Any], settings: Any) -> Any:
    """The features that the selector needs: the user's own, the cached ones, or None without the semantic factor."""
    from ...common import plugins

    if given["features"] is not None:
        from ...scenes.features import load_user_features

        return load_user_features(given["features"], len(scene.train))
    plugins.load("selectors", selector)
    factors = parameters.get("factors", plugins.constant("selectors", selector, "FACTORS", ()))
    encoder = given["encoder"] or settings.features.encoder
    if "sem" not in tuple(factors) or encoder == "none":
        return None
    from ...scenes.features import features

    cache = Path(settings.features.cache)
    progress = _options.progress("features")
    return features(scene.train, encoder, cache, settings.features.batch, progress, settings.compute.device)


def sharpness_of(scene: Any, settings: Any) -> Any:
    """How sharp each training image is, measured once and kept."""
    from ...scenes.sharpness import sharpness

    return sharpness(scene.train, Path(settings.features.cache), _options.progress("sharpness"))
