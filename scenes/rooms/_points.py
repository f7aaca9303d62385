"""Coloured points of the surfaces that a path sees, by casting rays; needs bpy, for its tree of triangles."""

from pathlib import Path

import numpy as np

from ...common.files import whole
from ..types import OPENCV
from ._tracing import Tracer, grid
from ._types import VERTEX_COLOUR, Mesh, Room

COUNT = 20_000  # of points, at most
EVERY = 8  # poses, of which one sees
RAYS = 20  # squared, from one pose
NOISE_M = 0.005  # deviation of a point from its surface
GREY = 0.7  # the colour of mirrors and of glass
NAMES = ("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue")


def seen(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) float64 points and (P, 3) uint8 colours, at most COUNT, in a fixed random order."""
    tracer, rays = Tracer(room), grid(RAYS)
    points, shades = [], []
    for pose in room.points_path.c2w[::EVERY] @ OPENCV:
        _, places, triangle = tracer.first_hits(pose, rays)
        points.append(places)
        corners = tracer.mesh.triangles[triangle]
        shades.append(_colours(room, tracer.names, tracer.mesh, tracer.owner[triangle], corners, places))
    return _thinned(np.concatenate(points), np.concatenate(shades))


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
