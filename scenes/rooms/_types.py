"""What a generated room is: meshes with materials and textures, lights, the space for a camera, and two paths.

Metres, z up, the floor at z = 0. All of it is numpy; what renders it is `_rendering`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

RGB = tuple[float, float, float]
VERTEX_COLOUR = "vertex colour"  # a material's colour where each vertex has its own


@dataclass(frozen=True)
class Material:
    """How a surface looks."""

    # "diffuse", "glossy" (a coat over the colour), "metal", "mirror", "glass" or "light" (it shines).
    kind: str
    colour: RGB | str = (0.8, 0.8, 0.8)  # linear RGB, the name of a texture, or VERTEX_COLOUR
    roughness: float = 0.0  # alpha of the microfacets, in [0, 1]; for glossy and metal
    strength: float = 0.0  # of a light, radiance for the colour (1, 1, 1)


@dataclass(frozen=True)
class Mesh:
    """All triangles of one material."""

    vertices: np.ndarray  # (V, 3) float32
    triangles: np.ndarray  # (T, 3) int32, counter-clockwise seen from outside
    uv: np.ndarray  # (V, 2) float32, (0, 0) the upper left of the texture, which repeats
    normals: np.ndarray  # (V, 3) float32; zero where they are the triangles' own
    colours: np.ndarray  # (V, 3) float32, linear RGB


@dataclass(frozen=True)
class Part:
    """What one call of the builder added, as the box around it: what a camera keeps clear of."""

    material: str
    centre: np.ndarray  # (3,)
    half: np.ndarray  # (3,) half the extent along the box's own axes
    angle: float  # radians about z, from the world's axes to the box's
    solid: bool  # whether the box is filled: False for sheets, and for shapes that are round or loose

    @property
    def axes(self) -> np.ndarray:
        """(3, 3), a column an axis of the box."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and the highest corner, along the world's axes."""
        reach = np.abs(self.axes) @ self.half
        return self.centre - reach, self.centre + reach


@dataclass(frozen=True)
class AreaLight:
    """A rectangle that shines to one side and is itself not seen."""

    name: str
    position: RGB
    rotation: RGB  # Euler angles x, y, z in radians; without any it shines down
    size: tuple[float, float]
    watts: float
    colour: RGB


@dataclass(frozen=True)
class Walk:
    """A camera's way: N poses in order, each the place it is at and the direction it looks in."""

    times: np.ndarray  # (N,) seconds
    positions: np.ndarray  # (N, 3)
    directions: np.ndarray  # (N, 3), unit

    def __len__(self) -> int:
        return len(self.times)

    @property
    def c2w(self) -> np.ndarray:
        """(N, 4, 4) camera-to-world, OpenGL axes, the camera level. Raises nothing; a look straight up is NaN."""
        right = np.cross(self.directions, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        down = np.cross(self.directions, right)
        poses = np.tile(np.eye(4), (len(self), 1, 1))
        poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = right, -down, -self.directions
        poses[:, :3, 3] = self.positions
        return poses

    def picked(self, count: int) -> "Walk":
        """`count` of the poses, evenly spread, the first and the last among them."""
        chosen = np.linspace(0, len(self) - 1, count).round().astype(int)
        return Walk(self.times[chosen], self.positions[chosen], self.directions[chosen])


@dataclass(frozen=True)
class Room:
    """Everything of one room that is independent of how it is rendered."""

    meshes: Mapping[str, Mesh]  # by material
    materials: Mapping[str, Material]
    textures: Mapping[str, np.ndarray]  # (H, W, 3) uint8, sRGB
    lights: tuple[AreaLight, ...]
    parts: tuple[Part, ...]
    inside: tuple[RGB, RGB]  # lowest and highest corner of the air between walls, floor and ceiling
    paths: Mapping[str, Callable[[int], Walk]]  # "human", "smooth" and "test": the path of so many frames
    points_path: Walk  # from whose poses the surfaces are seen that points3d.ply has
