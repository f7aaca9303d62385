"""Points with their colours, and what says that something is there."""

from dataclasses import dataclass

import numpy as np

# scene: of the scene's file; sweep: a depth that a sweep is sure of; guessed: of a pixel beside such; ray: at random on
# its ray; random: anywhere.
KINDS = ("scene", "sweep", "guessed", "ray", "random")
# Opacity of primitives at points whose depth is guessed: almost transparent, so that they fade where it is wrong.
FAINT = {"guessed": 0.1, "ray": 0.03}
FEWEST = 500  # scene points, or sure depths, that are worth starting from


@dataclass(frozen=True)
class Start:
    """P points of one kind."""

    points: np.ndarray  # (P, 3) float64, scene units
    colours: np.ndarray  # (P, 3) float64 in [0, 1]
    kind: str  # of KINDS

    def __len__(self) -> int:
        return len(self.points)


def joined(starts: list[Start]) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) positions and (P, 3) colours of all."""
    return np.concatenate([start.points for start in starts]), np.concatenate([start.colours for start in starts])
