"""What the rules ask: paths, inputs and command-line options of a cell, from the study and the settings."""

import contextlib
import re
import shlex
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from snakemake.exceptions import WorkflowError
from snakemake.utils import Paramspace

from viewbench.backends import _registry
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE, Settings
from viewbench.reports._tracking import is_remote
from viewbench.workflow._sources import from_here, listing, sources
from viewbench.workflow._study import Study


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """A user's mistake ends the workflow in its own sentence, without a traceback."""
    try:
        yield
    except UserError as error:
        raise WorkflowError(str(error)) from None


class CellSpace(Paramspace):
    """A Paramspace whose folders are the plain values, BACKEND/SCENE/SELECTOR/RATIO/SEED."""

    @property
    def wildcard_pattern(self) -> str:
        return "/".join(f"{{{column}}}" for column in self.ordered_columns)

    @property
    def instance_patterns(self) -> Iterator[str]:
        return ("/".join(row) for row in self.dataframe.itertuples(index=False))


class Wiring:
    """Answers for one study; methods that take `wildcards` are input and parameter functions of the rules."""

    def __init__(self, study: Study, settings: Settings):
        self.study, self.settings = study, settings
        self.results = f"results/{study.name}"
        self.cells = CellSpace(pd.DataFrame(study.cells(), dtype=str))
        self._files: dict[str, list[str]] = {}

    def sources(self, step: str, *modules: str, also: tuple[str, ...] = ()) -> str:
        """The file that lists what a step made of these modules depends on, and the files `also`."""
        return listing(Path(self.results) / "sources" / f"{step}.txt", [*sources(*modules), *also])

    @property
    def study_file(self) -> str:
        """The file that the study was read from."""
        return from_here(self.study.source)

    def alternatives(self, column: str) -> str:
        """Regular expression of the values that a wildcard can take."""
        values = self.study.reports if column == "report" else sorted(set(self.cells.dataframe[column]))
        return "|".join(re.escape(value) for value in values)

    def scene_files(self, wildcards: Any) -> list[str]:
        """Everything that a scene was read from: its metadata, its images and the reader itself."""
        if wildcards.scene not in self._files:
            from viewbench.scenes.load import open_scene

            with explained():
                scene = open_scene(wildcards.scene, self.settings)
            images = [path for split in (scene.train, scene.test) for path in split.paths]
            reader = self.sources(f"read-{scene.format}", _module("scenes.formats", scene.format))
            self._files[wildcards.scene] = [*map(from_here, [*scene.files, *images]), reader]
        return self._files[wildcards.scene]

    @cached_property
    def truth_width(self) -> int:
        """Width of the ground truth beside the renders in the reports: the study's widest."""
        widths = [entry.width for entry in self.study.backends if entry.width]
        return max(widths, default=256)

    @property
    def encoder_module(self) -> str:
        """Module of the study's encoder."""
        family = self.study.encoder.split(":")[0]
        plugins.load("scenes.encoders", family)
        return _module("scenes.encoders", family)

    def features(self, wildcards: Any) -> list[str]:
        """The scene's features, where the selector uses them."""
        entry = self.study.selector(wildcards.selector)
        if self.study.encoder == "none" or not entry.needs_features:
            return []
        return [f"{self.results}/features/{wildcards.scene}.npy"]

    def selector_sources(self, wildcards: Any) -> str:
        """Files behind a selection."""
        selector = self.study.selector(wildcards.selector).selector
        return self.sources(f"select-{selector}", "workflow.commands.select", _module("selectors", selector))

    def selector_options(self, wildcards: Any) -> str:
        """Options of `viewbench select` for the cell's selector."""
        entry = self.study.selector(wildcards.selector)
        options = _set_options(entry.parameters)
        features = self.features(wildcards)
        if features:
            options += ["--features", features[0]]
        elif entry.needs_features:
            options += ["--encoder", "none"]
        return shlex.join(options)

    def _family(self, wildcards: Any) -> str:
        return self.study.backend(wildcards.backend).backend.split(":")[0]

    def backend_sources(self, wildcards: Any) -> str:
        """Files behind a training run."""
        family = self._family(wildcards)
        return self.sources(f"train-{family}", "workflow.commands.train", _module("backends", family))

    def warm_sources(self, wildcards: Any) -> str:
        """Files behind a backend's compiled kernels."""
        family = self._family(wildcards)
        return self.sources(f"warm-{family}", "workflow.commands.warm", _module("backends", family))

    def backend_options(self, wildcards: Any) -> str:
        """Options of `viewbench train` for the cell's backend."""
        entry = self.study.backend(wildcards.backend)
        limits = {"--iterations": entry.iterations, "--seconds": entry.seconds, "--width": entry.width}
        options = [str(part) for flag, value in limits.items() if value is not None for part in (flag, value)]
        return shlex.join(options + _set_options(entry.options))

    def gpu(self, wildcards: Any) -> int:
        """GPUs that a job needs, for `snakemake --resources gpu=1`."""
        name = self.study.backend(wildcards.backend).backend
        return int(_registry.load(name, self.settings).CAPABILITIES.device == "cuda")

    def report_sources(self, wildcards: Any) -> str:
        """Files behind a report: its module and the numbers that ship with it (`reports/NAME/*`)."""
        module = _module("reports", wildcards.report)
        data = PACKAGE.joinpath(*module.split("."))
        files = sorted(from_here(path) for path in data.rglob("*") if path.is_file() and path.suffix != ".pyc")
        return self.sources(f"report-{wildcards.report}", module, also=tuple(files))

    @property
    def page_sources(self) -> str:
        """Files behind the page: its modules and its template."""
        templates = (PACKAGE / "reports" / "templates").iterdir()
        files = sorted(from_here(path) for path in templates if path.is_file())
        return self.sources("page", "workflow.commands.report", "reports._page", also=tuple(files))

    @property
    def tracks_as_it_goes(self) -> bool:
        """Whether cells are logged one by one as they finish."""
        return is_remote(self.settings.tracking.uri)


def _module(package: str, name: str) -> str:
    return plugins.module_name(package, name).removeprefix("viewbench.")


def _set_options(values: dict[str, Any]) -> list[str]:
    texts = {key: ",".join(map(str, value)) if isinstance(value, list) else str(value) for key, value in values.items()}
    return [part for key, text in texts.items() for part in ("--set", f"{key}={text}")]
