"""Coloured points of the surfaces that a path sees, by casting rays; needs bpy, for its tree of triangles."""

from pathlib import Path

import numpy as np

from ...common.files import whole
from ._rendering import FIELD_OF_VIEW
from ._types import VERTEX_COLOUR, Mesh, Room

COUNT = 20_000  # of points, at most
EVERY = 8  # poses, of which one sees
RAYS = 20  # squared, from one pose
NOISE_M = 0.005  # deviation of a point from its surface
GREY = 0.7  # the colour of mirrors and of glass
NAMES = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue")


def seen(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) float64 points and (P, 3) uint8 colours, at most COUNT, in a fixed random order."""
    import bpy  # noqa: F401  # pyright: ignore[reportMissingImports]: an extra, which brings mathutils
    from mathutils import Vector  # pyright: ignore[reportMissingImports]
    from mathutils.bvhtree import BVHTree  # pyright: ignore[reportMissingImports]

    names, meshes = list(room.meshes), list(room.meshes.values())
    first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    triangles = np.concatenate([mesh.triangles + at for mesh, at in zip(meshes, first, strict=False)])
    owner = np.concatenate([np.full(len(mesh.triangles), i) for i, mesh in enumerate(meshes)])
    tree = BVHTree.FromPolygons(vertices.tolist(), triangles.tolist(), all_triangles=True)
    uv = np.concatenate([mesh.uv for mesh in meshes])
    colours = np.concatenate([mesh.colours for mesh in meshes])
    all_of_it = Mesh(vertices, triangles, uv, uv, colours)
    rays = _rays()
    length = np.linalg.norm(rays, axis=1)
    points, shades = [], []
    for pose in room.points_path.c2w[::EVERY] @ np.diag([1.0, -1.0, -1.0, 1.0]):
        origin, ways = Vector(pose[:3, 3]), (rays / length[:, None]) @ pose[:3, :3].T
        hits = [tree.ray_cast(origin, Vector(way)) for way in ways]
        met = np.array([hit[2] is not None for hit in hits])
        depth = np.array([np.nan if hit[3] is None else hit[3] for hit in hits]) / length
        place = ((rays * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3])[met]
        triangle = np.array([hit[2] for hit in hits if hit[2] is not None], dtype=np.int64)
        points.append(place)
        shades.append(_colours(room, names, all_of_it, owner[triangle], triangles[triangle], place))
    return _thinned(np.concatenate(points), np.concatenate(shades))


def _rays() -> np.ndarray:
    """(RAYS², 3) through the middles of RAYS² squares of the picture, OpenCV axes, z = 1."""
    wide = np.tan(FIELD_OF_VIEW / 2)
    y, x = (np.mgrid[0:RAYS, 0:RAYS] + 0.5) / RAYS * 2 - 1
    return np.stack([x * wide, y * wide, np.ones_like(x)], -1).reshape(-1, 3)


def _colours(
    room: Room, names: list[str], mesh: Mesh, owner: np.ndarray, triangles: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """(P, 3) sRGB in [0, 1] of points on (P, 3) triangles, each of the `owner`-th material."""
    uv = _uv_at(mesh, triangles, points)
    colours = np.full((len(points), 3), GREY)
    for i in np.unique(owner):
        here, material = owner == i, room.materials[names[i]]
        if material.colour == VERTEX_COLOUR:
            colours[here] = mesh.colours[triangles[here, 0]] ** (1 / 2.2)
        elif isinstance(material.colour, str):
            texture = room.textures[material.colour]
            high, wide = texture.shape[:2]
            row, column = (uv[here, 1] % 1 * (high - 1)).astype(int), (uv[here, 0] % 1 * (wide - 1)).astype(int)
            colours[here] = texture[row, column] / 255.0
        elif material.kind not in ("mirror", "glass"):
            colours[here] = np.clip(material.colour, 0, 1)
    return colours


def _uv_at(mesh: Mesh, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(P, 2) texture coordinates by barycentric ones."""
    corners = mesh.vertices[triangles]
    a, b, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb, pa, pb = ((u * v).sum(1) for u, v in ((a, a), (a, b), (b, b), (p, a), (p, b)))
    area = aa * bb - ab**2
    second, third = (bb * pa - ab * pb) / area, (aa * pb - ab * pa) / area
    shares = (1 - second - third, second, third)
    parts = [mesh.uv[triangles[:, k]] * share[:, None] for k, share in enumerate(shares)]
    return parts[0] + parts[1] + parts[2]


def _thinned(points: np.ndarray, colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    points = points + random.normal(scale=NOISE_M, size=points.shape)
    kept = random.permutation(len(points))[:COUNT]
    return points[kept], (colours[kept] * 255).astype(np.uint8)


def write(path: Path, points: np.ndarray, colours: np.ndarray) -> None:
    """Writes a binary PLY with normals of zero, as 3DGS reads it, whole or not at all."""
    kinds = ["float"] * 6 + ["uchar"] * 3
    row = np.dtype([(name, "<f4" if kind == "float" else "u1") for name, kind in zip(NAMES, kinds, strict=True)])
    rows = np.zeros(len(points), row)
    for name, values in zip(("x", "y", "z", "red", "green", "blue"), (*points.T, *colours.T), strict=True):
        rows[name] = values
    properties = "".join(f"property {kind} {name}\n" for name, kind in zip(NAMES, kinds, strict=True))
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    with whole(path) as temporary:
        temporary.write_bytes(head.encode() + rows.tobytes())
