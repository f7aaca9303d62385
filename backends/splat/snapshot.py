"""Snapshots of a training run, so that one that was killed goes on where it was, to the same bytes."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import _snapshot
from .backward import Moments


@dataclass
class State:
    """Everything that a step changes."""

    gaussians: np.ndarray  # (rows, N) float32
    moments: Moments
    rng: np.random.Generator
    step: int = 0
    seconds: float = 0.0
    relocated: int = 0
    order: list[int] = field(default_factory=list)  # views left of this round
    losses: list[float] = field(default_factory=list)  # of the last round
    curve: list[dict] = field(default_factory=list)

    def save(self, folder: Path) -> None:
        """Writes the snapshot, whole or not at all."""
        plain = {name: getattr(self, name) for name in ("step", "seconds", "relocated", "order", "losses", "curve")}
        plain["rng"] = self.rng.bit_generator.state
        _snapshot.write(folder, {"gaussians": self.gaussians, **self.moments._asdict()}, plain)

    @staticmethod
    def load(folder: Path) -> "State | None":
        """The snapshot in the folder; None where there is none that can be read."""

        def made(arrays: dict[str, np.ndarray], plain: dict[str, Any]) -> State:
            rng = np.random.default_rng()
            rng.bit_generator.state = plain.pop("rng")
            return State(arrays["gaussians"], Moments(arrays["first"], arrays["second"]), rng, **plain)

        return _snapshot.read(folder, made)
