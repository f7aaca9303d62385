"""Calls gsplat's rasterization with our cameras, in training and afterwards."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import torch

from ...scenes.types import Cameras
from .._gaussian_ply import Gaussians
from .gaussians import Parameters, parameters

NEAR = 0.01  # scene units, gsplat's own default


class Renderer:
    """gsplat's rasterization on one device, over a grey level or colour in [0, 1], from a near plane (0: its own)."""

    def __init__(self, rasterize: Callable, device: str, background: float | Sequence[float], near: float):
        self.rasterize, self.device = rasterize, device
        colour = background if isinstance(background, Sequence) else [background] * 3
        self.background = torch.tensor([colour], dtype=torch.float32, device=device)
        self.near = near or NEAR

    def parameters(self, gaussians: Gaussians) -> Parameters:
        """The Gaussians on the device."""
        return parameters(gaussians, self.device)

    def render(self, params: Parameters, camera: Cameras, degree: int) -> tuple[torch.Tensor, dict[str, Any]]:
        """(H, W, 3) image of the first camera, not clamped, and what the strategies need to know of it."""
        intrinsics = np.array([[camera.fx[0], 0, camera.cx[0]], [0, camera.fy[0], camera.cy[0]], [0, 0, 1]])
        image, _, info = self.rasterize(
            means=params["means"],
            quats=params["quats"],
            scales=params["scales"].exp(),
            opacities=params["opacities"].sigmoid(),
            colors=torch.cat([params["sh0"], params["shn"]], dim=1),
            viewmats=self._tensor(camera.world_to_camera()[:1]),
            Ks=self._tensor(intrinsics[None]),
            width=int(camera.width[0]),
            height=int(camera.height[0]),
            near_plane=self.near,
            sh_degree=degree,
            packed=False,
            backgrounds=self.background,
        )
        return image[0], info

    @torch.no_grad()
    def images(self, params: Parameters, cameras: Cameras, degree: int) -> Iterator[np.ndarray]:
        """(H, W, 3) float32 in [0, 1], one for each camera."""
        for camera in cameras:
            yield self.render(params, camera, degree)[0].clamp(0, 1).cpu().numpy()

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(array).to(self.device, torch.float32)
