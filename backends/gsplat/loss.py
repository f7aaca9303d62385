"""The training loss of 3DGS: L1 and structural dissimilarity."""

import torch
from torch.nn.functional import conv2d

WEIGHT = 0.2  # λ of the 3DGS paper, equation 7
WINDOW, SIGMA = 11, 1.5
C1, C2 = 0.01**2, 0.03**2


def loss(image: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """(1 - λ) L1 + λ (1 - SSIM), equation 7 of the 3DGS paper; image and truth are (H, W, 3) in [0, 1]."""
    return (1 - WEIGHT) * (image - truth).abs().mean() + WEIGHT * (1 - ssim(image, truth))


def ssim(image: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Mean structural similarity (Wang et al. 2004) under an 11 × 11 Gaussian window, images padded with zeros.

    image, truth: (H, W, 3). Unlike the score in `_metrics.py` it counts the padded border, as 3DGS trains.
    """
    offsets = torch.arange(WINDOW, dtype=image.dtype, device=image.device) - WINDOW // 2
    kernel = torch.exp(-(offsets**2) / (2 * SIGMA**2))
    kernel = kernel / kernel.sum()
    x, y = (part.permute(2, 0, 1)[:, None] for part in (image, truth))
    blurred = _blur(torch.cat([x, y, x * x, y * y, x * y]), kernel)
    mean_x, mean_y, mean_xx, mean_yy, mean_xy = blurred.chunk(5)
    var_x, var_y, covariance = mean_xx - mean_x**2, mean_yy - mean_y**2, mean_xy - mean_x * mean_y
    luminance = (2 * mean_x * mean_y + C1) / (mean_x**2 + mean_y**2 + C1)
    structure = (2 * covariance + C2) / (var_x + var_y + C2)
    return (luminance * structure).mean()


def _blur(stack: torch.Tensor, kernel: torch.Tensor) -> torch.Tensor:
    """Separable convolution of (B, 1, H, W) with `kernel` along both axes."""
    rows = conv2d(stack, kernel[None, None, :, None], padding=(WINDOW // 2, 0))
    return conv2d(rows, kernel[None, None, None, :], padding=(0, WINDOW // 2))
