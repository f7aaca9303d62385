"""The Gaussians as gsplat's strategies want them: a dictionary of parameters and one optimizer each."""

import numpy as np
import torch

from .._gaussian_ply import Gaussians
from .._points.start import FAINT, Start, joined

C0 = 0.28209479177387814  # the constant spherical harmonic, 1 / (2 √π): colour = 0.5 + C0 · coefficient
NEIGHBOURS = 3
# Learning rates of the 3DGS authors; that of the means is times the scene's extent and decays by MEANS_DECAY.
RATES = {"means": 1.6e-4, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 2.5e-3, "shn": 2.5e-3 / 20}
MEANS_DECAY = 0.01
# (opacity, scale relative to the distance of the neighbours) at the start, of 3DGS and of 3DGS-MCMC
STARTS = {"default": (0.1, 1.0), "mcmc": (0.5, 0.1)}

Parameters = dict[str, torch.nn.Parameter]
Optimizers = dict[str, torch.optim.Optimizer]


def initial(starts: list[Start], strategy: str, degree: int, extent: float) -> Gaussians:
    """Round Gaussians at the points, as large as the root mean square distance of their three neighbours.

    extent: scene units, the size where a point has no neighbour.
    """
    from scipy.spatial import KDTree

    xyz, colours = joined(starts)
    count = len(xyz)
    own, relative = STARTS[strategy]
    opacity = np.concatenate([np.full(len(start), min(own, FAINT.get(start.kind, own))) for start in starts])
    distances = np.full((count, 1), extent)
    if count > 1:
        distances = KDTree(xyz, leafsize=16).query(xyz, k=min(NEIGHBOURS + 1, count))[0][:, 1:]
    size = np.maximum(np.sqrt((distances**2).mean(axis=1)), 1e-7 * extent)  # doubled points have distance 0
    return Gaussians(
        means=xyz.astype(np.float32),
        scales=np.repeat(np.log(relative * size)[:, None], 3, axis=1).astype(np.float32),
        quats=np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (count, 1)),
        opacities=np.log(opacity / (1 - opacity)).astype(np.float32),
        sh0=((colours - 0.5) / C0).astype(np.float32),
        shn=np.zeros((count, (degree + 1) ** 2 - 1, 3), dtype=np.float32),
    )


def parameters(gaussians: Gaussians, device: str) -> Parameters:
    """gsplat's dictionary: means, scales, quats, opacities as it names them, sh0 (N, 1, 3) and shn (N, R, 3)."""
    arrays = {**vars(gaussians), "sh0": gaussians.sh0[:, None]}
    return {
        name: torch.nn.Parameter(torch.from_numpy(np.ascontiguousarray(array)).to(device))
        for name, array in arrays.items()
    }


def arrays(params: Parameters) -> Gaussians:
    """The dictionary back as arrays."""
    values = {name: value.detach().cpu().numpy() for name, value in params.items()}
    return Gaussians(**{**values, "sh0": values["sh0"][:, 0]})


def optimizers(params: Parameters, extent: float) -> Optimizers:
    """One Adam with one group for each parameter, which is what gsplat's strategies edit when Gaussians come and go."""
    rates = {**RATES, "means": RATES["means"] * extent}
    return {name: torch.optim.Adam([params[name]], lr=rates[name], eps=1e-15) for name in params}
