"""Fits Gaussians to the chosen views with gsplat's rasteriser and one of its densification strategies."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...common.errors import PassingError
from .. import _snapshot
from .._gaussian_ply import Gaussians
from .._points import Start
from .._surroundings import NEAR_PLANE, Surroundings
from .._types import Budget, Images, Report, TrainingSet
from .densification import PAPER_STEPS, Densification
from .gaussians import (
    MEANS_DECAY,
    Parameters,
    arrays,
    initial,
    optimizers,
)
from .loss import loss
from .renderer import Renderer
from .snapshot import State

SH_EVERY = 1000  # steps of PAPER_STEPS after which one more band of spherical harmonics takes part
CURVE_POINTS = 20
SNAPSHOT_S = 60.0  # between snapshots, of which one takes as long as some hundred steps
RESIDENT_SHARE = 0.25  # of the free GPU memory that images may take; above, each is sent when it is used


@dataclass(frozen=True)
class Task:
    """What is to be trained, as the backend was asked."""

    data: TrainingSet
    around: Surroundings
    out: Path  # where the snapshot is that the run may go on from
    seed: int
    budget: Budget
    options: dict[str, Any]
    report: Report


def fit(task: Task, starts: list[Start], device: str, rasterize: Callable) -> tuple[Gaussians, float, dict[str, Any]]:
    """Trains from the points; returns Gaussians, near plane in scene units and fields of `Trained`.

    A run limited by seconds alone follows the schedule of 30,000 steps as far as it gets.
    Raises PassingError when the device's memory is full.
    """
    torch.manual_seed(task.seed)
    # SSIM's variances are differences of nearly equal numbers, of which TF32's 10 bits leave nothing.
    torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = False
    data, options, extent = task.data, task.options, task.around.extent
    renderer = Renderer(rasterize, device, options["background"], NEAR_PLANE * task.around.nearest)
    params = renderer.parameters(initial(starts, options["strategy"], options["sh_degree"], extent))
    try:
        state = _run(task, params, extent, renderer)
    except torch.cuda.OutOfMemoryError:
        raise PassingError(
            f"the GPU's memory is full with {len(params['means'])} Gaussians and {len(data.names)} views of "
            f"{data.cameras.width[0]} pixels width; train at a smaller width, or set gaussians to fewer"
        ) from None
    on_gpu = device.startswith("cuda")
    found = {
        "iterations": state.step,
        "seconds": state.seconds,
        "curve": state.curve,
        "n_primitives": len(params["means"]),
        "device": torch.cuda.get_device_name(device) if on_gpu else device,
        "threads": torch.get_num_threads(),
        "peak_gpu_bytes": max(state.peak_gpu_bytes, torch.cuda.max_memory_allocated(device)) if on_gpu else None,
    }
    return arrays(params), renderer.near, found


def _run(task: Task, params: Parameters, extent: float, renderer: Renderer) -> State:
    """Changes `params` in place, step by step; returns where it ended."""
    data, limit = task.data, task.budget.seconds
    steps = task.budget.iterations or PAPER_STEPS
    optims = optimizers(params, extent)
    densification = Densification(task.options, params, optims, extent, steps)
    state = State(np.random.default_rng(task.seed))
    state.load(task.out, params, optims, densification)
    decay = MEANS_DECAY ** (1 / steps)
    images = _images(data.images, renderer.device)
    with torch.no_grad():
        renderer.render(params, data.cameras[0], 0)  # loads the kernels, which is not training
    clock, done, saved = _Clock(renderer.device, state.seconds), False, time.monotonic()
    while not done:
        index = state.next_view(len(data.names))
        degree = min(task.options["sh_degree"], state.step * PAPER_STEPS // (SH_EVERY * steps))
        image, info = renderer.render(params, data.cameras[index], degree)
        value = loss(image, images(index))
        densification.before_backward(state.step, info)
        (value + densification.regularisation()).backward()
        for optimizer in optims.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        optims["means"].param_groups[0]["lr"] *= decay
        densification.after_step(state.step, info)
        state.step += 1
        done = state.step == steps or (limit is not None and clock.seconds() >= limit)
        reports = done or state.step % max(1, steps // CURVE_POINTS) == 0
        saves = not done and time.monotonic() - saved >= SNAPSHOT_S
        if not (reports or saves):
            continue
        state.seconds = clock.stop()  # what follows is not training
        if reports:
            error = float(value.detach())
            task.report.progress(state.step, steps, f"loss {error:.4f}, {len(params['means'])} Gaussians")
            psnr = _probe(task.report, params, degree, renderer)
            state.curve.append({"step": state.step, "seconds": state.seconds, "loss": error, "test_psnr_db": psnr})
        if saves:
            state.save(task.out, params, optims, densification)
            saved = time.monotonic()
        clock.start()
    _snapshot.forget(task.out)
    return state


def _probe(report: Report, params: Parameters, degree: int, renderer: Renderer) -> float | None:
    """Test PSNR in dB of the Gaussians as they are, where a curve is wanted."""
    return report.probe(lambda cameras: renderer.images(params, cameras, degree)) if report.probe else None


class _Clock:
    """Seconds of training; waits for the GPU before it is read."""

    def __init__(self, device: str, passed: float = 0.0):
        self.device = device
        self.passed = passed
        self.start()

    def start(self) -> None:
        self.began: float | None = self._now()

    def stop(self) -> float:
        """Stops and returns the seconds so far."""
        self.passed, self.began = self.seconds(), None
        return self.passed

    def seconds(self) -> float:
        return self.passed + (self._now() - self.began if self.began is not None else 0.0)

    def _now(self) -> float:
        if self.device.startswith("cuda"):
            torch.cuda.synchronize(self.device)
        return time.perf_counter()


def _images(images: Images, device: str) -> Callable[[int], torch.Tensor]:
    """Views on the device: all of them once where they take a small part of what is free there, else one by one."""
    if device.startswith("cuda"):
        free, _ = torch.cuda.mem_get_info(device)
        if 4 * math.prod(images.shape) < RESIDENT_SHARE * free:
            resident = torch.empty(images.shape, device=device)
            for place, image in enumerate(images):
                resident[place] = torch.from_numpy(image)
            return resident.__getitem__
    return lambda index: torch.from_numpy(images[index]).to(device)
