"""Snapshots of a training run, so that one that was killed goes on where it was, to the same bytes."""

import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...common.files import whole
from .backward import Moments

FILE = "snapshot.npz"


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
        with whole(folder / FILE) as temporary, open(temporary, "wb") as file:
            np.savez(file, gaussians=self.gaussians, **self.moments._asdict(), plain=json.dumps(plain))

    @staticmethod
    def load(folder: Path) -> "State | None":
        """The snapshot in the folder; None where there is none that can be read."""
        try:
            with np.load(folder / FILE, allow_pickle=False) as stored:
                plain = json.loads(str(stored["plain"]))
                rng = np.random.default_rng()
                rng.bit_generator.state = plain.pop("rng")
                return State(stored["gaussians"], Moments(stored["first"], stored["second"]), rng, **plain)
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            return None

    @staticmethod
    def forget(folder: Path) -> None:
        """Removes the snapshot of a run that is finished."""
        (folder / FILE).unlink(missing_ok=True)
