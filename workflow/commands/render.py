"""Render a generated room along a camera path, as a capture to choose views of."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...common.errors import UserError
from . import _options

if TYPE_CHECKING:
    from ...scenes.rooms._capture import Job
    from ...scenes.rooms._types import Room

ROOMS = "scenes.rooms"
FRAMES = {"test": 40}  # and 400 of any other path


def _shard(_: click.Context, __: click.Parameter, text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise UserError(f"--shard takes I/N with I from 1 to N (1/2, 2/2), got '{text}'")
    return int(found[1]), int(found[2])


@click.command()
@click.argument("room")
@click.option(
    "--path",
    "path",
    default="human",
    show_default=True,
    metavar="human|smooth|test|FILE",
    help="Path of the room, or a trajectory as TUM writes it, fitted into the room's free space.",
)
@click.option("--frames", type=click.IntRange(min=1), help="Number of frames; else 400, and 40 of the path test.")
@click.option("--size", type=click.IntRange(16, 8192), default=256, show_default=True, help="Width in pixels.")
@click.option(
    "--samples",
    type=click.IntRange(1, 65536),
    default=4,
    show_default=True,
    help="Samples a pixel before denoising; test frames have four times as many.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write; a run that was stopped goes on in it.")
@click.option("--shard", default="1/1", metavar="I/N", callback=_shard, help="Only every N-th frame from the I-th.")
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Threads; the pixels are the same for any number.",
)
@click.option("--dry-run", is_flag=True, help="Print how the path moves, beside the room's others; render nothing.")
@click.option(
    "--beside",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="With --dry-run, a trajectory as TUM writes it to print as well; repeatable.",
)
def command(room: str, path: str, frames: int | None, **given: Any) -> None:
    """Render ROOM (viewbench list rooms) along --path into --out: images, transforms with times, points3d.ply.

    `--path test` adds test frames to a folder that has training frames. Several processes share a room by --shard.
    """
    from ...common import plugins

    if given["beside"] and not given["dry_run"]:
        raise UserError("--beside goes with --dry-run")
    if not given["dry_run"] and given["out"] is None:
        raise UserError("give --out FOLDER, or --dry-run to see how the path moves")
    made: Room = plugins.load(ROOMS, room).build()
    job = _job(room.replace("-", "_"), made, path, frames or FRAMES.get(path, 400), given)
    if given["dry_run"]:
        _describe(job, made, given["beside"])
        return
    from ...scenes.rooms import _capture, _points, _rendering, _visibility

    _capture.check_folder(given["out"], job, made)
    reason = _rendering.available()
    if reason:
        raise UserError(reason)
    missing = _capture.write(
        given["out"],
        job,
        made,
        lambda: _rendering.Renderer(made, job.size, given["jobs"]),
        _points.seen,
        _visibility.seen_shares,
        given["shard"],
        _options.progress("frames"),
    )
    if missing:
        click.echo(f"viewbench: {missing} frames are other shards'; the last to end writes the transforms", err=True)
    click.echo(f"{len(job.times) - missing} of {len(job.times)} {job.split} frames in {given['out']}")


def _job(name: str, room: "Room", path: str, frames: int, given: dict[str, Any]) -> "Job":
    """The frames to render. Raises UserError for a path that is neither the room's nor a trajectory."""
    from ...scenes.rooms._capture import Job

    if path in room.paths:
        walk = room.paths[path](frames)
        split = "test" if path == "test" else "train"
        return Job(name, path, walk.times, walk.c2w, given["size"], given["samples"], split)
    file = Path(path)
    if not file.is_file():
        raise UserError(f"--path '{path}' is neither a path of {name} ({', '.join(room.paths)}) nor a file")
    from ...scenes.rooms._fitting import fitted

    fit = fitted(file, room, frames)
    for note in fit.notes:
        click.echo(f"viewbench: {file.name}: {note}", err=True)
    return Job(name, file.name, fit.times, fit.c2w, given["size"], given["samples"])


def _describe(job: "Job", room: "Room", beside: tuple[Path, ...]) -> None:
    """Prints how near the path comes to anything, and the percentiles of its motion beside others'."""
    from ...scenes.formats._timed import read_tum
    from ...scenes.rooms._clearance import clearance
    from ...scenes.rooms._pace import table

    paths = {job.path: (job.times, job.c2w)}
    for name, path in room.paths.items():
        walk = path(FRAMES.get(name, 400))
        paths.setdefault(name, (walk.times, walk.c2w))
    for file in beside:
        trajectory, _ = read_tum(file)
        paths[file.name] = (trajectory.times, trajectory.poses)
    least = clearance(room, job.c2w[:, :3, 3]).min()
    click.echo(f"{job.path}: {len(job.times)} frames, {least:.2f} m from everything at the nearest")
    for line in table(paths):
        click.echo(line)
    if job.split == "test":
        _describe_seen(job, room)


def _describe_seen(job: "Job", room: "Room") -> None:
    """Prints how much of the test views the room's training paths see."""
    import numpy as np

    from ...scenes.rooms import _rendering, _visibility

    reason = _rendering.available()
    if reason:
        click.echo(f"viewbench: what training views see of the test views is not known: {reason}", err=True)
        return
    for name, path in room.paths.items():
        if name == "test":
            continue
        shares = _visibility.seen_shares(room, job.c2w, path(FRAMES.get(name, 400)).c2w)
        order = np.argsort(shares, kind="stable")[:5]
        worst = ", ".join(f"{shares[i]:.2f} ({i})" for i in order)
        click.echo(f"{name} sees {shares.mean():.3f} of the test views' pixels in the mean; least (view): {worst}")
