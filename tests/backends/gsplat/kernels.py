"""gsplat's CUDA kernels in torch, for a few hundred Gaussians and one camera: what lets all its Python run on a CPU.

`replace(monkeypatch)` puts them where gsplat's rasterization and its strategies call the compiled ones; projection,
spherical harmonics and covariances are gsplat's own reference code, blending and relocation are written here.
"""

import math

import torch

from tests.conftest import known

ALPHA_MAX = 0.999
ALPHA_MIN = 1 / 255


def replace(monkeypatch) -> None:
    """Exchanges every kernel that an unpacked pinhole rendering and the two strategies call."""
    from gsplat import rendering  # pyright: ignore[reportAttributeAccessIssue] - as in backends/gsplat/__init__.py
    from gsplat.cuda import _torch_impl
    from gsplat.strategy import ops

    for name in ("fully_fused_projection", "isect_tiles", "isect_offset_encode", "rasterize_to_pixels"):
        monkeypatch.setattr(rendering, name, globals()[name])
    monkeypatch.setattr(
        rendering, "spherical_harmonics", lambda d, dirs, shs, masks: _torch_impl._spherical_harmonics(d, dirs, shs)
    )
    monkeypatch.setattr(ops, "quat_scale_to_covar_preci", _torch_impl._quat_scale_to_covar_preci)
    monkeypatch.setattr(ops, "compute_relocation", relocation)


def fully_fused_projection(
    means, covars, quats, scales, viewmats, Ks, width, height, *, packed, sparse_grad, opacities, radius_clip, **others
):
    """radii (1, N, 2), means2d (1, N, 2), depths (1, N), conics (1, N, 3), no compensations."""
    from gsplat.cuda._torch_impl import _fully_fused_projection, _quat_scale_to_covar_preci

    assert covars is None
    assert not packed
    covariances, _ = _quat_scale_to_covar_preci(quats, scales, True, False)
    return _fully_fused_projection(means, known(covariances), viewmats, Ks, width, height, **others)


def isect_tiles(means2d, radii, depths, tile_size, tile_width, tile_height, **others):
    """Instead of a list for each tile, one of all visible Gaussians from near to far."""
    seen = (radii[0] > 0).all(dim=-1)
    order = depths[0].detach().masked_fill(~seen, math.inf).argsort()[: int(seen.sum())]
    return seen, order, order


def isect_offset_encode(isect_ids, n_images, tile_width, tile_height):
    return torch.zeros(n_images, tile_height, tile_width, dtype=torch.int32)


def rasterize_to_pixels(
    means2d, conics, colors, opacities, width, height, tile_size, offsets, order, backgrounds, packed, absgrad
):
    """(1, H, W, 3) colours and (1, H, W, 1) alphas: Gaussians over each other, over the background."""
    v, u = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    dx, dy = u[..., None] - means2d[0, order, 0], v[..., None] - means2d[0, order, 1]
    a, b, c = conics[0, order].unbind(-1)
    alpha = opacities[0, order] * torch.exp(-0.5 * (a * dx**2 + c * dy**2) - b * dx * dy)
    alpha = torch.where(alpha < ALPHA_MIN, torch.zeros_like(alpha), alpha.clamp_max(ALPHA_MAX))
    passed = torch.cumprod(torch.cat([torch.ones(height, width, 1), 1 - alpha], dim=-1), dim=-1)
    image = (alpha * passed[..., :-1]) @ colors[0, order] + passed[..., -1:] * backgrounds
    return image[None], 1 - passed[None, ..., -1:]


def relocation(opacities, scales, ratios, binoms):
    """Equation 9 of 3DGS-MCMC: opacities and scales with which `ratios` Gaussians in one place look as one did."""
    new_opacities = 1 - (1 - opacities) ** (1 / ratios)
    new_scales = scales.clone()
    for row, count in enumerate(ratios.tolist()):
        opacity = float(new_opacities[row])
        total = sum(
            float(binoms[i - 1, k]) * (-1) ** k * opacity ** (k + 1) / math.sqrt(k + 1)
            for i in range(1, count + 1)
            for k in range(i)
        )
        new_scales[row] = scales[row] * float(opacities[row]) / total
    return new_opacities, new_scales
