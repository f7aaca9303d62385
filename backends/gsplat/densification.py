"""gsplat's strategies, which add and remove Gaussians while they are trained, on a schedule for any length of run."""

import math
from typing import Any

import torch

from ...common.errors import UserError
from .gaussians import Optimizers, Parameters

PAPER_STEPS = 30_000  # the run that the 3DGS authors' schedules are made for; shorter ones are squeezed
MCMC_REGULARISATION = 0.01  # weight of mean opacity and of mean scale in 3DGS-MCMC
MCMC_CAP = 1_000_000  # Gaussians, gsplat's default
# Steps that no run goes below: gradients of fewer views say little, and opacities need time to come back.
LEAST_REFINE, LEAST_RESET = 10, 300


class Densification:
    """One of gsplat's strategies, its schedule squeezed to the length of the run."""

    def __init__(self, options: dict[str, Any], params: Parameters, optims: Optimizers, extent: float, steps: int):
        # Where the package is not installed, a type checker takes this folder for it.
        from gsplat import DefaultStrategy, MCMCStrategy  # pyright: ignore[reportAttributeAccessIssue]

        def squeezed(step: int, least: int = 1) -> int:
            return max(least, round(step * steps / PAPER_STEPS))

        self.kind, self.most = options["strategy"], options["gaussians"]
        shared: dict[str, Any] = {"refine_start_iter": squeezed(500), "refine_every": squeezed(100, LEAST_REFINE)}
        self.strategy: Any
        if self.kind == "mcmc":
            self.strategy = MCMCStrategy(cap_max=self.most or MCMC_CAP, refine_stop_iter=squeezed(25_000), **shared)
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
        """Adds and removes Gaussians in `params`; comes after the optimizers' step.

        Raises UserError when none is left.
        """
        if self.kind == "mcmc":
            rate = self.optims["means"].param_groups[0]["lr"]
            self.strategy.step_post_backward(self.params, self.optims, self.state, step, info, lr=rate)
        else:
            self._default_step(step, info)
        if not len(self.params["means"]):
            raise UserError(
                f"at step {step} no Gaussian was opaque enough to be kept; start from other or more points, "
                "or set strategy=mcmc, which removes none"
            )

    def _default_step(self, step: int, info: dict[str, Any]) -> None:
        full = self.most and len(self.params["means"]) >= self.most
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
