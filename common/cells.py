"""Where a cell of a study lies: one folder for each of its five names, from the outside in."""

from collections.abc import Mapping
from pathlib import Path

AXES = ("backend", "scene", "selector", "ratio", "seed")


def cell_name(cell: Mapping[str, str]) -> str:
    """BACKEND/SCENE/SELECTOR/RATIO/SEED."""
    return "/".join(cell[axis] for axis in AXES)


def cell_folder(results: Path, cell: Mapping[str, str]) -> Path:
    """results/STUDY/cells/BACKEND/SCENE/SELECTOR/RATIO/SEED, with `results` results/STUDY."""
    return results / "cells" / cell_name(cell)
