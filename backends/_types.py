"""What a backend is given and what it gives back.

A backend is one module (or folder) here. Its docstring's first line is its summary; it defines

    CAPABILITIES: Capabilities
    available() -> str | None         why it cannot run here, in one sentence that says what to install; None if it can
    version() -> str                  of whatever does the work
    train(data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict, report: Report) -> Trained
    render(model: Path, cameras: Cameras) -> Iterator[np.ndarray]      (H, W, 3) float32 in [0, 1], one per camera

and, where a study has to know more to run again what changed,

    configuration() -> {"train": {...}, "render": {...}}     settings of the machine that models, and renders, depend on
    RENDERERS: tuple[str, ...]                               modules beside its own that draw its models

and, where it compiles something, `warm() -> None`, which does so, into a cache: a study calls it once before training.

`train` fills the empty folder `out`, and nothing outside it; the caller moves `out` into place when it returns.
Evaluation is shared (`_evaluate.py`): a backend never sees a test image and never scores itself.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..scenes.types import Cameras, Points

# Where a training may start: see _points. A program may do without any points too.
SOURCES = ("auto", "scene", "selected", "sweep", "rays", "random")
WITHOUT = "none"

# Options that mean the same for every backend that has them, so that a line of a study holds for all: where a training
# starts (a source of _points; str), how many primitives there may be (int), the degree of the spherical harmonics
# (int), and the grey level behind everything, from 0 for black to 1 for white (float).
SHARED = {"points": str, "gaussians": int, "sh_degree": int, "background": float}


@dataclass(frozen=True)
class Capabilities:
    """What the harness may ask of a backend."""

    device: str = "cpu"  # "cpu" or "cuda": a study gives each "cuda" job one GPU
    iterations: bool = True  # obeys Budget.iterations
    seconds: bool = True  # obeys Budget.seconds
    resumes: bool = False  # takes up a killed run where it was
    deterministic: bool = True  # same seed and threads, same model
    default_iterations: int = 30_000  # where a command line names no budget; 30,000 is the 3DGS paper's
    options: dict[str, Any] = field(default_factory=dict)  # its options with their defaults


class Images(Protocol):
    """K pictures of one size, (H, W, 3) float32 in [0, 1] each, one at a time: they need not fit into memory at once.

    An array (K, H, W, 3) is one too; `np.asarray` makes one of any.
    """

    @property
    def shape(self) -> tuple[int, ...]: ...  # (K, H, W, 3)

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> np.ndarray: ...

    def __iter__(self) -> Iterator[np.ndarray]: ...

    def __array__(self) -> np.ndarray: ...


@dataclass(frozen=True)
class TrainingSet:
    """The chosen views, and beside them only what is the same for every choice."""

    scene: str
    names: tuple[str, ...]  # K frame names in the order chosen
    cameras: Cameras  # K cameras, scaled to the size of the images
    images: Images  # (K, H, W, 3) float32 in [0, 1]; until `train` returns
    points: Points | None  # of the scene file; `seen_by` indexes the training split
    chosen: np.ndarray  # (K,) int64 indices of the chosen views in the training split
    training: Cameras  # the poses of all N training views: what `_surroundings.py` goes by, whatever was chosen


@dataclass(frozen=True)
class Budget:
    """Whichever limit comes first; at least one is set. Seconds are wall time without set-up and without probes."""

    iterations: int | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class Job:
    """One training: with which backend, for how long, at which size."""

    backend: str
    seed: int
    budget: Budget
    width: int | None = None  # pixels that images are resized to; None keeps them
    options: dict[str, Any] = field(default_factory=dict)  # of the backend; those left out have their defaults
    curve: bool = True  # whether a few test views are scored on the way


# probe(render) -> mean test PSNR in dB of a few test views: `render` maps Cameras to images. The time it takes is
# not the backend's. None where no curve is wanted.
Probe = Callable[[Callable[[Cameras], Iterator[np.ndarray]]], float]


@dataclass(frozen=True)
class Report:
    """How a running backend tells its caller."""

    progress: Callable[[int, int | None, str], None] = lambda done, total, text: None  # step, of how many, what to show
    probe: Probe | None = None


@dataclass(frozen=True)
class Seeding:
    """What a training started from, `seeding` of `train.json`: of one shape for every backend.

    Numbers count points, those of views and depths apart. A backend that starts from nothing leaves it as it is.
    """

    points: str = "none"  # the source that was asked for: see _points
    source: str = "none"  # what they are: "scene and sweep"
    count: int = 0  # of all, those of the shell too
    of: int = 0  # how many of the scene's it may know: none where the source is for scenes without any
    scene_points: int = 0
    sweep_points: int = 0  # at depths that a plane sweep is sure of,
    guessed_points: int = 0  # and of pixels beside them
    ray_points: int = 0
    random_points: int = 0
    shell_points: int = 0  # on a sphere around everything
    sweep_views: int = 0  # that have a sure depth
    sweep_depths: int = 0  # that are sure
    fallback: str = ""  # why it was not as asked


@dataclass(frozen=True)
class Trained:
    """What `train.json` records of a training run, besides what the caller knows itself."""

    iterations: int
    seconds: float  # wall time of training: set-up (reading, compiling) and probes are not in it
    n_primitives: int | None = None
    seeding: Seeding = Seeding()
    curve: list[dict[str, float | None]] = field(default_factory=list)  # step, seconds, loss, test_psnr_db
    device: str = "cpu"
    threads: int = 1
    peak_rss_bytes: int | None = None  # of the programs that it ran, with this process; None where it ran none
    peak_gpu_bytes: int | None = None  # None where no GPU took part, or nothing can be known
    notes: dict[str, Any] = field(default_factory=dict)
