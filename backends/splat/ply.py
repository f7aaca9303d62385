"""Models as PLY files in the layout of the 3DGS authors, which splat viewers open."""

from pathlib import Path

import numpy as np

from viewbench.backends.splat.layout import LOG_SCALE, LOGIT, MEAN, QUATERNION, ROWS, SH0, SH1
from viewbench.common.errors import UserError
from viewbench.common.files import whole

REST = 3  # coefficients of degree 1 per channel


def columns() -> list[tuple[str, int | None]]:
    """(property, row of the parameters), in the order of the file; normals have no row and are zeros.

    f_rest goes channel by channel, each with its coefficients, as the authors' files do.
    """
    named: list[tuple[str, int | None]] = [(axis, MEAN + k) for k, axis in enumerate("xyz")]
    named += [(normal, None) for normal in ("nx", "ny", "nz")]
    named += [(f"f_dc_{channel}", SH0 + channel) for channel in range(3)]
    for channel in range(3):
        named += [(f"f_rest_{REST * channel + k}", SH1 + 3 * k + channel) for k in range(REST)]
    named += [("opacity", LOGIT)]
    named += [(f"scale_{k}", LOG_SCALE + k) for k in range(3)]
    named += [(f"rot_{k}", QUATERNION + k) for k in range(4)]
    return named


def write(path: Path, gaussians: np.ndarray) -> None:
    """Writes (ROWS, N) parameters, whole or not at all."""
    from plyfile import PlyData, PlyElement

    layout = columns()
    table = np.zeros(gaussians.shape[1], dtype=[(name, "<f4") for name, _ in layout])
    for name, row in layout:
        if row is not None:
            table[name] = gaussians[row]
    with whole(path) as temporary:
        PlyData([PlyElement.describe(table, "vertex")], byte_order="<").write(temporary)


def read(path: Path) -> np.ndarray:
    """(ROWS, N) float32 parameters; coefficients beyond degree 1 are left out.

    Raises UserError for a missing file and one that is no splat model.
    """
    from plyfile import PlyData, PlyParseError

    try:
        vertex = PlyData.read(path)["vertex"]
        present = {prop.name for prop in vertex.properties}
        rest = sum(name.startswith("f_rest_") for name in present)
        gaussians = np.zeros((ROWS, vertex.count), np.float32)
        for name, row in columns():
            if row is None:
                continue
            if name.startswith("f_rest_"):
                channel, k = divmod(int(name.removeprefix("f_rest_")), REST)
                if not rest:
                    continue
                name = f"f_rest_{(rest // 3) * channel + k}"
            gaussians[row] = vertex[name]
    except FileNotFoundError:
        raise UserError(f"model '{path}' is missing; train it again") from None
    except (PlyParseError, ValueError, KeyError, OSError, EOFError) as error:
        raise UserError(f"model '{path}' is no splat model: {error}") from None
    return gaussians
