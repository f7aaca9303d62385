"""The training loop: one random view a step, learning rates that fall over the budget, relocation now and then."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from viewbench.backends._types import Budget, Report, Trained, TrainingSet
from viewbench.backends.splat import layout, ply
from viewbench.backends.splat.engine import Engine
from viewbench.backends.splat.options import Options
from viewbench.backends.splat.projection import camera_vectors
from viewbench.backends.splat.relocate import relocate
from viewbench.backends.splat.seeding import camera_extent, seed
from viewbench.common.errors import UserError
from viewbench.common.files import write_json
from viewbench.scenes.types import Cameras

CURVE_POINTS = 10
CHECK_EVERY = 20  # steps between looks at the clock


def train(data: TrainingSet, out: Path, seed_: int, budget: Budget, options: dict, report: Report) -> Trained:
    """Trains on the chosen views and writes out/model.ply. Raises UserError for views that cannot be trained on."""
    o = Options(**options)
    views, height, width, _ = data.images.shape
    if views < 2 and (data.points is None or not len(data.points)):
        raise UserError(f"{views} view and no points: nothing says how deep the scene is; choose at least 2 views")
    if not np.isfinite(data.images).all():
        raise UserError("the training images have NaN or infinite pixels")
    rng = np.random.default_rng(seed_)
    gaussians, seeding = seed(data, o.gaussians, o.points, rng, o.opacity, o.scale)
    extent = camera_extent(data)
    cameras = camera_vectors(data.cameras)
    near = o.near * extent
    engine = Engine(gaussians.shape[1], width, height, near, o.background)
    targets = [engine.planes.target(image) for image in data.images]
    moments = np.zeros_like(gaussians), np.zeros_like(gaussians)
    first_rates, last = _rates(o, extent)
    trial = gaussians.copy(), (moments[0].copy(), moments[1].copy())
    engine.step(*trial, cameras[0], targets[0], o.degree, first_rates, 1, o.ssim, 1e-9, 1e-9)  # loads the kernels
    curve: list[dict[str, float | None]] = []
    order: list[int] = []
    step, relocated, loss, seconds = 0, 0, float("nan"), 0.0
    running: list[float] = []
    next_point = 1
    began = time.perf_counter()
    while True:
        share = _share(step, seconds, budget)
        if share >= 1:
            break
        rates = (first_rates * last**share).astype(np.float32)
        if not order:
            order = rng.permutation(views).tolist()
        view = order.pop()
        step += 1
        loss = engine.step(
            gaussians,
            moments,
            cameras[view],
            targets[view],
            o.degree,
            rates,
            step,
            o.ssim,
            o.opacity_weight / gaussians.shape[1],
            o.scale_weight / gaussians.shape[1],
        )
        running.append(loss)
        if step % o.relocate_every == 0 and share < o.relocate_until:
            relocated += relocate(gaussians, moments, rng)
        if step % CHECK_EVERY == 0 or step == budget.iterations:
            seconds = time.perf_counter() - began
            share = _share(step, seconds, budget)
            if share * CURVE_POINTS >= next_point or share >= 1:
                next_point = int(share * CURVE_POINTS) + 1
                point = {
                    "step": step,
                    "seconds": seconds,
                    "loss": float(np.mean(running[-views:])),
                    "test_psnr_db": None,
                }
                paused = time.perf_counter()
                if report.probe is not None:
                    point["test_psnr_db"] = report.probe(
                        lambda asked: draw(gaussians, asked, near, o.background, o.degree)
                    )
                curve.append(point)
                text = f"loss {point['loss']:.4f}" + (
                    f", {point['test_psnr_db']:.2f} dB" if point["test_psnr_db"] else ""
                )
                report.progress(step, budget.iterations, text)
                began += time.perf_counter() - paused
    if not np.isfinite(gaussians).all():
        bad = ~np.isfinite(gaussians).all(axis=0)
        gaussians = gaussians[:, ~bad]
        if not gaussians.shape[1]:
            raise UserError("training diverged: every primitive has NaN; lower the learning rates")
    ply.write(out / "model.ply", gaussians)
    write_json(out / "splat.json", {"near": near, "background": o.background, "degree": o.degree})
    return Trained(
        iterations=step,
        seconds=seconds,
        n_primitives=gaussians.shape[1],
        seeding=seeding,
        curve=curve,
        notes={"relocated": relocated},
    )


def draw(gaussians: np.ndarray, cameras: Cameras, near: float, background: float, degree: int) -> Iterator[np.ndarray]:
    """Pictures (H, W, 3) in [0, 1] of the cameras, one after another."""
    engine: Engine | None = None
    for vector, camera in zip(camera_vectors(cameras), cameras, strict=True):
        size = int(camera.width[0]), int(camera.height[0])
        if engine is None or (engine.width, engine.height) != size:
            engine = Engine(gaussians.shape[1], *size, near, background)
        picture = engine.draw(gaussians, vector, degree)
        yield np.ascontiguousarray(np.clip(picture, 0, 1).transpose(1, 2, 0))


def _share(step: int, seconds: float, budget: Budget) -> float:
    """How much of the budget is spent, of whichever limit is nearer."""
    by_step = step / budget.iterations if budget.iterations else 0.0
    by_time = seconds / budget.seconds if budget.seconds else 0.0
    return max(by_step, by_time)


def _rates(o: Options, extent: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates per row at the start, and the factor to which each falls."""
    rates = np.zeros(layout.ROWS)
    last = np.full(layout.ROWS, o.rate_end)
    rates[layout.MEAN : layout.MEAN + 3] = o.rate_mean * extent
    last[layout.MEAN : layout.MEAN + 3] = o.rate_mean_end
    rates[layout.QUATERNION : layout.QUATERNION + 4] = o.rate_quaternion
    rates[layout.LOG_SCALE : layout.LOG_SCALE + 3] = o.rate_scale
    rates[layout.LOGIT] = o.rate_opacity
    rates[layout.SH0 : layout.SH0 + 3] = o.rate_colour
    rates[layout.SH1 :] = o.rate_sh if o.degree else 0.0
    return rates, last
