"""Any trainer that runs as a command, described in environment.toml as [command.NAME]."""

import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError, nearest
from ..common.files import read_json, write_json
from ..common.settings import Command, Settings
from ..scenes.types import Cameras
from . import _process, _subset
from ._command_line import (
    OUTPUT_PLACES,
    RENDER_PLACES,
    TRAIN_PLACES,
    check_places,
    filled,
    free_port,
    places_in,
    program,
)
from ._ply_render import ply_renderer, render_ply  # no source: training does not draw
from ._points import Wanted, knowing, starting_points
from ._points.start import joined
from ._program import files_sha256, program_version
from ._surroundings import surroundings
from ._types import SOURCES, WITHOUT, Budget, Capabilities, Report, Seeding, Trained, TrainingSet

LOG = "command.log"
SCENE = "scene"  # the subset, inside the model folder while the program trains
RECORD = "command.json"  # what rendering has to know of the training
VERSION_SECONDS = 60.0

PLY_RENDERERS = ("backends._ply_render", "backends.gsplat", "backends.splat")

CAPABILITIES = Capabilities()  # of the family; an entry's own depend on its command line


def available() -> str | None:
    """The family by itself trains nothing."""
    return "it runs programs as command:NAME; add a section [command.NAME] to environment.toml"


def version() -> str:
    """The family has none."""
    return ""


def configured(argument: str, settings: Settings) -> Any:
    """The backend `command:NAME`. Raises UserError for a section that is missing or cannot work."""
    if not argument:
        return sys.modules[__name__]
    if argument not in settings.command:
        known = list(settings.command)
        there = f" (there are: {', '.join(known)})" if known else "; none is configured"
        raise UserError(f"{settings.source} has no [command.{argument}]{nearest(argument, known)}{there}")
    entry = settings.command[argument]
    where = f"{settings.source} [command.{argument}]"
    _check(entry, where)
    return External(argument, entry, settings.compute.device)


@dataclass(frozen=True)
class External:
    """One configured program as a backend."""

    name: str
    entry: Command
    device: str = "auto"  # of the settings, for what viewbench draws itself

    @property
    def CAPABILITIES(self) -> Capabilities:  # noqa: N802 - the name that the protocol gives it
        """A limit is obeyed where the command line passes it on."""
        places = places_in(self.entry.train)
        return Capabilities(
            device=self.entry.device,
            iterations="iterations" in places,
            seconds="seconds" in places,
            deterministic=False,  # nobody knows
            options={"points": "scene"},
        )

    @property
    def RENDERERS(self) -> tuple[str, ...]:  # noqa: N802 - the name that the protocol gives it
        """Modules of viewbench that draw its models where it has no command that does."""
        return () if self.entry.render else PLY_RENDERERS

    def configuration(self) -> dict[str, dict[str, Any]]:
        """What of its section a training depends on, and what a render does."""
        entry = self.entry
        train = {"train": entry.train, "format": entry.format}
        render = {"render": entry.render, "format": entry.format, "output": entry.output}
        render |= {"files": files_sha256(entry.render)}
        drawn = {"output": entry.output, "background": entry.background}
        return {"train": train, "render": render if entry.render else drawn}

    def drawn_by(self) -> str:
        """What draws its models here: it does, or one of our rasterisers does."""
        return self._what if self.entry.render else ply_renderer(self.device)

    def available(self) -> str | None:
        for part, command in (("train", self.entry.train), ("render", self.entry.render)):
            if command and shutil.which(program(command)) is None:
                return f"'{program(command)}', which its `{part}` command starts, is not installed or not on PATH"
        return None

    def version(self) -> str:
        """What its `version` command prints last, or what can be found out about the program."""
        if not self.entry.version:
            return program_version(self.entry.train)
        with tempfile.TemporaryDirectory(prefix="viewbench-") as folder:
            log = Path(folder) / LOG
            _process.run(self.entry.version, Path(folder), log, f"{self._what} --version", VERSION_SECONDS)
            return _process.last_line(log)

    def train(
        self, data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict[str, Any], report: Report
    ) -> Trained:
        """Writes the chosen views as a scene, runs the `train` command in `out`, and keeps what it leaves there.

        The seconds are those of the whole program, its set-up included: nobody sees inside. Raises UserError for a
        budget that the command line needs and does not have, and whatever ends the program before its time.
        """
        values = {
            "out": out.resolve(),
            "scene": out.resolve() / SCENE,
            "seed": seed,
            "width": int(data.cameras.width[0]),
            "height": int(data.cameras.height[0]),
            "views": len(data.names),
            "port": free_port(),
        }
        for limit in ("iterations", "seconds"):
            value = getattr(budget, limit)
            if value is not None:
                values[limit] = value
            elif limit in places_in(self.entry.train):
                raise UserError(f"{self._what} takes {limit}; add them to the budget")
        points, seeding = self._points(data, str(options["points"]), seed)
        _subset.write(out / SCENE, self.entry.format, data.cameras, data.images, points)
        began = time.perf_counter()
        report.progress(0, None, f"running {program(self.entry.train)}, which writes {LOG}")
        command = filled(self.entry.train, values)
        usage = _process.run(command, out, out / LOG, self._what, self.entry.timeout or None)
        seconds = time.perf_counter() - began
        shutil.rmtree(out / SCENE)
        write_json(out / RECORD, {"seed": seed, "iterations": budget.iterations})
        if not any(path.name not in (LOG, RECORD) for path in out.iterdir()):
            raise UserError(f"{self._what} ended well but left nothing in its folder; does its command use {{out}}?")
        return Trained(
            iterations=budget.iterations or 0,
            seconds=seconds,
            seeding=seeding,
            device=self.entry.device,
            peak_rss_bytes=usage.rss_bytes,
            peak_gpu_bytes=usage.gpu_bytes,
            notes={"command": [str(part) for part in self.entry.train]},
        )

    def render(self, model: Path, cameras: Cameras) -> Iterator[np.ndarray]:
        """Writes the cameras as a scene with black images, runs the `render` command and reads its pictures.

        Without that command the output is a PLY file of 3D Gaussians, which viewbench renders itself.
        """
        if not self.entry.render:
            yield from render_ply(model / self.entry.output, cameras, self.entry.background, self.device)
            return
        with tempfile.TemporaryDirectory(prefix="viewbench-") as folder:
            place = Path(folder).resolve()
            # A lone camera is written twice: nerfstudio names renders by their place below the folder that all
            # pictures have in common, and one alone by nothing.
            drawn = cameras if len(cameras) > 1 else cameras[[0, 0]]
            _subset.write(place / "cameras", self.entry.format, drawn, None)
            (place / "renders").mkdir()
            values = {
                **read_json(model / RECORD, "training record"),
                "out": model.resolve(),
                "cameras": place / "cameras",
                "renders": place / "renders",
                "width": int(cameras.width[0]),
                "height": int(cameras.height[0]),
                "port": free_port(),
            }
            names = (Path(_subset.image_name(index)).stem for index in range(len(cameras)))
            output = [self.entry.output.format(**values, name=name, index=i) for i, name in enumerate(names)]
            files = [place / "renders" / path for path in output]  # an absolute path stands for itself
            for file in files:
                file.unlink(missing_ok=True)  # of an earlier run, where {out} holds them
            command = filled(self.entry.render, values)
            _process.run(command, model, place / LOG, f"{self._what} (render)", self.entry.timeout or None)
            yield from _subset.read_images(files, cameras, self._what)

    @property
    def _what(self) -> str:
        return f"command:{self.name}"

    def _points(self, data: TrainingSet, source: str, seed: int) -> tuple[Any, Seeding]:
        """Points for the scene that the program gets; a scene without any is none of its business."""
        if source == WITHOUT or (source == "scene" and data.points is None):
            if self.entry.needs_points:
                missing = "points=none leaves it" if source == WITHOUT else f"scene '{data.scene}' has"
                raise UserError(f"{self._what} needs points to start from, and {missing} none; set points=random")
            return None, Seeding()
        if source not in SOURCES:
            known = (*SOURCES, WITHOUT)
            raise UserError(f"{self._what}: option 'points' is '{source}'{nearest(source, known)} ({', '.join(known)})")
        data = knowing(data, source)
        around = surroundings(data.training, data.points)
        starts, seeding = starting_points(data, Wanted(source), around, np.random.default_rng(seed))
        xyz, colours = joined(starts)
        return (xyz, np.round(255 * colours).astype(np.uint8)), seeding


def _check(entry: Command, where: str) -> None:
    """Raises UserError for a section that cannot work, before anything is run with it."""
    if entry.format not in _subset.LAYOUTS:
        known = _subset.LAYOUTS
        raise UserError(f"{where}: format '{entry.format}'{nearest(entry.format, known)} is none of {', '.join(known)}")
    if entry.device not in ("cpu", "cuda"):
        raise UserError(f"{where}: device is '{entry.device}', expected 'cpu' or 'cuda'")
    if len(entry.background) != 3 or not all(0 <= value <= 1 for value in entry.background):
        raise UserError(f"{where}: background is {entry.background}, expected red, green and blue from 0 to 1")
    if not entry.train:
        raise UserError(f"{where}: 'train' is an empty list; it starts with the program to run")
    check_places(entry.train, TRAIN_PLACES, f"{where} 'train'")
    check_places(entry.render, RENDER_PLACES, f"{where} 'render'")
    check_places([entry.output], OUTPUT_PLACES, f"{where} 'output'")
    given = places_in([entry.output])
    if not entry.render and (given or not entry.output.endswith(".ply")):
        raise UserError(f"{where}: without 'render', 'output' is the PLY file of 3D Gaussians in the model folder")
    if entry.render and not given & {"name", "index"}:
        raise UserError(f"{where}: 'output' names one file for all renders; put {{name}} or {{index}} into it")
    if "--eval" in entry.train and any(Path(part).name == "train.py" for part in entry.train):
        raise UserError(f"{where}: with --eval, train.py of 3DGS holds out every 8th of the chosen views; leave it out")
    if "iterations" in given | places_in(entry.render) and "iterations" not in places_in(entry.train):
        raise UserError(f"{where}: rendering takes {{iterations}}, which 'train' does not; write them out")
