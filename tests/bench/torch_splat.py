"""The training step of the CPU backend in plain vectorised torch, for comparison: one tile of pixels at a time.

The same mathematics and the same order of blending as `viewbench.backends.splat`, in float32 with automatic gradients
and torch's own Adam; what a good afternoon's work in torch gives on a machine without a GPU.
"""

import numpy as np
import torch

from viewbench.backends.splat import layout

TILE = 16
SH_C1 = 0.4886025119029199  # of the spherical harmonics of degree 1


class TorchStep:
    """Holds the parameters and the optimiser; call it with a camera and a target to do one step."""

    def __init__(self, gaussians: np.ndarray, rates: np.ndarray):
        self.rows = [torch.tensor(row, requires_grad=True) for row in gaussians]
        groups = [{"params": [row], "lr": float(rate)} for row, rate in zip(self.rows, rates, strict=True)]
        self.adam = torch.optim.Adam(groups, betas=(0.9, 0.999), eps=1e-15)
        window = torch.exp(-(torch.arange(-5.0, 6.0) ** 2) / (2 * 1.5**2))
        window = window / window.sum()
        self.kernel = torch.outer(window, window).expand(3, 1, 11, 11).contiguous()

    def __call__(self, camera: np.ndarray, target: torch.Tensor, degree: int = 1) -> float:
        """One step; `target` is (3, H, W). Returns the loss."""
        self.adam.zero_grad(set_to_none=True)
        picture = self.render(torch.tensor(camera), degree)
        loss = 0.8 * (picture - target).abs().mean() + 0.2 * (1 - self._ssim(picture, target))
        loss.backward()
        self.adam.step()
        return loss.item()

    def render(self, cam: torch.Tensor, degree: int) -> torch.Tensor:
        """(3, H, W)."""
        row = self.rows
        rotation, fx, fy, cx, cy = cam[:9].view(3, 3), *cam[12:16]
        width, height = int(cam[19]), int(cam[20])
        mean = torch.stack(row[:3], 1)
        w, x, y, z = torch.nn.functional.normalize(torch.stack(row[3:7]), dim=0)
        turn = torch.stack(
            [
                *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
                *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
                *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
            ],
            1,
        ).view(-1, 3, 3)
        t = mean @ rotation.T + cam[9:12]
        keep = torch.nonzero(t[:, 2] > 0.05)[:, 0]
        keep = keep[torch.argsort(t[keep, 2].detach())]
        t, depth = t[keep], t[keep, 2]
        shape = turn[keep] * torch.stack(row[7:10], 1)[keep].exp()[:, None, :]
        u = (t[:, 0] / depth).clamp(-0.65 * width / fx, 0.65 * width / fx)
        v = (t[:, 1] / depth).clamp(-0.65 * height / fy, 0.65 * height / fy)
        zero = torch.zeros_like(depth)
        jacobian = torch.stack([fx / depth, zero, -fx * u / depth, zero, fy / depth, -fy * v / depth], 1).view(-1, 2, 3)
        half = jacobian @ rotation @ shape
        flat = half @ half.transpose(1, 2) + 0.3 * torch.eye(2)
        conic = torch.linalg.inv(flat)
        centre = torch.stack([fx * t[:, 0] / depth + cx, fy * t[:, 1] / depth + cy], 1)
        opacity = torch.sigmoid(row[layout.LOGIT][keep])
        colour = layout.SH_C0 * torch.stack(row[11:14], 1)[keep] + 0.5
        if degree:
            direction = torch.nn.functional.normalize((mean[keep] - cam[16:19]).detach(), dim=1)
            basis = torch.stack([-direction[:, 1], direction[:, 2], -direction[:, 0]], 1)
            first = torch.stack(row[14:23], 1)[keep].view(-1, 3, 3)
            colour = colour + SH_C1 * (basis[:, :, None] * first).sum(1)
        colour = colour.clamp(min=0)
        reach = (2 * torch.log(opacity * 255).clamp(min=0))[:, None] * torch.diagonal(flat, dim1=1, dim2=2)
        reach = reach.sqrt().detach()
        low, high = centre.detach() - reach, centre.detach() + reach
        bands = []
        for top in range(0, height, TILE):
            tiles = []
            for left in range(0, width, TILE):
                inside = (high[:, 0] > left) & (low[:, 0] < left + TILE) & (high[:, 1] > top) & (low[:, 1] < top + TILE)
                which = torch.nonzero(inside & (opacity.detach() > 1 / 255))[:, 0]
                rows = torch.arange(top, min(top + TILE, height)) + 0.5
                columns = torch.arange(left, min(left + TILE, width)) + 0.5
                pixel = torch.cartesian_prod(rows, columns).flip(1)
                d = pixel[:, None] - centre[which][None]
                q = conic[which]
                power = 0.5 * (q[:, 0, 0] * d[..., 0] ** 2 + q[:, 1, 1] * d[..., 1] ** 2) + q[:, 0, 1] * d.prod(-1)
                alpha = (opacity[which] * torch.exp(-power)).clamp(max=0.99)
                alpha = torch.where(alpha < 1 / 255, torch.zeros_like(alpha), alpha)
                left_over = torch.cumprod(torch.cat([torch.ones(len(pixel), 1), 1 - alpha], 1), 1)[:, :-1]
                tiles.append(((alpha * left_over) @ colour[which]).T.view(3, len(rows), len(columns)))
            bands.append(torch.cat(tiles, 2))
        return torch.cat(bands, 1)

    def _ssim(self, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        stacked = torch.stack([x, y, x * x, y * y, x * y])
        mx, my, xx, yy, xy = torch.nn.functional.conv2d(stacked, self.kernel, padding=5, groups=3)
        cov, vx, vy = xy - mx * my, xx - mx * mx, yy - my * my
        return ((2 * mx * my + 1e-4) * (2 * cov + 9e-4) / ((mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4))).mean()
