"""Rays through a room, by Blender's tree of triangles: what a pixel shows, and whether a place is seen from another."""

import numpy as np

from ._rendering import FIELD_OF_VIEW
from ._types import Mesh, Room


class Tracer:
    """All triangles of a room but those of materials of the kinds left out. Needs bpy, which brings mathutils."""

    def __init__(self, room: Room, without: tuple[str, ...] = ()) -> None:
        import bpy  # noqa: F401  # pyright: ignore[reportMissingImports]: an extra, which brings mathutils
        from mathutils.bvhtree import BVHTree  # pyright: ignore[reportMissingImports]

        self.names = [name for name in room.meshes if room.materials[name].kind not in without]
        meshes = [room.meshes[name] for name in self.names]
        first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        uv = np.concatenate([mesh.uv for mesh in meshes])
        colours = np.concatenate([mesh.colours for mesh in meshes])
        triangles = np.concatenate([mesh.triangles + at for mesh, at in zip(meshes, first, strict=False)])
        self.mesh = Mesh(vertices, triangles, uv, uv, colours)
        self.owner = np.concatenate([np.full(len(mesh.triangles), i) for i, mesh in enumerate(meshes)])
        self._tree = BVHTree.FromPolygons(vertices.tolist(), triangles.tolist(), all_triangles=True)

    def first_hits(self, pose: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a camera sees along (R, 3) rays of its own axes (OpenCV's, z = 1), of which (R,) bool says which met.

        `pose` is (4, 4) camera-to-world with OpenCV axes. Also returns the (H, 3) places and (H,) triangles met.
        """
        from mathutils import Vector  # pyright: ignore[reportMissingImports]

        length = np.linalg.norm(rays, axis=1)
        origin, ways = Vector(pose[:3, 3]), (rays / length[:, None]) @ pose[:3, :3].T
        hits = [self._tree.ray_cast(origin, Vector(way)) for way in ways]
        met = np.array([hit[2] is not None for hit in hits])
        depth = np.array([np.nan if hit[3] is None else hit[3] for hit in hits]) / length
        places = ((rays * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3])[met]
        return met, places, np.array([hit[2] for hit in hits if hit[2] is not None], dtype=np.int64)

    def sees(self, origin: np.ndarray, places: np.ndarray, slack: float) -> np.ndarray:
        """(P,) bool, whether nothing is between (3,) `origin` and (P, 3) places but within `slack` metres of them."""
        from mathutils import Vector  # pyright: ignore[reportMissingImports]

        eye, ways = Vector(origin), places - origin
        far = np.linalg.norm(ways, axis=1)
        hits = [self._tree.ray_cast(eye, Vector(way), reach) for way, reach in zip(ways, far - slack, strict=True)]
        return np.array([hit[2] is None for hit in hits], dtype=bool)


def grid(side: int) -> np.ndarray:
    """(side², 3) rays through the middles of side² squares of the picture, row by row, OpenCV axes, z = 1."""
    wide = np.tan(FIELD_OF_VIEW / 2)
    y, x = (np.mgrid[0:side, 0:side] + 0.5) / side * 2 - 1
    return np.stack([x * wide, y * wide, np.ones_like(x)], -1).reshape(-1, 3)
