"""Whether a cell is of the study, the settings, the data and the source code as they are now.

Each of a cell's files carries the hashes of what it was made from. Snakemake runs again what changed; a cell that it
left as it was, since a step before it failed or something changed under its hands, is found here.
"""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..backends import _evaluate, _registry, _train
from ..backends._metrics import lpips_sha256
from ..common import plugins
from ..common.errors import UserError
from ..common.files import sha256_file, unsealed
from ..common.settings import Settings
from ..scenes.digest import scene_sha256
from ..scenes.load import open_scene
from ..selectors import _run
from ..selectors._selection import count_of, selection_sha256
from ._study import BackendEntry, SelectorEntry, Study


@dataclass(frozen=True)
class SceneNow:
    """What a cell's files must say of their scene."""

    dataset: str
    format: str
    sha256: str
    names: tuple[str, ...]  # of the training views
    width: int  # pixels


class Asked:
    """What the files of a study's cells should say, found out once for each scene, selector and backend."""

    def __init__(self, study: Study, results: Path, settings: Settings):
        self.study, self.results, self.settings = study, results, settings

    @functools.cache  # noqa: B019 - one object a command
    def scene(self, name: str) -> SceneNow:
        """The scene as it is now. Raises UserError where it cannot be read."""
        opened = open_scene(name, self.settings)
        return SceneNow(
            dataset=self.settings.dataset_of(name, opened.name),
            format=opened.format,
            sha256=scene_sha256(opened),
            names=opened.train.names,
            width=int(opened.train.cameras.width[0]),
        )

    @functools.cache  # noqa: B019
    def _features_sha256(self, scene: str) -> str | None:
        """Hash of the study's features of a scene; None where they are not there."""
        from ..scenes.features import load_user_features

        path = self.results / "features" / f"{scene}.npy"
        names = self.scene(scene).names
        if not path.is_file():
            return None
        return _run.features_sha256(_run.unit_rows(load_user_features(path, len(names)), names))

    @functools.cached_property
    def _lpips_sha256(self) -> str | None:
        return lpips_sha256(self.settings.metrics.lpips_weights)

    @functools.cache  # noqa: B019
    def _parameters(self, name: str) -> dict[str, Any]:
        """All parameters of a selector of the study, those that it leaves out too."""
        entry = self.study.selector(name)
        return _run.all_parameters(
            entry.selector, plugins.load("selectors", entry.selector).PARAMETERS, entry.parameters
        )

    @functools.cache  # noqa: B019
    def _trainer(self, name: str) -> dict[str, Any]:
        """What the files say of the backend that the study calls `name`."""
        entry = self.study.backend(name)
        backend = _registry.load(entry.backend, self.settings)
        return {
            "backend": backend,
            "version": _registry.version_of(backend),
            "options": _train.all_options(entry.backend, backend.CAPABILITIES.options, entry.options),
            "training": _registry.configuration_of(backend)["train"],
            "rendering": _registry.configuration_of(backend)["render"],
        }

    def check(
        self,
        cell: dict[str, str],
        folder: Path,
        selection: dict[str, Any],
        train: dict[str, Any],
        metrics: dict[str, Any],
    ) -> None:
        """Raises UserError, which names the file to delete, where one was made from something else."""
        selector, backend = self.study.selector(cell["selector"]), self.study.backend(cell["backend"])
        found = {"selection.json": selection, "train.json": train, "metrics.json": metrics}
        for file, record in found.items():
            try:
                unsealed(record, file)
            except UserError as error:
                raise UserError(f"cell '{folder}': {error}; delete {file} there and run the study again") from None
        expected = {
            "selection.json": self._selection(cell, selector),
            "train.json": self._train(cell, backend, selection),
            "metrics.json": self._metrics(cell, backend, folder),
        }
        for file, values in expected.items():
            for key, value in values.items():
                if found[file].get(key) != value:
                    raise UserError(
                        f"cell '{folder}' is stale: {file} was made with another {key}; delete {file} there and run "
                        "the study again"
                    )

    def _selection(self, cell: dict[str, str], entry: SelectorEntry) -> dict[str, Any]:
        scene = self.scene(cell["scene"])
        values: dict[str, Any] = {
            "scene_sha256": scene.sha256,
            "selector": entry.selector.replace("_", "-"),
            "parameters": self._parameters(cell["selector"]),
            "seed": entry.choice_seed(int(cell["seed"])),
            "count": count_of(float(cell["ratio"]), len(scene.names), self.study.count),
            "code_sha256": _run.code_of(entry.selector, scene.format),
        }
        if self.study.gives_features(entry):
            values["features_sha256"] = self._features_sha256(cell["scene"])
        return values

    def _train(self, cell: dict[str, str], entry: BackendEntry, selection: dict[str, Any]) -> dict[str, Any]:
        scene, trainer = self.scene(cell["scene"]), self._trainer(cell["backend"])
        values = {
            "scene_sha256": scene.sha256,
            "selection_sha256": selection_sha256(selection),
            "backend": entry.backend,
            "seed": int(cell["seed"]),
            "budget": {"iterations": entry.iterations, "seconds": entry.seconds},
            "width": entry.width or scene.width,
            "options": trainer["options"],
            "configuration": trainer["training"],
            "code_sha256": _train.code_of(entry.backend, scene.format),
        }
        # A version that cannot be found out here, where the trainer is not installed, is not held against its models.
        return values | ({"version": trainer["version"]} if trainer["version"] is not None else {})

    def _metrics(self, cell: dict[str, str], entry: BackendEntry, folder: Path) -> dict[str, Any]:
        scene, trainer = self.scene(cell["scene"]), self._trainer(cell["backend"])
        return {
            "scene_sha256": scene.sha256,
            "train_sha256": sha256_file(folder / "train.json"),
            "lpips_sha256": self._lpips_sha256,
            "configuration": trainer["rendering"],
            "code_sha256": _evaluate.code_of(entry.backend, trainer["backend"], scene.format),
        }
