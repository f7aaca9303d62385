"""What the rules ask: paths, inputs and command-line options of a cell, from the study and the settings."""

import contextlib
import re
import shlex
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import pandas as pd
from snakemake.exceptions import WorkflowError
from snakemake.utils import Paramspace

from viewbench.backends import _registry
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE, Settings
from viewbench.reports._tracking import is_remote
from viewbench.workflow._sources import from_here, sources
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

    def sources(self, *modules: str) -> list[str]:
        """Files that a step made of these modules depends on."""
        return sources(*modules)

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
            reader = sources(plugins.module_name("scenes.formats", scene.format).removeprefix("viewbench."))
            self._files[wildcards.scene] = [*map(from_here, [*scene.files, *images]), *reader]
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
        return plugins.module_name("scenes.encoders", family).removeprefix("viewbench.")

    def features(self, wildcards: Any) -> list[str]:
        """The scene's features, where the selector uses them."""
        entry = self.study.selector(wildcards.selector)
        if self.study.encoder == "none" or not entry.needs_features:
            return []
        return [f"{self.results}/features/{wildcards.scene}.npy"]

    def selector_sources(self, wildcards: Any) -> list[str]:
        """Files behind a selection."""
        selector = self.study.selector(wildcards.selector).selector
        module = plugins.module_name("selectors", selector).removeprefix("viewbench.")
        return sources("workflow.commands.select", module)

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

    def _backend_module(self, wildcards: Any) -> str:
        family = self.study.backend(wildcards.backend).backend.split(":")[0]
        return plugins.module_name("backends", family).removeprefix("viewbench.")

    def backend_sources(self, wildcards: Any) -> list[str]:
        """Files behind a training run."""
        return sources("workflow.commands.train", self._backend_module(wildcards))

    def warm_sources(self, wildcards: Any) -> list[str]:
        """Files behind a backend's compiled kernels."""
        return sources("workflow.commands.warm", self._backend_module(wildcards))

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

    def report_sources(self, wildcards: Any) -> list[str]:
        """Files behind a report: its module and the numbers that ship with it (`reports/NAME/*`)."""
        module = plugins.module_name("reports", wildcards.report).removeprefix("viewbench.")
        data = PACKAGE.joinpath(*module.split("."))
        return sources(module) + sorted(from_here(path) for path in data.rglob("*") if path.is_file())

    @property
    def templates(self) -> list[str]:
        """Files of the page's template."""
        return sorted(from_here(path) for path in (PACKAGE / "reports" / "templates").iterdir() if path.is_file())

    @property
    def tracks_as_it_goes(self) -> bool:
        """Whether cells are logged one by one as they finish."""
        return is_remote(self.settings.tracking.uri)


def _set_options(values: dict[str, Any]) -> list[str]:
    texts = {key: ",".join(map(str, value)) if isinstance(value, list) else str(value) for key, value in values.items()}
    return [part for key, text in texts.items() for part in ("--set", f"{key}={text}")]
