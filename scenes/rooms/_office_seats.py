"""Chairs, a sofa and stools of `open_office`, each about the middle of its place, its front ahead."""

from ._builder import Builder
from ._spot import Spot

BLACK = (0.03, 0.032, 0.036)


def swivel(room: Builder, x: float, y: float, angle: float, cloth: str) -> None:
    """An office chair on castors."""
    at = Spot(room, x, y, angle)
    for turn in (0.0, 1.05, 2.1):
        at.box("black", (-0.29, -0.022, 0.05), (0.29, 0.022, 0.085), turn, colour=BLACK)
        spoke = Spot(room, x, y, angle + turn)
        for side in (-0.27, 0.27):
            room.sphere("black", spoke.at((side, 0, 0.027)), 0.027, (0.08, 0.08, 0.09), 8)
    at.cylinder("chrome", (0, 0, 0.085), 0.028, 0.335)
    at.box(cloth, (-0.24, -0.23, 0.42), (0.24, 0.24, 0.5), repeat=0.35)
    at.box("black", (-0.03, -0.285, 0.4), (0.03, -0.262, 0.75), colour=BLACK)
    at.box("black", (-0.03, -0.285, 0.38), (0.03, 0, 0.42), colour=BLACK)
    at.box(cloth, (-0.215, -0.262, 0.56), (0.215, -0.21, 0.98), repeat=0.35)
    for side in (-1, 1):
        at.box("black", (side * 0.265 - 0.015, -0.06, 0.44), (side * 0.265 + 0.015, 0.0, 0.64), colour=BLACK)
        at.box("smoked", (side * 0.265 - 0.03, -0.18, 0.64), (side * 0.265 + 0.03, 0.12, 0.665), repeat=0.3)


def shell_chair(room: Builder, x: float, y: float, angle: float, cloth: str) -> None:
    """A chair of the meeting table: four legs of oak, a seat and a back in cloth."""
    at = Spot(room, x, y, angle)
    for a in (-0.19, 0.19):
        for b in (-0.19, 0.19):
            at.box("oak", (a - 0.018, b - 0.018, 0), (a + 0.018, b + 0.018, 0.43), repeat=0.3)
    at.box(cloth, (-0.23, -0.22, 0.43), (0.23, 0.23, 0.48), repeat=0.3)
    at.box(cloth, (-0.22, -0.24, 0.46), (0.22, -0.2, 0.83), repeat=0.3)


def sofa(room: Builder, x: float, y: float, angle: float) -> None:
    """A sofa 1.8 m wide for two, with three cushions; (x, y) is the middle of its back's foot."""
    at = Spot(room, x, y, angle)
    for a in (-0.84, 0.78):
        for b in (0.06, 0.68):
            at.box("oak", (a, b, 0), (a + 0.06, b + 0.06, 0.12))
    at.box("tweed_blue", (-0.9, 0, 0.12), (0.9, 0.8, 0.3), repeat=0.5)
    for low, high in ((-0.74, -0.005), (0.005, 0.74)):
        at.box("tweed_blue", (low, 0.2, 0.3), (high, 0.82, 0.44), repeat=0.45)
    at.box("tweed_blue", (-0.9, 0, 0.3), (0.9, 0.2, 0.78), repeat=0.5)
    for side in (-0.9, 0.75):
        at.box("tweed_blue", (side, 0.2, 0.3), (side + 0.15, 0.8, 0.58), repeat=0.5)
    for a, cloth, turn in ((-0.5, "tweed_gold", 0.12), (-0.1, "kelim", -0.1), (0.5, "felt", 0.08)):
        at.box(cloth, (a - 0.2, 0.215, 0.445), (a + 0.2, 0.33, 0.8), turn, repeat=0.4)


def pouf(room: Builder, x: float, y: float, cloth: str) -> None:
    """A round stool in cloth."""
    profile = [(1e-3, 0), (0.2, 0), (0.235, 0.06), (0.24, 0.2), (0.23, 0.36), (0.2, 0.41), (0.1, 0.425), (1e-3, 0.428)]
    room.lathe(cloth, profile, (x, y, 0), 28)
