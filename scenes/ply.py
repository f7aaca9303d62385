"""Point clouds in PLY files."""

from pathlib import Path

import numpy as np

from ..common.errors import UserError
from ..common.files import whole
from ._ply_table import vertices
from .types import Points


def read_points(path: Path) -> Points:
    """Positions and colours (grey where there are none). Raises UserError for a file that is no point cloud.

    Coordinates that are NaN or infinite are found by `validate.check_scene`.
    """
    try:
        vertex = vertices(path)
        with np.errstate(invalid="ignore"):
            xyz = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
        named = set(vertex.dtype.names or ())
        channels = ("red", "green", "blue")
        rgb = np.full((len(xyz), 3), 128, dtype=np.uint8)
        if set(channels) <= named:
            with np.errstate(invalid="ignore"):  # colours of NaN
                rgb = np.stack([vertex[channel] for channel in channels], axis=1).astype(np.uint8)
    except MemoryError:
        raise UserError(f"points '{path}' cannot be read: there is not enough memory for them") from None
    except (ValueError, OSError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise UserError(f"points '{path}' cannot be read as PLY: {reason}") from None
    return Points(xyz, rgb)


def write_points(path: Path, points: Points) -> None:
    """Writes positions and colours as binary PLY, whole or not at all; the 3DGS authors' reader insists on normals.

    Raises UserError for a point so far away that float32, which readers expect, does not hold it.
    """
    from plyfile import PlyData, PlyElement

    far = np.flatnonzero((np.abs(points.xyz) > np.finfo(np.float32).max).any(axis=1))
    if len(far):
        raise UserError(f"point {far[0]} of the capture is too far away for '{path.name}'; take it out of the capture")
    layout = [
        *((axis, "<f4") for axis in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
    ]
    table = np.zeros(len(points), dtype=layout)
    for k, axis in enumerate("xyz"):
        table[axis] = points.xyz[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        table[name] = points.rgb[:, k]
    with whole(path) as temporary:
        PlyData([PlyElement.describe(table, "vertex")], byte_order="<").write(temporary)
