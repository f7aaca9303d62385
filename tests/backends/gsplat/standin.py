"""gsplat's rasterization on the CPU, for a few hundred Gaussians: its own projection in torch, blended densely here.

It takes the arguments of the real function by name and refuses all others, and returns the entries of `info` that
gsplat's strategies read, in the shapes in which the real function returns them when it is not packed.
"""

import inspect
import math
from typing import Any

import torch

ALPHA_MAX = 0.999
ALPHA_MIN = 1 / 255


def rasterization(
    means: torch.Tensor,
    quats: torch.Tensor,
    scales: torch.Tensor,
    opacities: torch.Tensor,
    colors: torch.Tensor,
    viewmats: torch.Tensor,
    Ks: torch.Tensor,
    width: int,
    height: int,
    near_plane: float = 0.01,
    sh_degree: int | None = None,
    packed: bool = True,
    backgrounds: torch.Tensor | None = None,
) -> tuple[torch.Tensor, torch.Tensor, dict[str, Any]]:
    """(1, H, W, 3) colours, (1, H, W, 1) alphas and the info of one camera; arguments as gsplat documents them."""
    from gsplat.cuda._torch_impl import _fully_fused_projection, _quat_scale_to_covar_preci, _spherical_harmonics

    count, bands = colors.shape[:2]
    shapes = {
        "means": (means, (count, 3)),
        "quats": (quats, (count, 4)),
        "scales": (scales, (count, 3)),
        "opacities": (opacities, (count,)),
        "colors": (colors, (count, bands, 3)),
        "viewmats": (viewmats, (1, 4, 4)),
        "Ks": (Ks, (1, 3, 3)),
        "backgrounds": (backgrounds, (1, 3)),
    }
    for name, (tensor, shape) in shapes.items():
        assert tensor is not None, name
        assert (tuple(tensor.shape), tensor.dtype) == (shape, torch.float32), name
    assert sh_degree is not None
    assert (sh_degree + 1) ** 2 <= bands
    assert not packed

    covariances, _ = _quat_scale_to_covar_preci(quats, scales, True, False)
    radii, means2d, depths, conics, _ = _fully_fused_projection(
        means, covariances, viewmats, Ks, width, height, near_plane=near_plane
    )
    centre = torch.linalg.inv(viewmats)[0, :3, 3]
    rgb = (_spherical_harmonics(sh_degree, means - centre, colors) + 0.5).clamp_min(0)

    seen = (radii[0] > 0).all(dim=-1)
    order = depths[0].masked_fill(~seen, math.inf).argsort()[: int(seen.sum())]
    v, u = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    dx, dy = u[..., None] - means2d[0, order, 0], v[..., None] - means2d[0, order, 1]
    a, b, c = conics[0, order].unbind(-1)
    alpha = (opacities[order] * torch.exp(-0.5 * (a * dx**2 + c * dy**2) - b * dx * dy)).clamp_max(ALPHA_MAX)
    alpha = torch.where(alpha < ALPHA_MIN, torch.zeros_like(alpha), alpha)
    passed = torch.cumprod(torch.cat([torch.ones(height, width, 1), 1 - alpha], dim=-1), dim=-1)
    image = (alpha * passed[..., :-1]) @ rgb[order] + passed[..., -1:] * backgrounds
    info = {"means2d": means2d, "radii": radii, "width": width, "height": height, "n_cameras": 1, "gaussian_ids": None}
    return image[None], 1 - passed[None, ..., -1:], info


def relocation(
    opacities: torch.Tensor, scales: torch.Tensor, ratios: torch.Tensor, binoms: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """gsplat's compute_relocation, equation 9 of 3DGS-MCMC: N Gaussians in the place of one look as it did."""
    new_opacities = 1 - (1 - opacities) ** (1 / ratios)
    new_scales = scales.clone()
    for row, n in enumerate(ratios.tolist()):
        total = 0.0
        for i in range(1, n + 1):
            for k in range(i):
                total += float(binoms[i - 1, k]) * (-1) ** k * float(new_opacities[row]) ** (k + 1) / math.sqrt(k + 1)
        new_scales[row] = scales[row] * float(opacities[row]) / total
    return new_opacities, new_scales


def signature_of_the_real_one() -> inspect.Signature:
    """Of gsplat.rasterization as installed."""
    from gsplat import rasterization as real

    return inspect.signature(real)
