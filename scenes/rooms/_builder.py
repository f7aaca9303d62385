"""Puts a room together: sheets, boxes, and shapes of revolution, collected into one mesh a material."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._types import Mesh, Part

WHITE = (1.0, 1.0, 1.0)
SMALLEST = 1e-9  # twice the area of a triangle that is none, in square metres
# Outward direction of a box's face and the directions of its texture's axes.
FACES = (
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
)


@dataclass
class _Pieces:
    vertices: list[np.ndarray] = field(default_factory=list)
    triangles: list[np.ndarray] = field(default_factory=list)
    uv: list[np.ndarray] = field(default_factory=list)
    normals: list[np.ndarray] = field(default_factory=list)
    colours: list[np.ndarray] = field(default_factory=list)
    count: int = 0


class Builder:
    """What was added so far. Positions are (x, y, z) in metres, colours linear RGB, angles radians about z."""

    def __init__(self) -> None:
        self._pieces: dict[str, _Pieces] = {}
        self.parts: list[Part] = []

    def faces(
        self, material: str, vertices: Any, triangles: Any, uv: Any, colour: Any = WHITE, normals: Any = None
    ) -> None:
        """(V, 3) vertices, (T, 3) triangles of them and (V, 2) texture coordinates, for loose shapes."""
        self._add(material, vertices, triangles, uv, colour, normals)
        self._part_around(material, np.asarray(vertices, dtype=np.float64))

    def sheet(
        self,
        material: str,
        corner: Any,
        u: Any,
        v: Any,
        uv: Sequence[float] = (0, 0, 1, 1),
        colour: Any = WHITE,
        repeat: float = 0.0,
    ) -> None:
        """A parallelogram from `corner` along `u` and `v`, seen from the side of u x v.

        `uv` is the texture's part (left, upper, right, lower); with `repeat` the whole texture is so many metres wide.
        """
        vertices = self._sheet(material, corner, u, v, uv, colour, repeat)
        self._part_around(material, vertices)

    def _sheet(
        self, material: str, corner: Any, u: Any, v: Any, uv: Sequence[float], colour: Any, repeat: float = 0.0
    ) -> np.ndarray:
        corner, u, v = (np.asarray(value) for value in (corner, u, v))
        vertices = np.stack([corner, corner + u, corner + u + v, corner + v]).astype(float)
        normal = np.cross(u, v)
        normal = normal / np.linalg.norm(normal)
        if repeat:
            uv = (0, 0, float(np.linalg.norm(u) / repeat), float(np.linalg.norm(v) / repeat))
        left, upper, right, lower = uv
        corners = [[left, upper], [right, upper], [right, lower], [left, lower]]
        self._add(material, vertices, [[0, 1, 2], [0, 2, 3]], corners, colour, np.repeat(normal[None], 4, 0))
        return vertices

    def box(
        self,
        material: str,
        low: Any,
        high: Any,
        repeat: float = 0.5,
        colour: Any = WHITE,
        angle: float = 0.0,
        uv: Sequence[float] | None = None,
    ) -> None:
        """A box between two corners, then turned by `angle` about its own middle; each face has all of `uv` if given.

        Else the texture is `repeat` metres wide and starts at a place of its own in each box.
        """
        low, high = np.asarray(low, float), np.asarray(high, float)
        centre, size = (low + high) / 2, high - low
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        start = (low[:2].sum() * 1.37) % 1
        for outward, across, along in FACES:
            u, v = np.array(across) * size, np.array(along) * size
            corner = centre + np.array(outward) * size / 2 - u / 2 - v / 2
            shown = uv or (start, start, start + abs(u).sum() / repeat, start + abs(v).sum() / repeat)
            self._sheet(material, centre + turn @ (corner - centre), turn @ u, turn @ v, shown, colour)
        self.parts.append(Part(material, centre, np.abs(size) / 2, angle, solid=True))

    def lathe(self, material: str, profile: Any, position: Any, segments: int = 28, colour: Any = WHITE) -> None:
        """A profile of (radius, height) pairs turned about the vertical through `position`, rising from outside."""
        vertices = self._lathe(material, profile, position, segments, colour)
        self._part_around(material, vertices)

    def _lathe(self, material: str, profile: Any, position: Any, segments: int, colour: Any) -> np.ndarray:
        profile = np.asarray(profile, float)
        m, angles = len(profile), np.linspace(0, 2 * np.pi, segments + 1)
        tangent = np.gradient(profile, axis=0)
        outward = np.stack([tangent[:, 1], -tangent[:, 0]], 1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True) + 1e-9
        vertices = _revolved(profile, angles) + np.asarray(position)
        around = angles[None] / (2 * np.pi) * 3
        uv = np.stack(np.broadcast_arrays(around, np.linspace(0, 1, m)[:, None]), -1)
        i, j = np.meshgrid(np.arange(m - 1), np.arange(segments), indexing="ij")
        a = i * (segments + 1) + j
        b, c, d = a + 1, a + segments + 1, a + segments + 2
        halves = [np.stack(corners, -1).reshape(-1, 3) for corners in ([a, b, d], [a, d, c])]
        normals = _revolved(outward, angles).reshape(-1, 3)
        self._add(material, vertices.reshape(-1, 3), np.concatenate(halves), uv.reshape(-1, 2), colour, normals)
        return vertices.reshape(-1, 3)

    def sphere(self, material: str, centre: Any, radius: float, colour: Any = WHITE, segments: int = 20) -> None:
        """A sphere of `segments` rings."""
        latitude = np.linspace(-np.pi / 2, np.pi / 2, segments)
        profile = np.stack([radius * np.cos(latitude), radius * np.sin(latitude)], 1)
        self.lathe(material, profile, centre, 2 * segments, colour)

    def cylinder(
        self, material: str, foot: Any, radius: float, height: float, colour: Any = WHITE, segments: int = 20
    ) -> None:
        """An upright cylinder on `foot`, the middle of its lower end."""
        outlines = ([(1e-4, 0), (radius, 0)], [(radius, 0), (radius, height)], [(radius, height), (1e-4, height)])
        ends = [self._lathe(material, outline, foot, segments, colour) for outline in outlines]
        self._part_around(material, np.concatenate(ends))

    def meshes(self) -> dict[str, Mesh]:
        """One mesh a material, in the order of their first use, without triangles that have no area."""
        return {material: _joined(pieces) for material, pieces in self._pieces.items()}

    def _add(self, material: str, vertices: Any, triangles: Any, uv: Any, colour: Any, normals: Any = None) -> None:
        vertices = np.asarray(vertices, np.float32)
        pieces = self._pieces.setdefault(material, _Pieces())
        normals = np.zeros_like(vertices) if normals is None else normals
        pieces.vertices.append(vertices)
        pieces.triangles.append(np.asarray(triangles, np.int32) + pieces.count)
        pieces.uv.append(np.asarray(uv, np.float32))
        pieces.normals.append(np.asarray(normals, np.float32))
        pieces.colours.append(np.broadcast_to(np.asarray(colour, np.float32), vertices.shape))
        pieces.count += len(vertices)

    def _part_around(self, material: str, vertices: np.ndarray) -> None:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self.parts.append(Part(material, (low + high) / 2, (high - low) / 2, 0.0, solid=False))


def _revolved(profile: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(M, A, 3) of (M, 2) pairs of radius and height at (A,) angles."""
    radius = profile[:, None, 0]
    height = np.repeat(profile[:, 1:2], len(angles), 1)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), height], -1)


def _joined(pieces: _Pieces) -> Mesh:
    vertices, triangles = np.concatenate(pieces.vertices), np.concatenate(pieces.triangles)
    corner = vertices[triangles[:, 0]]
    first, second = (vertices[triangles[:, k]].astype(float) - corner for k in (1, 2))
    real = np.linalg.norm(np.cross(first, second), axis=1) > SMALLEST
    return Mesh(
        vertices,
        triangles[real],
        np.concatenate(pieces.uv),
        np.concatenate(pieces.normals),
        np.concatenate(pieces.colours),
    )
