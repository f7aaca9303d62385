"""A place to put a thing together at in its own axes: right, ahead, up, the floor at 0."""

from typing import Any

import numpy as np

from ._builder import WHITE, Builder


class Spot:
    """Draws with `room` about (x, y, z), turned by `angle` from the world's axes; who uses the thing looks ahead."""

    def __init__(self, room: Builder, x: float, y: float, angle: float = 0.0, z: float = 0.0) -> None:
        self.room, self.angle = room, angle
        self._origin = np.array([x, y, z])
        cosine, sine = np.cos(angle), np.sin(angle)
        self._turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])

    def at(self, place: Any) -> np.ndarray:
        """(3,) in the room of a place here."""
        return self._origin + self._turn @ np.asarray(place, float)

    def box(self, material: str, low: Any, high: Any, angle: float = 0.0, **given: Any) -> None:
        """Like the builder's."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        centre, half = self.at((low + high) / 2), (high - low) / 2
        self.room.box(material, centre - half, centre + half, angle=self.angle + angle, **given)

    def sheet(self, material: str, corner: Any, u: Any, v: Any, **given: Any) -> None:
        """Like the builder's."""
        u, v = self._turn @ np.asarray(u, float), self._turn @ np.asarray(v, float)
        self.room.sheet(material, self.at(corner), u, v, **given)

    def cylinder(self, material: str, foot: Any, radius: float, height: float, colour: Any = WHITE) -> None:
        """Like the builder's."""
        self.room.cylinder(material, self.at(foot), radius, height, colour)

    def lathe(self, material: str, profile: Any, place: Any, colour: Any = WHITE) -> None:
        """Like the builder's."""
        self.room.lathe(material, profile, self.at(place), 24, colour)
