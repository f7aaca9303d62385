"""Options that several commands share, and the way they show progress."""

import functools
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...common.errors import UserError, printable

if TYPE_CHECKING:
    import numpy as np

    from ...common.settings import Settings
    from ...scenes.thinning import Thinning
    from ...scenes.types import Scene

encoder_option = click.option("--encoder", metavar="NAME", help="Image encoder (viewbench list encoders).")
count_rule_option = click.option(
    "--count-rule",
    type=click.Choice(["round", "floor"]),
    default="round",
    help="How a ratio becomes a number of views; floor is the paper's authors'.",
)
out_option = click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder to write.")
threads_option = click.option(
    "--threads",
    type=click.IntRange(min=1),
    help="Threads that one model takes; the numbers are the same for any. Else `compute.threads`, which is 1.",
)


def links_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options --copy and --relative, of how images come into what is written; handed over as `links`, one of
    `subset.LINKS`. Raises UserError for both."""

    @functools.wraps(command)
    def wrapped(copy: bool, relative: bool, **given: Any) -> None:
        if copy and relative:
            raise UserError("give either --copy or --relative: what is copied is not linked")
        command(links="copy" if copy else "relative" if relative else "absolute", **given)

    copied = click.option("--copy", is_flag=True, help="Copy images instead of linking them.")
    related = click.option("--relative", is_flag=True, help="Link by relative paths, to move with the capture.")
    return copied(related(wrapped))


def with_threads(settings: "Settings", threads: int | None) -> "Settings":
    """The settings, with so many threads for this command where any are named."""
    return settings if threads is None else replace(settings, compute=replace(settings.compute, threads=threads))


@dataclass(frozen=True)
class Capture:
    """A scene as it was named on the command line."""

    name: str
    format: str | None
    holdout: str | None
    allow_outside: bool
    model: int | None = None
    poses: str | None = None
    intrinsics: str | None = None
    times: str | None = None
    stride: int = 1
    fps: float | None = None

    @property
    def thinning(self) -> "Thinning":
        """What --stride and --fps say. Raises UserError for numbers that mean nothing."""
        from ...scenes.thinning import Thinning

        return Thinning(self.stride, self.fps)

    def open(self, settings: "Settings", notes: bool = True, pictures: bool = True) -> "Scene":
        """The scene; what its reader dropped or assumed is said on stderr unless `notes` is False.

        `pictures` False leaves a video's frames undecoded: what is said of it needs none.
        """
        from ...scenes.load import open_scene

        options: dict[str, Any] = {"format": self.format, "holdout": self.holdout, "allow_outside": self.allow_outside}
        options |= {"model": self.model, "poses": self.poses, "intrinsics": self.intrinsics, "times": self.times}
        options["video"] = {
            "thinning": self.thinning,
            "progress": progress("frames"),
            "extract": pictures,
        }
        self._check_settings(settings)
        scene = open_scene(self.name, settings, **options)
        for note in scene.notes if notes else ():
            print(printable(f"viewbench: {scene.name}: {note}"), file=sys.stderr)
        return scene

    def _check_settings(self, settings: "Settings") -> None:
        """Raises UserError where the settings of the current folder are part of the capture: whoever made that could
        name programs in them that are run, and folders that are written to. A single file brings none along."""
        from ...common.settings import FILE, NAMED, PACKAGE
        from ...scenes.load import is_there

        named = os.environ.get(NAMED) or str(settings.source) != FILE
        if named or not is_there(self.name) or Path(FILE).resolve() == PACKAGE / FILE:
            return
        folder = Path(self.name)
        if folder.is_dir() and Path.cwd().resolve().is_relative_to(folder.resolve()):
            raise UserError(
                f"'{FILE}' in the current folder lies in the capture and may have come with it; call viewbench from "
                f"another folder, or set {NAMED}={FILE} if it is yours"
            )


SCENE = (
    click.argument("scene"),
    click.option("--format", "format_", metavar="NAME", help="Force a reader (viewbench list formats)."),
    click.option("--holdout", metavar="RULE", help="Test split where the capture has none: every:8, blocks:8 or none."),
    click.option("--allow-outside", is_flag=True, help="Let transforms name images outside the folder."),
    click.option(
        "--model",
        "number",
        type=click.IntRange(min=0),
        help="Number of one of several COLMAP models; else the largest.",
    ),
    click.option("--poses", metavar="FILE", help="Trajectory of a folder of images: rows of TUM or KITTI."),
    click.option("--intrinsics", metavar="FX,FY,CX,CY", help="And their camera; k1,k2,p1,p2[,k3] may follow."),
    click.option("--times", metavar="FILE", help="And when they were taken, where their names do not say."),
)


def scene_options(command: Callable[..., None]) -> Callable[..., None]:
    """Argument SCENE and what goes with it, handed to the command as one `Capture` called `scene`."""

    @functools.wraps(command)
    def wrapped(
        scene: str, format_: str | None, holdout: str | None, allow_outside: bool, number: int | None, **given: Any
    ) -> None:
        posed = {key: given.pop(key) for key in ("poses", "intrinsics", "times")}
        command(scene=Capture(scene, format_, holdout, allow_outside, number, **posed), **given)

    for option in reversed(SCENE):
        wrapped = option(wrapped)
    return wrapped


def thinning_options(command: Callable[..., None]) -> Callable[..., None]:
    """Options --stride and --fps; stands below `scene_options`, whose `scene` they become a part of."""

    @functools.wraps(command)
    def wrapped(scene: Capture, stride: int, fps: float | None, **given: Any) -> None:
        command(scene=replace(scene, stride=stride, fps=fps), **given)

    for option in (
        click.option("--fps", type=float, metavar="F", help="Look at no more than F frames a second."),
        click.option("--stride", type=int, default=1, metavar="N", help="Look at every N-th frame only."),
    ):
        wrapped = option(wrapped)
    return wrapped


def looked_at(capture: Capture, scene: "Scene") -> "np.ndarray | None":
    """(N,) bool, the training views that --stride or --fps leave; None for all, as of a video, which was read so."""
    if scene.format == "video" or not capture.thinning:
        return None
    from ...scenes.thinning import candidates

    return candidates(scene.train, capture.stride, capture.fps)


def refuse_thinning(capture: Capture, scene: "Scene") -> None:
    """Raises UserError for --stride and --fps with a capture whose frames are all looked at by this command."""
    if scene.format != "video" and capture.thinning:
        raise UserError(f"--stride and --fps thin a video here, and '{capture.name}' is in format {scene.format}")


def settings_of(values: tuple[str, ...]) -> dict[str, Any]:
    """`("sigma=0.4", "factors=pos,ang")` as a dictionary of numbers, lists and texts.

    Raises UserError for an item without a key or an equals sign.
    """
    result: dict[str, Any] = {}
    for item in values:
        key, sign, text = item.partition("=")
        if not sign or not key.strip():
            raise UserError(f"--set takes KEY=VALUE, got '{item}'")
        result[key.strip()] = _value(text.strip())
    return result


def _value(text: str) -> Any:
    if "," in text:
        return [_value(part.strip()) for part in text.split(",") if part.strip()]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text.lower(), text)


def progress(what: str) -> Callable[[int, int | None, str], None]:
    """Shows progress on stderr: a bar on a terminal, a plain line every tenth otherwise."""
    if sys.stderr.isatty():
        return _bar(what)
    shown = -1

    def line(done: int, total: int | None, text: str = "") -> None:
        nonlocal shown
        tenth = 10 * done // total if total else done // 500
        if tenth > shown:
            shown = tenth
            print(f"{what}: {done}{f' of {total}' if total else ''} {text}".rstrip(), file=sys.stderr, flush=True)

    return line


def _bar(what: str) -> Callable[[int, int | None, str], None]:
    from tqdm import tqdm

    bar: tqdm | None = None

    def update(done: int, total: int | None, text: str = "") -> None:
        nonlocal bar
        if bar is None:
            bar = tqdm(total=total, desc=what, file=sys.stderr, leave=False)
        bar.set_postfix_str(text, refresh=False)
        bar.update(done - bar.n)
        if total is not None and done >= total:
            bar.close()

    return update
