"""Study files: a grid scenes × selectors × ratios × seeds × backends, checked before anything runs."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..backends import _registry
from ..backends._train import all_options
from ..backends._types import SHARED
from ..common import bounded, catalogue, limits, plugins
from ..common.errors import UserError, nearest
from ..common.settings import Settings
from ..selectors._run import all_parameters
from ..selectors._selection import is_greedy
from ..selectors._types import FACTORS

FOLDER = Path(__file__).resolve().parent
STUDIES = FOLDER / "studies"
REFERENCE = "full"
TIERS = (0.25, 0.5, 1.0)  # a greedy order is made up to the next of these ratios, whichever of them a study asks for


@dataclass(frozen=True)
class SelectorEntry:
    """One way of choosing: a selector and its parameters, under the name that results carry."""

    name: str
    selector: str
    parameters: dict[str, Any] = field(default_factory=dict)
    seeds: tuple[int, ...] = ()  # those of the study's that it is trained with; none for all

    @property
    def seeded(self) -> bool:
        """Whether the seed changes the choice; if not, one choice serves the trainings with all seeds."""
        if self.parameters.get("start") == "medoid":
            return False
        return bool(plugins.constant("selectors", self.selector, "SEEDED", True))

    @property
    def greedy(self) -> bool:
        """Whether the views of a smaller count are the first of those of a larger one."""
        return is_greedy(self.selector, self.parameters)

    def choice_seed(self, seed: int) -> int:
        """Seed of the choice in the cells with this seed: one choice serves all of them where it has no randomness."""
        return seed if self.seeded else 0

    def choice_part(self, ratio: float) -> float:
        """Ratio of the choice in the cells with this ratio: a greedy order serves all up to the next tier."""
        return next(tier for tier in TIERS if ratio <= tier) if self.greedy else ratio

    @property
    def needs_features(self) -> bool:
        """Whether the semantic factor is in use."""
        factors: Any = self.parameters.get("factors", plugins.constant("selectors", self.selector, "FACTORS", ()))
        return "sem" in tuple(factors)


@dataclass(frozen=True)
class BackendEntry:
    """One way of training: a backend, its options and its budget, under the name that results carry."""

    name: str
    backend: str
    iterations: int | None
    seconds: float | None
    width: int | None
    options: dict[str, Any] = field(default_factory=dict)
    grid: dict[str, Any] = field(default_factory=dict)  # the part of the study's grid that it runs; empty for all

    @property
    def file_name(self) -> str:
        """What files call its backend."""
        return file_name(self.backend)


@dataclass(frozen=True)
class Study:
    """A study file, checked and with its defaults filled in."""

    name: str
    title: str
    description: str
    scenes: tuple[str, ...]
    selectors: tuple[SelectorEntry, ...]
    ratios: tuple[float, ...]
    seeds: tuple[int, ...]
    backends: tuple[BackendEntry, ...]
    reference: tuple[int, ...]  # seeds of the trainings on every view
    count: str  # how a ratio becomes a number of views: selectors/_run.py
    encoder: str
    reports: tuple[str, ...]
    source: Path

    def selector(self, name: str) -> SelectorEntry:
        """The entry that results call `name`; the full-data reference has one too."""
        for entry in self.selectors:
            if entry.name == name:
                return entry
        return SelectorEntry(REFERENCE, REFERENCE)

    def backend(self, name: str) -> BackendEntry:
        """The entry that results call `name`."""
        return next(entry for entry in self.backends if entry.name == name)

    def gives_features(self, entry: SelectorEntry) -> bool:
        """Whether the selector gets image features: where it uses them and the study has an encoder."""
        return entry.needs_features and self.encoder != "none"

    def cells(self) -> list[dict[str, str]]:
        """One row a cell, all values as the folders under `cells/` spell them.

        Every selector, and the full-data reference, is trained with several seeds: also where the choice is always the
        same, its score has a spread.
        """
        rows = []
        for backend in self.backends:
            part = backend.grid
            seeds = part.get("seeds", self.seeds)
            for scene in part.get("scenes", self.scenes):
                for entry in self.selectors:
                    if entry.name in part.get("selectors", [entry.name]):
                        rows += [
                            _row(backend.name, scene, entry.name, ratio, seed)
                            for ratio in part.get("ratios", self.ratios)
                            for seed in seeds
                            if seed in (entry.seeds or seeds)
                        ]
                wanted = part.get("reference")  # True: also where the study has none
                if wanted is not False:
                    asked = self.reference or (self.seeds if wanted else ())
                    rows += [_row(backend.name, scene, REFERENCE, 1.0, seed) for seed in seeds if seed in asked]
        return rows

    def record(self) -> dict[str, Any]:
        """What `results/STUDY/study.json` records; nothing in it depends on where the file of the study lies."""
        fields = {key: value for key, value in asdict(self).items() if key != "source"}
        return {"schema": 1, **fields, "cells": len(self.cells())}


def file_name(backend: str) -> str:
    """What files call a backend."""
    return backend.replace(":", "-")


def names() -> list[str]:
    """The studies that ship, by name."""
    return sorted(path.stem for path in STUDIES.glob("*.yaml"))


def load(study: str, settings: Settings) -> Study:
    """Reads a study by name or by the path of its file.

    Raises UserError for a file that cannot be read, a key or value that the schema does not allow (with the nearest
    right one), and a scene, selector, backend or report that does not exist.
    """
    import jsonschema
    import yaml

    path = Path(study) if study.endswith((".yaml", ".yml")) else STUDIES / f"{study}.yaml"
    try:
        bounded.checked(path)
        raw = yaml.safe_load(bounded.data(path, "study", limits.STUDY_BYTES).decode("utf-8"))
    except FileNotFoundError:
        known = names()
        raise UserError(f"unknown study '{study}'{nearest(study, known)} (there are: {', '.join(known)})") from None
    except OSError as error:
        raise UserError(f"study '{path}' cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        raise UserError(f"study '{path}' is not valid YAML: {error}") from None
    if _nodes(raw, {}) > limits.STUDY_NODES:
        raise UserError(f"study '{path}' has more than {limits.STUDY_NODES:,} values when its aliases are written out")
    schema = json.loads((FOLDER / "schemas" / "study.schema.json").read_text(encoding="utf-8"))
    errors = list(jsonschema.Draft202012Validator(schema).iter_errors(raw))
    if errors:
        raise UserError(f"study '{path}': {_explain(errors[0], schema)}")
    return _complete(raw, path, settings)


def _nodes(value: Any, known: dict[int, float]) -> float:
    """How many values a tree of lists and mappings has, one that stands in several places counted in each of them.

    Infinity for one that is part of itself.
    """
    if not isinstance(value, (dict, list)):
        return 1
    if id(value) not in known:
        known[id(value)] = math.inf  # until it is counted
        known[id(value)] = 1 + sum(
            _nodes(part, known) for part in (value.values() if isinstance(value, dict) else value)
        )
    return known[id(value)]


def _row(backend: str, scene: str, selector: str, ratio: float, seed: int) -> dict[str, str]:
    values = {"backend": backend, "scene": scene, "selector": selector, "ratio": repr(float(ratio)), "seed": str(seed)}
    return values


def _complete(raw: dict[str, Any], path: Path, settings: Settings) -> Study:
    selectors = tuple(_selector(entry) for entry in raw["selectors"])
    backends = tuple(_backend(entry, raw, settings) for entry in raw["backends"])
    reports = [name.replace("_", "-") for name in raw.get("reports", plugins.names("reports"))]
    for scene in raw["scenes"]:
        if settings.entry(scene) is None:
            known_scenes = [*settings.scenes, *catalogue.names()]
            raise UserError(
                f"study '{path}': unknown scene '{scene}'{nearest(scene, known_scenes)}; name it in {settings.source} "
                f"as [scenes.{scene.replace('/', '_')}], or take one of `viewbench download --list`"
            )
    raw = {**raw, "scenes": list(dict.fromkeys(_one_word(scene) for scene in raw["scenes"]))}
    for report in reports:
        _known("report", "reports", report, path)
    for selector in selectors:
        _known("selector", "selectors", selector.selector, path)
        plugin = plugins.load("selectors", selector.selector)
        _checked(path, all_parameters, selector.selector, plugin.PARAMETERS, selector.parameters)
        factors = selector.parameters.get("factors", FACTORS)
        for factor in factors:
            if factor not in FACTORS:
                raise UserError(f"study '{path}': unknown factor '{factor}'{nearest(factor, FACTORS)}")
    for backend in backends:
        _known("backend", "backends", backend.backend.split(":")[0], path)
        trainer = _checked(path, _registry.load, backend.backend, settings)
        _checked(path, all_options, backend.backend, trainer.CAPABILITIES.options, backend.options)
        if backend.iterations is None and backend.seconds is None:
            raise UserError(f"study '{path}': backend '{backend.name}' has no budget; give iterations or seconds")
        _check_grid(backend, raw, selectors, path)
    for name, seeds in (*((entry.name, entry.seeds) for entry in selectors), ("reference", _reference(raw))):
        missing = [seed for seed in seeds if seed not in _seeds(raw["seeds"])]
        if missing:
            raise UserError(f"study '{path}': '{name}' has seed {missing[0]}, which the study does not have")
    for name in SHARED:
        if name in raw and not any(name in backend.options for backend in backends):
            raise UserError(f"study '{path}': '{name}' is set, and none of its backends has it; leave it out")
    for kind, entries in (("selector", selectors), ("backend", backends)):
        called = [entry.name for entry in entries]
        twice = next((name for name in called if called.count(name) > 1), None)
        if twice is not None or (kind == "selector" and REFERENCE in called):
            raise UserError(f"study '{path}': {kind} '{twice or REFERENCE}' stands twice; give each its own name")
    return Study(
        name=path.stem,
        title=raw.get("title", path.stem),
        description=raw.get("description", ""),
        scenes=tuple(raw["scenes"]),
        selectors=selectors,
        ratios=tuple(float(ratio) for ratio in raw["ratios"]),
        seeds=_seeds(raw["seeds"]),
        backends=backends,
        reference=_reference(raw),
        count=raw.get("count", "round"),
        encoder=raw.get("encoder", settings.features.encoder),
        reports=tuple(reports),
        source=path,
    )


def _one_word(scene: str) -> str:
    """DATASET.SCENE for DATASET/SCENE of the catalogue: a scene is one folder in results."""
    return scene.replace("/", ".")


def _selector(entry: str | dict) -> SelectorEntry:
    if isinstance(entry, str):
        return SelectorEntry(entry, entry)
    seeds = _seeds(entry["seeds"]) if "seeds" in entry else ()
    return SelectorEntry(entry.get("name", entry["selector"]), entry["selector"], entry.get("parameters", {}), seeds)


def _reference(raw: dict[str, Any]) -> tuple[int, ...]:
    given = raw.get("reference", True)
    if isinstance(given, bool):
        return _seeds(raw["seeds"]) if given else ()
    return _seeds(given)


def _backend(entry: str | dict, raw: dict, settings: Settings) -> BackendEntry:
    entry = {"backend": entry} if isinstance(entry, str) else entry
    budget = entry.get("budget", raw.get("budget", {}))
    shared = {name: raw[name] for name in SHARED if name in raw and name in _options_of(entry["backend"], settings)}
    return BackendEntry(
        name=entry.get("name", entry["backend"].replace(":", "-")),
        backend=entry["backend"],
        iterations=budget.get("iterations"),
        seconds=budget.get("seconds"),
        width=entry.get("width", raw.get("width")),
        options={**shared, **entry.get("options", {})},
        grid=_grid(entry.get("grid", {})),
    )


def _options_of(name: str, settings: Settings) -> dict[str, Any]:
    """What a backend can be told; nothing for one that is not there, which is answered elsewhere."""
    try:
        return _registry.load(name, settings).CAPABILITIES.options
    except UserError:
        return {}


def _grid(given: dict[str, Any]) -> dict[str, Any]:
    grid = dict(given)
    if "scenes" in grid:
        grid["scenes"] = [_one_word(scene) for scene in grid["scenes"]]
    if "seeds" in grid:
        grid["seeds"] = list(_seeds(grid["seeds"]))
    if "ratios" in grid:
        grid["ratios"] = [float(ratio) for ratio in grid["ratios"]]
    return grid


def _seeds(given: int | list[int]) -> tuple[int, ...]:
    # JSON's integers may be written 2.0.
    return tuple(int(seed) for seed in given) if isinstance(given, list) else tuple(range(int(given)))


def _check_grid(backend: BackendEntry, raw: dict, selectors: Sequence[SelectorEntry], path: Path) -> None:
    """Raises UserError where a backend's part of the grid is none of the study's, or leaves a selector no seed."""
    names = [entry.name for entry in selectors]
    whole = {"scenes": raw["scenes"], "selectors": names, "ratios": list(map(float, raw["ratios"]))}
    for axis, known in {**whole, "seeds": list(_seeds(raw["seeds"]))}.items():
        for value in backend.grid.get(axis, []):
            if value not in known:
                raise UserError(
                    f"study '{path}': the grid of backend '{backend.name}' has {axis[:-1]} {value!r}, which the study "
                    f"does not have{nearest(str(value), map(str, known))}"
                )
    for entry in selectors:
        runs = entry.name in backend.grid.get("selectors", names)
        if runs and entry.seeds and not set(entry.seeds) & set(backend.grid.get("seeds", entry.seeds)):
            raise UserError(f"study '{path}': backend '{backend.name}' has none of the seeds of '{entry.name}'")


def _checked(path: Path, check: Callable, *arguments: Any) -> Any:
    """What the function returns; its UserError names the study."""
    try:
        return check(*arguments)
    except UserError as error:
        raise UserError(f"study '{path}': {error}") from None


def _known(kind: str, package: str, name: str, path: Path) -> None:
    known = plugins.names(package)
    if name not in known:
        raise UserError(
            f"study '{path}': unknown {kind} '{name}'{nearest(name, known)} (there are: {', '.join(known)})"
        )


def _explain(error: Any, schema: dict) -> str:
    """One sentence for a schema error; a wrong key is answered with the nearest right one."""
    while error.context:  # anyOf: the branch that failed deepest, or has a wrong key, is the one that was meant
        error = max(error.context, key=lambda inner: (len(inner.absolute_path), inner.validator != "type"))
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error.absolute_path).lstrip(".")
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", {}))
        wrong = next(key for key in error.instance if key not in known)
        place = f" in '{where}'" if where else ""
        return f"unknown key '{wrong}'{place}{nearest(str(wrong), known)} (known: {', '.join(known)})"
    return f"{where or 'the file'}: {error.message}"
