"""The slow, obvious version: every Gaussian against every pixel in float64 torch, with automatic gradients."""

import numpy as np
import scipy.special
import torch

from viewbench.backends.splat import layout
from viewbench.backends.splat.options import Rendering


def basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """(N, (degree + 1)²) real spherical harmonics of unit vectors (N, 3), made of scipy's complex ones."""
    x, y, z = directions.T
    polar, azimuth = np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)
    columns = []
    for band in range(degree + 1):
        for order in range(-band, band + 1):
            value = scipy.special.sph_harm_y(band, abs(order), polar, azimuth)
            columns.append(value.real if order == 0 else np.sqrt(2) * (value.imag if order < 0 else value.real))
    return np.stack(columns, axis=1)


def render(gaussians: torch.Tensor, camera: np.ndarray, how: Rendering) -> torch.Tensor:
    """(3, H, W) picture of (rows, N) float64 parameters for a 21-vector camera, blended exactly."""
    degree, near = how.degree, how.near
    cam = torch.tensor(camera, dtype=torch.float64)
    rotation, translation, position = cam[:9].view(3, 3), cam[9:12], cam[16:19]
    fx, fy, cx, cy = cam[12:16]
    width, height = int(cam[19]), int(cam[20])
    mean = gaussians[layout.MEAN : layout.MEAN + 3].T
    quaternion = gaussians[layout.QUATERNION : layout.QUATERNION + 4].T
    w, x, y, z = (quaternion / quaternion.norm(dim=1, keepdim=True)).unbind(1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    turn = torch.stack([torch.stack(row, dim=1) for row in rows], dim=1)
    scale = gaussians[layout.LOG_SCALE : layout.LOG_SCALE + 3].T.exp()
    covariance = turn @ torch.diag_embed(scale**2) @ turn.transpose(1, 2)

    t = mean @ rotation.T + translation
    depth = torch.where(t[:, 2] > near, t[:, 2], torch.ones_like(t[:, 2]))
    limit_x, limit_y = 1.3 * width / (2 * fx), 1.3 * height / (2 * fy)
    u, v = (t[:, 0] / depth).clamp(-limit_x, limit_x), (t[:, 1] / depth).clamp(-limit_y, limit_y)
    zero = torch.zeros_like(depth)
    jacobian = torch.stack(
        [torch.stack([fx / depth, zero, -fx * u / depth], 1), torch.stack([zero, fy / depth, -fy * v / depth], 1)], 1
    )
    project = jacobian @ rotation
    sharp = project @ covariance @ project.transpose(1, 2)
    flat = sharp + how.low_pass * torch.eye(2, dtype=torch.float64)
    opacity = torch.sigmoid(gaussians[layout.LOGIT])
    if how.antialias:
        kept = torch.linalg.det(sharp) / torch.linalg.det(flat)
        opacity = opacity * kept.clamp(min=2.5e-5).sqrt()
    centre = torch.stack([fx * t[:, 0] / depth + cx, fy * t[:, 1] / depth + cy], 1)

    direction = (mean - position).detach()
    direction = direction / direction.norm(dim=1, keepdim=True)
    coefficients = gaussians[layout.SH0 :].T.view(gaussians.shape[1], -1, 3)[:, : (degree + 1) ** 2]
    colour = 0.5 + torch.einsum("nk,nkc->nc", torch.tensor(basis(direction.numpy(), degree)), coefficients)
    colour = colour.clamp(min=0)

    order = torch.argsort(t[:, 2].detach())
    order = order[t[order, 2] > near]
    rows_, columns = torch.meshgrid(
        torch.arange(height, dtype=torch.float64) + 0.5, torch.arange(width, dtype=torch.float64) + 0.5, indexing="ij"
    )
    pixel = torch.stack([columns.reshape(-1), rows_.reshape(-1)], 1)
    d = pixel[:, None] - centre[order][None]
    power = 0.5 * torch.einsum("pni,nij,pnj->pn", d, torch.linalg.inv(flat[order]), d)
    alpha = opacity[order][None] * torch.exp(-power)
    alpha = torch.where(alpha < 1 / 255, torch.zeros_like(alpha), alpha.clamp(max=0.99))
    left = torch.cumprod(torch.cat([torch.ones(len(pixel), 1, dtype=torch.float64), 1 - alpha], 1), 1)
    picture = (alpha * left[:, :-1]) @ colour[order] + left[:, -1:] * how.background
    return picture.T.reshape(3, height, width)


def ssim(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """Mean SSIM of (3, H, W), zero padding."""
    window = torch.exp(-(torch.arange(-5, 6, dtype=torch.float64) ** 2) / (2 * 1.5**2))
    window = window / window.sum()
    kernel = torch.outer(window, window).expand(3, 1, 11, 11)

    def blur(a):
        return torch.nn.functional.conv2d(a[None], kernel, padding=5, groups=3)[0]

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx * mx, blur(y * y) - my * my, blur(x * y) - mx * my
    return ((2 * mx * my + 1e-4) * (2 * cov + 9e-4) / ((mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4))).mean()


def loss(x: torch.Tensor, y: torch.Tensor, weight: float) -> torch.Tensor:
    """(1 - weight) L1 + weight (1 - SSIM)."""
    return (1 - weight) * (x - y).abs().mean() + weight * (1 - ssim(x, y))
