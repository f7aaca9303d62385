"""What can be set of a training run, and to what it is set by default; what a model must be drawn with."""

from dataclasses import dataclass, fields
from typing import Any

from ...common.errors import UserError
from .._points import SWEEP
from .._surroundings import NEAR_PLANE


@dataclass(frozen=True)
class Options:
    """Hyperparameters; rates are per step, those of positions times the extent of all training cameras.

    Raises UserError for a value out of its limits.
    """

    gaussians: int = 28000  # most primitives; points beyond it are sampled
    points: str = "auto"  # where they start: auto, scene, selected, sweep, rays, random
    sweep: float = SWEEP  # share of them that the plane sweep gives where the scene has points too
    shell: int = 500  # of them lie on a sphere around everything
    sh_degree: int = 1  # of spherical harmonics
    opacity: float = 0.4  # at the start, where the points are known
    scale: float = 0.45  # at the start, times the spacing of the points
    low_pass: float = 0.1  # pixels², variance of the filter on the screen
    antialias: bool = True  # the filter keeps a splat's light: Mip-Splatting's; False is 3DGS's
    coarse: float = 0.5  # share of the budget that goes to pictures of half the size, where they are large enough
    rate_mean: float = 6e-4
    rate_mean_end: float = 0.1  # share of rate_mean that is left at the end
    rate_scale: float = 0.05
    rate_quaternion: float = 2e-3
    rate_opacity: float = 0.08
    rate_colour: float = 0.02
    rate_sh: float = 3e-3
    rate_end: float = 0.3  # share of the other rates that is left at the end
    ssim: float = 0.2
    opacity_weight: float = 0.0
    scale_weight: float = 0.0
    relocate_every: int = 100
    relocate_until: float = 0.85  # share of the budget; 0 never relocates
    near: float = NEAR_PLANE  # near plane, share of the depth that next to nothing is nearer than
    background: float = 0.0  # grey level behind everything, 1 is white

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            if not low <= getattr(self, name) <= high:
                raise UserError(f"{name}={getattr(self, name)}: expected a value from {low} to {high}")


LIMITS = {
    "gaussians": (1, 10_000_000),
    "sweep": (0, 1),
    "shell": (0, 100_000),
    "sh_degree": (0, 3),
    "opacity": (0.005, 0.99),
    "scale": (1e-3, 1e3),
    "low_pass": (0, 100),
    "coarse": (0, 1),
    **{
        f"rate_{name}": (0, 10)
        for name in ("mean", "mean_end", "scale", "quaternion", "opacity", "colour", "sh", "end")
    },
    "ssim": (0, 1),
    "opacity_weight": (0, 100),
    "scale_weight": (0, 100),
    "relocate_every": (1, 10_000_000),
    "relocate_until": (0, 1),
    "near": (0, 1),
    "background": (0, 1),
}


def defaults() -> dict[str, Any]:
    """Options by name."""
    return {item.name: item.default for item in fields(Options)}


@dataclass(frozen=True)
class Rendering:
    """What a model must be drawn with besides a camera; the defaults are those of 3DGS."""

    near: float = 0.01  # near plane, scene units
    background: float = 0.0  # grey level
    degree: int = 1  # of spherical harmonics
    low_pass: float = 0.3  # pixels²
    antialias: bool = False
