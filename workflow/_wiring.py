"""What the rules ask: paths, inputs and command-line options of a job, from the study and the settings."""

import contextlib
import functools
import hashlib
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from snakemake.exceptions import WorkflowError

from ..backends import _evaluate, _registry, _train
from ..backends._metrics import lpips_sha256
from ..common import gpu, plugins
from ..common.cells import cell_name
from ..common.errors import UserError
from ..common.files import sha256_file
from ..common.settings import PACKAGE, Settings
from ..reports._tracking_errors import masked
from ..scenes import seen
from ..scenes.whereabouts import absence, python_of, renderable, renders
from ..selectors import _run
from ._depends import Lists
from ._resources import Needs, Size
from ._study import Study, file_name

# Installed packages whose version may change a step's numbers; a backend's version names its own.
CHOOSING = ("numpy", "scipy", "numba")
READING = ("numpy", "scipy", "pillow")  # and drawing to a smaller size
SCORING = ("numpy", "scipy", "scikit-image", "pillow", "lpips", "torch")


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """A user's mistake ends the workflow in its own sentence, without a traceback."""
    try:
        yield
    except UserError as error:
        raise WorkflowError(str(error)) from None


class Wiring:
    """Answers for one study; methods that take `wildcards` are input and parameter functions of the rules."""

    def __init__(self, study: Study, settings: Settings, writes: bool = True):
        self.study, self.settings = study, settings
        self.results = f"results/{study.name}"
        self.cells = study.cells()
        self.lists = Lists(Path(self.results) / "depends", writes)
        self.checkpoints: Any = None  # Snakemake's, once it reads the rules
        self.inside: Callable[[], None] | None = None  # what is done first in a process that a scheduler has started

    @property
    def cell_patterns(self) -> list[str]:
        """BACKEND/SCENE/SELECTOR/RATIO/SEED of every cell."""
        return [cell_name(cell) for cell in self.cells]

    def alternatives(self, column: str) -> str:
        """Regular expression of the values that a wildcard can take."""
        named = {"report": self.study.reports, "trainer": tuple(self.trainers)}
        values = named[column] if column in named else sorted({cell[column] for cell in self.cells})
        return "|".join(re.escape(value) for value in values)

    def check_scenes(self) -> None:
        """Raises UserError for scenes that are not there, with the line that brings them, and for a Python to render
        with that is not there."""
        absent = absence(self.study.scenes, self.settings, study=True)
        if absent:
            raise UserError(absent)
        python = python_of(self.settings)
        if self.to_render and not shutil.which(python):
            raise UserError(f"rooms.python (VIEWBENCH_ROOMS_PYTHON) is '{python}', which is no program; name a Python")

    def command(self, name: str) -> str:
        """What a step depends on that is one command and nothing else."""
        return self.lists.path(name, (f"workflow.commands.{name}",))

    # Scenes

    @functools.cache  # noqa: B019 - one object a run
    def _scene(self, name: str) -> tuple[str, str, str, Size]:
        """Format, holdout and hash of a scene, and how large it is."""
        from ..scenes.digest import scene_sha256
        from ..scenes.load import open_scene

        with explained():
            scene = open_scene(name, self.settings)
            cameras, tests = scene.train.cameras, len(scene.test or ())
            size = Size(len(scene.train), tests, int(cameras.width.max()), int(cameras.height.max()))
            return scene.format, scene.holdout, scene_sha256(scene), size

    def scene(self, wildcards: Any) -> str:
        """What a scene is: its content, its test split, and the code that reads it."""
        name = wildcards.scene
        if self.inside:
            self.inside()
        if not self.lists.writes:
            return self.lists.path(f"scene-{name}")
        if name in self.to_render:
            self.checkpoints.rendered.get(scene=name)  # until it is, all that needs the scene is planned later
        format_name, holdout, sha256, _ = self._scene(name)
        return self.lists.path(
            f"scene-{name}",
            ("scenes.load", plugins.source_name("scenes.formats", format_name)),
            {"format": format_name, "holdout": holdout, "sha256": sha256},
        )

    @cached_property
    def needs(self) -> Needs:
        """What the rules' jobs ask of a scheduler; in a job itself nothing is looked up."""
        return Needs(
            self.study, self.settings, lambda name: self._scene(name)[3] if self.lists.writes else None, self._gpu
        )

    @cached_property
    def to_render(self) -> frozenset[str]:
        """The generated rooms that were not there when the run began, and are rendered by it."""
        return frozenset(renderable(self.study.scenes, self.settings) if renders(self.settings) else ())

    def forget_renders(self) -> None:
        """Removes what says that a scene is rendered which is not there any more; not while a run may be at it."""
        for scene in self.to_render:
            stamps = Path(self.results) / "rendered"
            for stamp in (stamps / f"{scene}.txt", *(stamps / scene).glob("*")):
                stamp.unlink(missing_ok=True)

    def render_command(self, wildcards: Any) -> str:
        """The command line that renders a scene, up to what says which frames."""
        entry = self.settings.entry(wildcards.scene)
        assert entry is not None
        try:
            asked = shlex.split(entry.render)
        except ValueError as error:
            raise WorkflowError(f"[scenes.{wildcards.scene}] render = '{entry.render}': {error}") from None
        words = [python_of(self.settings), "-m", "viewbench", "render", *asked]
        return shlex.join([*words, "--out", str(self.settings.folder_of(entry))])

    def render_parts(self, wildcards: Any) -> list[str]:
        """What says that the parts of a scene are rendered: of its path, and of the test frames."""
        count = self.settings.rooms.shards
        parts = [f"{number}-of-{count}" for number in range(1, count + 1)]
        return [f"{self.results}/rendered/{wildcards.scene}/{part}" for part in (*parts, "test")]

    def render_part(self, wildcards: Any) -> str:
        """Options of `viewbench render` for one part."""
        return "--path test" if wildcards.piece == "test" else f"--shard {wildcards.piece.replace('-of-', '/')}"

    def seen(self, wildcards: Any) -> str:
        """Hash of what a rendered scene says of its test views; empty where it says nothing."""
        entry = self.settings.entry(wildcards.scene)
        folder = self.settings.folder_of(entry) if entry else Path(wildcards.scene)
        file = folder / seen.FILE if folder else None
        return sha256_file(file) if file and file.is_file() else ""

    def dataset(self, wildcards: Any) -> str:
        """The group that the scene's tables put it in."""
        return self.settings.dataset_of(wildcards.scene, "")

    def room(self, wildcards: Any) -> str:
        """The room that the scene was captured in."""
        return self.settings.room_of(wildcards.scene)

    def walk(self, wildcards: Any) -> str:
        """How the camera went in the scene."""
        return self.settings.walk_of(wildcards.scene)

    @cached_property
    def truth_width(self) -> int:
        """Width of the ground truth beside the renders in the reports: the study's widest."""
        widths = [entry.width for entry in self.study.backends if entry.width]
        return max(widths, default=256)

    @cached_property
    def encoder(self) -> str:
        """What the features depend on besides the pictures."""
        family, _, argument = self.study.encoder.partition(":")
        with explained():
            module = plugins.load("scenes.encoders", family)
            made_by = module.version(argument) if hasattr(module, "version") else ""
        modules = ("workflow.commands.features", plugins.source_name("scenes.encoders", family))
        return self.lists.path("features", modules, {"encoder": self.study.encoder, "version": made_by}, READING)

    @property
    def encoder_gpu(self) -> int:
        """GPUs that embedding a scene needs: the encoders that use one where there is one say so."""
        uses = plugins.constant("scenes.encoders", self.study.encoder.partition(":")[0], "GPU", False)
        return int(bool(uses) and self.settings.compute.device != "cpu" and bool(gpu.devices()))

    # Selections

    def features(self, wildcards: Any) -> list[str]:
        """The scene's features, where the selector uses them."""
        entry = self.study.selector(wildcards.selector)
        return [f"{self.results}/features/{wildcards.scene}.npy"] if self.study.gives_features(entry) else []

    def choosing(self, wildcards: Any) -> str:
        """What a selection depends on besides scene, features and options."""
        return self._choosing(self.study.selector(wildcards.selector).selector)

    def _choosing(self, selector: str) -> str:
        modules = ("workflow.commands.select", *_run.modules_of(selector))
        return self.lists.path(f"select-{selector}", modules, packages=CHOOSING)

    def choosing_compiled(self, wildcards: Any) -> str:
        """What the selections depend on that wait for `plugin` to be compiled."""
        return self._choosing(wildcards.plugin)

    def warm_selector(self, wildcards: Any) -> list[str]:
        """The file that says that the selector is compiled, where it compiles anything."""
        selector = self.study.selector(wildcards.selector).selector
        return [f"{self.results}/warm_selectors/{selector}"] if self._compiles(selector) else []

    @functools.cache  # noqa: B019
    def _compiles(self, selector: str) -> bool:
        return plugins.defines("selectors", selector, "warm")

    def selection(self, wildcards: Any) -> str:
        """The file with a cell's choice: one for all ratios of a tier where the order is greedy, one for all backends
        and, where the selector has no randomness, for all seeds."""
        entry = self.study.selector(wildcards.selector)
        part, seed = entry.choice_part(float(wildcards.ratio)), entry.choice_seed(int(wildcards.seed))
        return f"{self.results}/selections/{wildcards.scene}/{wildcards.selector}/{part!r}/{seed}.json"

    def selection_patterns(self) -> list[str]:
        """Every file of selections."""
        return sorted({self.selection(_Cell(cell)) for cell in self.cells})

    def features_patterns(self) -> list[str]:
        """Every file of features that a selection uses."""
        return sorted({path for cell in self.cells for path in self.features(_Cell(cell))})

    def selector_options(self, wildcards: Any) -> str:
        """Options of `viewbench select` for the selector."""
        entry = self.study.selector(wildcards.selector)
        options = _set_options(entry.parameters) + ["--count-rule", self.study.count]
        features = self.features(wildcards)
        if features:
            options += ["--features", features[0]]
        elif entry.needs_features:
            options += ["--encoder", "none"]
        return shlex.join(options)

    # Models

    @functools.cache  # noqa: B019
    def _backend(self, name: str) -> Any:
        with explained():
            return _registry.load(name, self.settings)

    @cached_property
    def trainers(self) -> dict[str, str]:
        """The backends that train, each once however many names the study has for it, by what files call them."""
        return {file_name(entry.backend): entry.backend for entry in self.study.backends}

    def warm(self, wildcards: Any) -> str:
        """The file that says that the cell's backend is compiled."""
        return f"{self.results}/warm/{file_name(self.study.backend(wildcards.backend).backend)}"

    @functools.cache  # noqa: B019
    def _facts(self, name: str) -> dict[str, Any]:
        """Configuration of a backend and its version, None where it cannot be found out: the jobs will say why."""
        backend = self._backend(name)
        return {"version": _registry.version_of(backend), **_registry.configuration_of(backend)}

    def training(self, wildcards: Any) -> str:
        """What a training depends on besides scene, selection and options."""
        return self._training(self.study.backend(wildcards.backend).backend)

    def training_compiled(self, wildcards: Any) -> str:
        """What the trainings depend on that wait for `trainer` to be compiled."""
        return self._training(self.trainers[wildcards.trainer])

    def _training(self, name: str) -> str:
        step = f"train-{file_name(name)}"
        if not self.lists.writes:
            return self.lists.path(step)
        facts = self._facts(name)
        modules = ("workflow.commands.train", *_train.modules_of(name))
        values = {"version": facts["version"], "configuration": facts["train"]}
        return self.lists.path(step, modules, values, READING, keep=facts["version"] is None)

    def scoring(self, wildcards: Any) -> str:
        """What a score depends on besides scene and model."""
        name = self.study.backend(wildcards.backend).backend
        step = f"evaluate-{file_name(name)}"
        if not self.lists.writes:
            return self.lists.path(step)
        modules = ("workflow.commands.evaluate", *_evaluate.modules_of(name, self._backend(name)))
        drawn_by = _registry.drawn_by(name, self._backend(name))
        values = {"configuration": self._facts(name)["render"], "drawn by": drawn_by, "lpips": self._lpips}
        return self.lists.path(step, modules, values, SCORING)

    @cached_property
    def _lpips(self) -> str | None:
        """Hash of the weights of LPIPS; None without them."""
        with explained():
            return lpips_sha256(self.settings.metrics.lpips_weights)

    def backend_options(self, wildcards: Any) -> str:
        """Options of `viewbench train` for the cell's backend."""
        entry = self.study.backend(wildcards.backend)
        limits = {"--iterations": entry.iterations, "--seconds": entry.seconds, "--width": entry.width}
        options = [str(part) for flag, value in limits.items() if value is not None for part in (flag, value)]
        return shlex.join([*options, "--count-rule", self.study.count, *_set_options(entry.options)])

    def limit(self, workflow: Any) -> None:
        """Lets as many jobs that need a GPU run at once as this machine has, unless `--resources gpu=N` says how many.

        It knows no executor yet: a profile for a cluster sets `resources`, and leaves the limit to the scheduler.
        """
        count = len(gpu.devices())
        if workflow.remote_exec:
            count = 1  # of an allocation, whose cells take turns
        if count and self.settings.compute.device.startswith("cuda:"):
            count = 1
        if count and "gpu" not in workflow.global_resources:
            workflow.register_resource("gpu", count)

    def gpu(self, wildcards: Any) -> int:
        """GPUs that a job needs, one at most."""
        return self._gpu(self.study.backend(wildcards.backend).backend)

    def warm_gpu(self, wildcards: Any) -> int:
        """GPUs that compiling the trainer needs."""
        return self._gpu(self.trainers[wildcards.trainer])

    def _gpu(self, name: str) -> int:
        return int(self._backend(name).CAPABILITIES.device == "cuda")

    # Reports

    @property
    def study_file(self) -> str:
        """The study as it was checked: what it says, wherever its file lies."""
        return self.lists.path("study", ("workflow.commands.study",), {"study": self.study.record()})

    def report(self, wildcards: Any) -> str:
        """What a report depends on: its module and the numbers that ship with it (`reports/NAME/*`)."""
        module = plugins.source_name("reports", wildcards.report)
        data = PACKAGE.joinpath(*module.split("."))
        return self.lists.path(f"report-{wildcards.report}", (module,), _contents(data), ("matplotlib",))

    @property
    def page(self) -> str:
        """What the page depends on: its modules and its template."""
        modules = ("workflow.commands.report", "reports._page")
        return self.lists.path("page", modules, _contents(PACKAGE / "reports" / "templates"))

    @property
    def tracking(self) -> str:
        """Where runs are logged to, without the password that an address may hold; hashed, since it is long."""
        asked = self.settings.tracking
        where = (masked(asked.uri, asked.uri), asked.artifacts, asked.renders, asked.models)
        return hashlib.sha256(repr(where).encode()).hexdigest()[:16]


class _Cell:
    """A cell as a rule's wildcards have it."""

    def __init__(self, cell: dict[str, str]):
        self.scene, self.selector, self.ratio, self.seed = (cell[key] for key in ("scene", "selector", "ratio", "seed"))


def _contents(folder: Path) -> dict[str, str]:
    """Hashes of the files in a folder, compiled ones aside; nothing where there is no such folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc")
    return {path.relative_to(folder).as_posix(): sha256_file(path) for path in files}


def _set_options(values: dict[str, Any]) -> list[str]:
    texts = {key: ",".join(map(str, value)) if isinstance(value, list) else str(value) for key, value in values.items()}
    return [part for key, text in texts.items() for part in ("--set", f"{key}={text}")]
