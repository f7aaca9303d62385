"""What MLflow is told of a study besides its cells: words, order, colours, and how a ratio becomes a step."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ._study import FULL, in_order, percent
from ._style import styles

UNTAKEN = re.compile(r"[^/\w.\- :]")  # in the name of a metric, by MLflow
WHOLE = 1e-6  # of a percent: a share this near to a whole one is one


@dataclass(frozen=True)
class About:
    """A study as its dashboard needs it."""

    name: str  # of the experiment
    title: str
    description: str
    source: str  # what was run: "viewbench run quick.yaml"
    selectors: tuple[str, ...]  # in the order of the study, without the full-data reference
    grid: tuple[Mapping[str, str], ...]  # all cells, by common.cells.AXES
    places: Mapping[str, str] = field(default_factory=dict)  # where scenes lie, as settings write it
    ours: bool = True  # whether who logs it made it

    @cached_property
    def backends(self) -> list[str]:
        """The backends of the grid, in its order."""
        return in_order(cell["backend"] for cell in self.grid)

    @cached_property
    def colours(self) -> dict[str, str]:
        """The colour of each selector in the figures, as #RRGGBB."""
        return {name: style.colour for name, style in styles((*self.selectors, FULL)).items()}

    @cached_property
    def unit(self) -> int:
        """Steps of a percent: 1 where all ratios are whole percents, else 100."""
        ratios = {100 * float(cell["ratio"]) for cell in self.grid}
        return 1 if all(abs(ratio - round(ratio)) < WHOLE for ratio in ratios) else 100

    def step(self, ratio: str) -> int:
        """A ratio as MLflow's step, which is a whole number."""
        return round(100 * float(ratio) * self.unit)

    def ratios_of(self, backend: str, scene: str) -> list[str]:
        """Ratios of the selectors that a backend trains on a scene, ascending."""
        found = {
            cell["ratio"]
            for cell in self.grid
            if cell["selector"] != FULL and (cell["backend"], cell["scene"]) == (backend, scene)
        }
        return sorted(found, key=float)

    def place(self, backend: str, scene: str) -> str:
        """ "room_human", and "room_human · gsplat" where that is not the first of the backends."""
        return scene if backend == self.backends[0] else f"{scene} · {backend}"

    def cell_title(self, cell: Mapping[str, str]) -> str:
        """ "maxmin 5 % #0 · room_human"."""
        ratio = "" if cell["selector"] == FULL else f" {percent(float(cell['ratio']))}"
        return f"{cell['selector']}{ratio} #{cell['seed']} · {self.place(cell['backend'], cell['scene'])}"

    def summary_title(self, backend: str, scene: str, selector: str) -> str:
        """ "maxmin · room_human"."""
        return f"{selector} · {self.place(backend, scene)}"

    def panel(self, backend: str, scene: str, metric: str = "psnr_db") -> str:
        """The metric that draws a panel of a figure, which has its name: only the summaries of one scene and backend
        have it. The paper's Figure 4 has those of `psnr_db`."""
        name = f"{metric}/{scene}" if backend == self.backends[0] else f"{metric}/{scene}/{backend}"
        return UNTAKEN.sub("_", name)

    def panels(self) -> list[tuple[str, str]]:
        """(backend, scene) pairs in the order of the grid."""
        return in_order((cell["backend"], cell["scene"]) for cell in self.grid)


def of_study(
    record: Mapping[str, Any],
    grid: Iterable[Mapping[str, str]],
    called: str,
    place: Callable[[str], str] = lambda scene: scene,
) -> About:
    """Of a study that `viewbench run CALLED` runs, and whose file reads `record` when its defaults are filled in;
    `place` says where a scene lies."""
    return About(
        name=record["name"],
        title=record["title"],
        description=record["description"],
        source=f"viewbench run {called}",
        selectors=tuple(entry["name"] for entry in record["selectors"]),
        grid=tuple(grid),
        places={scene: place(scene) for scene in record["scenes"]},
    )
