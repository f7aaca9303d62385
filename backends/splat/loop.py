"""The training loop: one random view a step, learning rates that fall over the budget, relocation now and then."""

import dataclasses
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...common import threads
from ...common.errors import UserError
from ...common.files import write_json
from ...scenes.types import Cameras
from .. import _snapshot
from .._points import knowing
from .._surroundings import surroundings
from .._types import Budget, Report, Trained, TrainingSet
from . import layout, ply
from .backward import Moments, Rates
from .initial import initial
from .options import Options, Rendering
from .projection import camera_vectors
from .relocate import relocate
from .renderer import Renderer
from .snapshot import State
from .stages import Stage, halved
from .team import Team
from .trainer import Weights

CURVE_POINTS = 10
ROUND = 100  # steps that the loss of a point of the curve is averaged over, at most
SNAPSHOT_S = 10.0
CHECK_EVERY = 20  # steps between looks at the clock


def train(data: TrainingSet, out: Path, seed: int, budget: Budget, options: dict, report: Report) -> Trained:
    """Trains on the chosen views and writes out/model.ply; takes up the snapshot of a killed run that it finds there.

    Raises UserError for views that cannot be trained on and for a training that diverged.
    """
    entered = time.perf_counter()
    o = Options(**options)
    _check(data)
    data = knowing(data, o.points)
    around = surroundings(data.training, data.points)
    views = len(data.images)
    rng = np.random.default_rng(seed)
    gaussians, seeding = initial(data, o, around, rng)
    if views < 2 and not (seeding.scene_points or seeding.random_points):
        raise UserError(f"{views} view and no points: nothing says how deep the scene is; choose at least 2 views")
    rendering = Rendering(o.near * around.nearest, o.background, o.sh_degree, o.low_pass, o.antialias)
    team = Team(threads.allowed())
    full = Stage(data.images, data.cameras, gaussians.shape[1], rendering, team)
    coarse = halved(data, gaussians.shape[1], rendering, team) if o.coarse else None
    first_rates, last = _rates(o, around.extent)
    weights = Weights(o.ssim, o.opacity_weight / gaussians.shape[1], o.scale_weight / gaussians.shape[1])
    # A step on copies loads the kernels, which is set-up and not training.
    moments, rates = Moments.zeros(gaussians), Rates.of_step(1, first_rates)
    full.trainer.step(gaussians.copy(), moments, full.cameras[0], full.target(0), rates, Weights(o.ssim, 1e-9, 1e-9))
    setup = time.perf_counter() - entered
    state = State.load(out) or State(gaussians, Moments.zeros(gaussians), rng)
    saved = began = time.perf_counter() - state.seconds
    while (share := _share(state.step, state.seconds, budget)) < 1:
        if not state.order:
            state.order = state.rng.permutation(views).tolist()
        view = state.order.pop()
        state.step += 1
        rates = Rates.of_step(state.step, first_rates * last**share)
        stage = coarse if coarse and share < o.coarse else full
        camera, target = stage.cameras[view], stage.target(view)
        loss = stage.trainer.step(state.gaussians, state.moments, camera, target, rates, weights)
        state.losses = [*state.losses[1 - min(views, ROUND) :], loss] if views > 1 else [loss]
        if state.step % o.relocate_every == 0 and share < o.relocate_until:
            state.relocated += relocate(state.gaussians, state.moments, state.rng)
        if state.step % CHECK_EVERY and state.step != budget.iterations:
            continue
        state.seconds = time.perf_counter() - began
        paused = time.perf_counter()
        share = _share(state.step, state.seconds, budget)
        if share >= 1 or share * CURVE_POINTS >= len(state.curve) + 1:
            point = _point(state, report, rendering)
            state.curve.append(point)
            decibels = point["test_psnr_db"]
            text = f"loss {point['loss']:.4f}" + (f", {decibels:.2f} dB" if decibels is not None else "")
            report.progress(state.step, budget.iterations, text)
        if paused - saved > SNAPSHOT_S:
            state.save(out)
            saved = time.perf_counter()
        began += time.perf_counter() - paused
    model = _finite(state.gaussians)
    ply.write(out / "model.ply", model)
    write_json(out / "splat.json", dataclasses.asdict(rendering))
    _snapshot.forget(out)
    return Trained(
        iterations=state.step,
        seconds=state.seconds,
        n_primitives=model.shape[1],
        threads=team.threads,
        seeding=seeding,
        curve=state.curve,
        notes={"relocated": state.relocated, "setup_seconds": setup},
    )


def _check(data: TrainingSet) -> None:
    if not all(np.isfinite(image).all() for image in data.images):
        raise UserError("the training images have NaN or infinite pixels")


def _point(state: State, report: Report, rendering: Rendering) -> dict[str, float | None]:
    """A point of the curve; the test views are looked at for it and for nothing else."""
    gaussians = _finite(state.gaussians)
    return {
        "step": state.step,
        "seconds": state.seconds,
        "loss": float(np.mean(state.losses)),
        "test_psnr_db": report.probe(lambda asked: draw(gaussians, asked, rendering)) if report.probe else None,
    }


def _finite(gaussians: np.ndarray) -> np.ndarray:
    """Without the primitives that have NaN, so that none is ever written. Raises UserError when none is left."""
    good = np.isfinite(gaussians).all(axis=0)
    if not good.any():
        raise UserError("training diverged: every primitive has NaN; lower the learning rates")
    return gaussians if good.all() else np.ascontiguousarray(gaussians[:, good])


def draw(gaussians: np.ndarray, cameras: Cameras, rendering: Rendering) -> Iterator[np.ndarray]:
    """Pictures (H, W, 3) in [0, 1] of the cameras, one after another; the degree is that of the Gaussians."""
    rendering = dataclasses.replace(rendering, degree=layout.degree_of(gaussians))
    own = threading.local()  # a renderer for each thread

    def picture(seen: tuple[np.ndarray, tuple[int, int]]) -> np.ndarray:
        vector, size = seen
        if getattr(own, "size", None) != size:
            own.size, own.renderer = size, Renderer(gaussians.shape[1], *size, rendering)
        return np.ascontiguousarray(np.clip(own.renderer.draw(gaussians, vector), 0, 1).transpose(1, 2, 0))

    sizes = [(int(camera.width[0]), int(camera.height[0])) for camera in cameras]
    return threads.over(picture, list(zip(camera_vectors(cameras), sizes, strict=True)))


def _share(step: int, seconds: float, budget: Budget) -> float:
    """How much of the budget is spent, of whichever limit is nearer."""
    by_step = step / budget.iterations if budget.iterations else 0.0
    by_time = seconds / budget.seconds if budget.seconds else 0.0
    return max(by_step, by_time)


def _rates(o: Options, extent: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates per row at the start, and the factor to which each falls."""
    rates = np.zeros(layout.rows(o.sh_degree))
    last = np.full(len(rates), o.rate_end)
    rates[layout.MEAN : layout.MEAN + 3] = o.rate_mean * extent
    last[layout.MEAN : layout.MEAN + 3] = o.rate_mean_end
    rates[layout.QUATERNION : layout.QUATERNION + 4] = o.rate_quaternion
    rates[layout.LOG_SCALE : layout.LOG_SCALE + 3] = o.rate_scale
    rates[layout.LOGIT] = o.rate_opacity
    rates[layout.SH0 : layout.SH0 + 3] = o.rate_colour
    rates[layout.SH1 :] = o.rate_sh
    return rates, last
