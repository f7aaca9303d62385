"""What can be set of a training run, and to what it is set by default."""

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Options:
    """Hyperparameters; rates are per step, those of positions times the cameras' extent."""

    gaussians: int = 20000  # most primitives; scene points beyond it are sampled
    points: str = "auto"  # where they start: auto, scene, selected, rays
    degree: int = 1  # of spherical harmonics
    opacity: float = 0.8  # at the start
    scale: float = 0.6  # at the start, times the spacing of the points
    rate_mean: float = 1e-3
    rate_mean_end: float = 0.01  # share of rate_mean that is left at the end
    rate_scale: float = 0.02
    rate_quaternion: float = 2e-3
    rate_opacity: float = 0.025
    rate_colour: float = 7e-3
    rate_sh: float = 3e-3
    rate_end: float = 0.3  # share of the other rates that is left at the end
    ssim: float = 0.2
    opacity_weight: float = 0.0
    scale_weight: float = 0.0
    relocate_every: int = 100
    relocate_until: float = 0.85  # share of the budget
    near: float = 0.05  # near plane, share of the cameras' extent
    background: float = 0.0  # grey level behind everything


def defaults() -> dict[str, Any]:
    """Options by name."""
    return {item.name: item.default for item in fields(Options)}
