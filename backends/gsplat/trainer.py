"""Fits Gaussians to the chosen views with gsplat's rasteriser and one of its densification strategies."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch

from viewbench.backends._gaussian_ply import Gaussians
from viewbench.backends._types import Budget, Report, TrainingSet
from viewbench.backends.gsplat.gaussians import (
    MEANS_DECAY,
    Optimizers,
    Parameters,
    arrays,
    optimizers,
    parameters,
    scene_extent,
    starting,
)
from viewbench.backends.gsplat.loss import loss
from viewbench.common.errors import UserError
from viewbench.scenes.types import Cameras

PAPER_STEPS = 30_000  # the run that the 3DGS authors' schedules are made for; shorter ones are squeezed
SH_EVERY = 1000  # steps after which one more band of spherical harmonics takes part
MCMC_REGULARISATION = 0.01  # weight of mean opacity and of mean scale in 3DGS-MCMC
MCMC_CAP = 1_000_000  # Gaussians, gsplat's default
# Steps that no run goes below: gradients of fewer views say little, and opacities need time to come back.
LEAST_REFINE, LEAST_RESET = 10, 300
NEAR = 0.01  # scene units, gsplat's own default
CURVE_POINTS = 20
RESIDENT_SHARE = 0.25  # of the free GPU memory that images may take; above, each is sent when it is used
BACKGROUNDS = {"black": 0.0, "white": 1.0}


class Renderer:
    """Calls gsplat's rasterization with our cameras."""

    def __init__(self, rasterize: Callable, device: str, background: str, near: float):
        self.rasterize, self.device = rasterize, device
        self.background = torch.full((1, 3), BACKGROUNDS[background], device=device)
        self.near = near or NEAR

    def parameters(self, gaussians: Gaussians) -> Parameters:
        """The Gaussians on the device."""
        return parameters(gaussians, self.device)

    def render(self, params: Parameters, camera: Cameras, degree: int) -> tuple[torch.Tensor, dict[str, Any]]:
        """(H, W, 3) image of the first camera, not clamped, and what the strategies need to know of it."""
        intrinsics = np.array([[camera.fx[0], 0, camera.cx[0]], [0, camera.fy[0], camera.cy[0]], [0, 0, 1]])
        image, _, info = self.rasterize(
            means=params["means"],
            quats=params["quats"],
            scales=params["scales"].exp(),
            opacities=params["opacities"].sigmoid(),
            colors=torch.cat([params["sh0"], params["shn"]], dim=1),
            viewmats=self._tensor(camera.world_to_camera()[:1]),
            Ks=self._tensor(intrinsics[None]),
            width=int(camera.width[0]),
            height=int(camera.height[0]),
            near_plane=self.near,
            sh_degree=degree,
            packed=False,
            backgrounds=self.background,
        )
        return image[0], info

    @torch.no_grad()
    def images(self, params: Parameters, cameras: Cameras, degree: int) -> Iterator[np.ndarray]:
        """(H, W, 3) float32 in [0, 1], one for each camera."""
        for camera in cameras:
            yield self.render(params, camera, degree)[0].clamp(0, 1).cpu().numpy()

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(array).to(self.device, torch.float32)


class Densification:
    """One of gsplat's strategies, its schedule squeezed to the length of the run."""

    def __init__(self, options: dict[str, Any], params: Parameters, optims: Optimizers, extent: float, steps: int):
        from gsplat import DefaultStrategy, MCMCStrategy

        def squeezed(step: int, least: int = 1) -> int:
            return max(least, round(step * steps / PAPER_STEPS))

        self.kind, self.cap = options["strategy"], options["cap"]
        shared = {"refine_start_iter": squeezed(500), "refine_every": squeezed(100, LEAST_REFINE)}
        self.strategy: Any
        if self.kind == "mcmc":
            self.strategy = MCMCStrategy(cap_max=self.cap or MCMC_CAP, refine_stop_iter=squeezed(25_000), **shared)
            self.state = self.strategy.initialize_state()
        else:
            self.strategy = DefaultStrategy(
                refine_stop_iter=squeezed(15_000), reset_every=squeezed(3000, LEAST_RESET), **shared
            )
            self.state = self.strategy.initialize_state(scene_scale=extent)
            self.growth = self.strategy.grow_grad2d
        self.params, self.optims = params, optims
        self.strategy.check_sanity(params, optims)

    def before_backward(self, step: int, info: dict[str, Any]) -> None:
        self.strategy.step_pre_backward(self.params, self.optims, self.state, step, info)

    def after_step(self, step: int, info: dict[str, Any]) -> None:
        """Adds and removes Gaussians in `params`; comes after the optimizers' step."""
        if self.kind == "mcmc":
            rate = self.optims["means"].param_groups[0]["lr"]
            self.strategy.step_post_backward(self.params, self.optims, self.state, step, info, lr=rate)
            return
        full = self.cap and len(self.params["means"]) >= self.cap
        self.strategy.grow_grad2d = math.inf if full else self.growth  # pruning goes on
        self.strategy.step_post_backward(self.params, self.optims, self.state, step, info, packed=False)
        if 0 < step < self.strategy.refine_stop_iter and step % self.strategy.reset_every == 0:
            # gsplat 1.5.3 never gets here by itself: it tests `step % reset_every == 0 & step > 0`, in which `&`
            # binds first. Where a version does, doing it twice changes nothing.
            from gsplat.strategy.ops import reset_opa

            reset_opa(self.params, self.optims, self.state, value=2 * self.strategy.prune_opa)

    def regularisation(self) -> torch.Tensor | float:
        """What 3DGS-MCMC adds to the loss, so that Gaussians which do nothing vanish."""
        if self.kind != "mcmc":
            return 0.0
        small = self.params["opacities"].sigmoid().mean() + self.params["scales"].exp().mean()
        return MCMC_REGULARISATION * small


def fit(
    data: TrainingSet,
    xyz: np.ndarray,
    rgb: np.ndarray,
    seed: int,
    budget: Budget,
    options: dict[str, Any],
    report: Report,
    *,
    device: str,
    rasterize: Callable,
) -> tuple[Gaussians, dict[str, Any]]:
    """Trains from the points `xyz` (P, 3), `rgb` (P, 3) uint8; returns the Gaussians and fields of `Trained`.

    A run limited by seconds alone follows the schedule of 30,000 steps as far as it gets.
    Raises UserError when the device's memory is full.
    """
    torch.manual_seed(seed)
    steps = budget.iterations or PAPER_STEPS
    extent = scene_extent(data.cameras)
    renderer = Renderer(rasterize, device, options["background"], data.near)
    params = renderer.parameters(starting(xyz, rgb, options["strategy"], options["sh_degree"], extent))
    try:
        run = _run(data, params, extent, steps, seed, budget, options, report, renderer)
    except torch.cuda.OutOfMemoryError:
        raise UserError(
            f"the GPU's memory is full with {len(params['means'])} Gaussians and {len(data.names)} views of "
            f"{data.cameras.width[0]} pixels width; train at a smaller width, or set a smaller cap on them"
        ) from None
    used = torch.cuda.get_device_name(device) if device.startswith("cuda") else device
    return arrays(params), {
        **run,
        "n_primitives": len(params["means"]),
        "device": used,
        "threads": torch.get_num_threads(),
    }


def _run(
    data: TrainingSet,
    params: Parameters,
    extent: float,
    steps: int,
    seed: int,
    budget: Budget,
    options: dict[str, Any],
    report: Report,
    renderer: Renderer,
) -> dict[str, Any]:
    optims = optimizers(params, extent)
    densification = Densification(options, params, optims, extent, steps)
    decay = torch.optim.lr_scheduler.ExponentialLR(optims["means"], gamma=MEANS_DECAY ** (1 / steps))
    images = _images(data.images, renderer.device)
    order = _order(len(data.names), np.random.default_rng(seed))
    with torch.no_grad():
        renderer.render(params, data.cameras[0], 0)  # loads the kernels, which is not training
    clock, curve, step = _Clock(renderer.device), [], 0
    while step < steps and (budget.seconds is None or clock.seconds() < budget.seconds):
        index = next(order)
        degree = min(options["sh_degree"], step * PAPER_STEPS // (SH_EVERY * steps))
        image, info = renderer.render(params, data.cameras[index], degree)
        value = loss(image, images[index].to(renderer.device, non_blocking=True))
        densification.before_backward(step, info)
        (value + densification.regularisation()).backward()
        for optimizer in optims.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        decay.step()
        densification.after_step(step, info)
        step += 1
        if step % max(1, steps // CURVE_POINTS) == 0 or step == steps:
            curve.append(_point(step, value, params, degree, renderer, clock, report))
            report.progress(step, steps, f"loss {curve[-1]['loss']:.4f}, {len(params['means'])} Gaussians")
    return {"iterations": step, "seconds": clock.seconds(), "curve": curve}


def _point(
    step: int,
    value: torch.Tensor,
    params: Parameters,
    degree: int,
    renderer: Renderer,
    clock: "_Clock",
    report: Report,
) -> dict[str, float | None]:
    """One point of the curve; the time that its renders take is not the training's."""
    seconds = clock.stop()
    psnr = report.probe(lambda cameras: renderer.images(params, cameras, degree)) if report.probe else None
    clock.start()
    return {"step": step, "seconds": seconds, "loss": float(value.detach()), "test_psnr_db": psnr}


class _Clock:
    """Seconds of training; waits for the GPU before it is read."""

    def __init__(self, device: str):
        self.waits = device.startswith("cuda")
        self.passed = 0.0
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
        if self.waits:
            torch.cuda.synchronize()
        return time.perf_counter()


def _images(images: np.ndarray, device: str) -> torch.Tensor:
    """The views on the GPU where they take a small part of what is free there; else in main memory, sent one by one."""
    tensor = torch.from_numpy(images)
    if not device.startswith("cuda"):
        return tensor
    free, _ = torch.cuda.mem_get_info(device)
    return tensor.to(device) if tensor.nbytes < RESIDENT_SHARE * free else tensor


def _order(count: int, rng: np.random.Generator) -> Iterator[int]:
    """Endless passes over the views, each in a new random order."""
    while True:
        yield from rng.permutation(count).tolist()
