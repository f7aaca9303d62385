"""3D Gaussians as the PLY file that the 3DGS authors write and every viewer reads: values before their activations."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.errors import UserError
from ..common.files import whole
from ..scenes._ply_table import vertices


@dataclass(frozen=True)
class Gaussians:
    """N Gaussians with spherical harmonics of D + 1 = √(R + 1) bands."""

    means: np.ndarray  # (N, 3) float32, scene units
    scales: np.ndarray  # (N, 3) float32, natural logarithm
    quats: np.ndarray  # (N, 4) float32, w, x, y, z; any length
    opacities: np.ndarray  # (N,) float32, logit
    sh0: np.ndarray  # (N, 3) float32, the constant band of red, green, blue
    shn: np.ndarray  # (N, R, 3) float32, the other bands; R = (D + 1)² - 1

    def __len__(self) -> int:
        return len(self.means)

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics."""
        return round((self.shn.shape[1] + 1) ** 0.5) - 1


def fields(rest: int) -> list[str]:
    """The file's properties in order, with `rest` coefficients above the constant band."""
    return [
        *("x", "y", "z", "nx", "ny", "nz"),
        *(f"f_dc_{i}" for i in range(3)),
        *(f"f_rest_{i}" for i in range(3 * rest)),
        "opacity",
        *(f"scale_{i}" for i in range(3)),
        *(f"rot_{i}" for i in range(4)),
    ]


def save(path: Path, gaussians: Gaussians) -> None:
    """Writes a binary little-endian PLY, whole or not at all. f_rest has all of red, then green, then blue."""
    count = len(gaussians)
    columns = np.concatenate(
        [
            gaussians.means,
            np.zeros((count, 3)),
            gaussians.sh0,
            gaussians.shn.transpose(0, 2, 1).reshape(count, -1),
            gaussians.opacities[:, None],
            gaussians.scales,
            gaussians.quats,
        ],
        axis=1,
        dtype="<f4",
    )
    names = fields(gaussians.shn.shape[1])
    properties = "".join(f"property float {name}\n" for name in names)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    with whole(path) as temporary:
        temporary.write_bytes(header.encode() + np.ascontiguousarray(columns).tobytes())


def load(path: Path) -> Gaussians:
    """Reads what `save` or any 3DGS trainer wrote. Raises UserError for a file that is missing or has other fields."""
    try:
        vertex = vertices(path)
        rest = sum(name.startswith("f_rest_") for name in vertex.dtype.names or ()) // 3
        with np.errstate(over="ignore", invalid="ignore"):
            columns = np.stack([vertex[name] for name in fields(rest) if not name.startswith("n")], axis=1)
            columns = columns.astype(np.float32)
    except OSError as error:
        raise UserError(f"model '{path}' cannot be read: {error.strerror}; train it again") from None
    except MemoryError:
        raise UserError(f"model '{path}' cannot be read: there is not enough memory for it") from None
    except ValueError as error:
        raise UserError(f"model '{path}' is not a PLY file of 3D Gaussians: {error}") from None
    means, sh0, shn, opacities, scales, quats = np.split(columns, np.cumsum([3, 3, 3 * rest, 1, 3]), axis=1)
    return Gaussians(means, scales, quats, opacities[:, 0], sh0, shn.reshape(len(shn), 3, rest).transpose(0, 2, 1))
