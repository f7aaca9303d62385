"""The colour, marker and dash of each selector: the same in every figure of every study.

Colours are Okabe and Ito's, told apart by people with any colour vision; markers and dashes say it a second time.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

from ._study import FULL


@dataclass(frozen=True)
class Style:
    """How one selector is drawn."""

    colour: str
    marker: str
    dash: tuple[float, tuple[float, ...]] = (0, ())  # offset, and points on and off; solid when empty


FIXED = {
    "random": Style("#767676", "o", (0, (1, 1))),
    "uniform": Style("#0072B2", "s"),
    "coverage": Style("#009E73", "^", (0, (4, 1))),
    "logdet": Style("#CC79A7", "D", (0, (3, 1, 1, 1))),
    "logdet-sample": Style("#661100", "H", (0, (1, 2))),
    "maxmin": Style("#D55E00", "v"),
    FULL: Style("#000000", "*", (0, (6, 3))),
}
FREE = (
    Style("#E69F00", "P"),
    Style("#56B4E9", "X"),
    Style("#882255", "<"),
    Style("#999933", ">"),
    Style("#332288", "h"),
    Style("#A6761D", "p"),
    Style("#117733", "8"),
    Style("#AA4499", "d"),
)


def styles(selectors: Iterable[str]) -> dict[str, Style]:
    """A style for each name. A name that is not fixed takes the place that its own letters say; only where two such
    names of one study meet does the later of them (in the alphabet) move to the next place that is free."""
    names = list(selectors)
    chosen = {name: FIXED[name] for name in names if name in FIXED}
    taken: set[int] = set()
    for name in sorted(set(names) - set(FIXED)):
        slot = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") % len(FREE)
        while slot in taken and len(taken) < len(FREE):
            slot = (slot + 1) % len(FREE)
        taken.add(slot)
        chosen[name] = FREE[slot]
    return {name: chosen[name] for name in names}
