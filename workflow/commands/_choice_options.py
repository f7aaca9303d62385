"""Options that say how views are compared, which several commands share, and what those options stand for."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ...common.errors import UserError, nearest
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
# Uncovered distance of --auto where none is named. Of the dense captures room_human, room_smooth and hololens_space it
# takes 16 to 23 %, about the largest share that the paper studies; half of it takes 24 to 33 %, and of the sparse
# diorama_room all. With the paper's weights it is a step of 3.5 % of the capture's extent, if nothing else changes.
DISTANCE = 0.1
NAMED = ("alpha", "beta", "sigma", "start", "sharpness")


def comparison_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of COMPARISON, handed to the command under their own names."""
    for option in reversed(COMPARISON):
        command = option(command)
    return command


class AutoCommand(click.Command):
    """A command whose --auto may stand without a number, whatever stands behind it."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        end = args.index("--") if "--" in args else len(args)
        for i in range(end):
            if args[i] == "--auto" and not (i + 1 < end and _is_number(args[i + 1])):
                args[i] = f"--auto={DISTANCE}"
        return super().parse_args(ctx, args)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


auto_option = click.option(
    "--auto",
    type=float,
    metavar="[D]",
    help="Instead of both: as few views as leave none farther than D from a chosen one, D = 1 - similarity in (0, 1); "
    f"without a number {DISTANCE}. `viewbench redundancy` has the count for every D.",
)


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

    cache = _cache(settings)
    progress = _options.progress("features")
    return features(scene.train, encoder, cache, settings.features.batch, progress, settings.compute.device, scene.root)


def sharpness_of(scene: Any, settings: Any) -> Any:
    """How sharp each training image is, measured once and kept."""
    from ...scenes.sharpness import sharpness

    return sharpness(scene.train, _cache(settings), _options.progress("sharpness"))


def _cache(settings: Any) -> Path:
    """Folder of cached features: the setting's or, where that would begin a results/ in a folder that has none, the
    user's."""
    from ...common.files import user_cache

    path = Path(settings.features.cache)
    if path.is_absolute() or Path(path.parts[0]).is_dir():
        return path
    try:
        return user_cache("features")
    except RuntimeError:  # nobody's home
        return path


def check_file(option: str, path: Path | None, kinds: tuple[str, ...] = ()) -> None:
    """Raises UserError for a file that cannot be written there, before the work that would fill it: another ending
    than one of `kinds`, a folder of that name, a folder above it that is none or is read-only."""
    if path is None:
        return
    if kinds and path.suffix.lower() not in kinds:
        hint = nearest(path.suffix.lower(), kinds)
        raise UserError(f"{option} '{path}': expected a file ending in {' or '.join(kinds)}{hint}")
    if path.is_dir():
        raise UserError(f"{option} '{path}' is a folder; name a file in it")
    check_folder(option, path.absolute().parent)


def check_folder(option: str, folder: Path) -> None:
    """Raises UserError for a folder that can neither be written to nor be made."""
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir():
        raise UserError(f"{option}: '{there}' is a file, so nothing can be written below it; name another place")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UserError(f"{option}: folder '{there}' cannot be written to; name another place")
