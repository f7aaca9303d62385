"""SSIM and LPIPS of a rendered view, the same for every backend."""

import contextlib
import functools
import math
import threading
from pathlib import Path
from typing import cast

import numpy as np

from ..common import extras  # no source: it says what to install
from ..common.errors import UserError
from ..common.files import sha256_file
from ..common.settings import at_home


def ssim(image: np.ndarray, truth: np.ndarray) -> float:
    """Structural similarity (Wang et al. 2004): 11 x 11 Gaussian window, σ = 1.5, mean over pixels and channels.

    image, truth: (H, W, 3) in [0, 1]; images smaller than the window give NaN.
    """
    from skimage.metrics import structural_similarity

    if min(truth.shape[:2]) < 11:
        return math.nan
    mean = structural_similarity(
        truth.astype(np.float64),
        image.astype(np.float64),
        data_range=1.0,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    return float(cast(np.float64, mean))  # not the tuple that it is when gradients or the map are asked for too


@functools.cache
def lpips_weights(configured: str) -> Path | None:
    """File of the AlexNet weights: the configured one, or the one in torch's cache; None without either.

    Raises UserError when a configured file is missing.
    """
    if configured:
        path = at_home(configured)
        if not path.is_file():
            raise UserError(f"metrics.lpips_weights '{configured}' is no file; correct it or leave it empty")
        return path
    with contextlib.suppress(RuntimeError):  # nobody's home
        cached = Path("~/.cache/torch/hub/checkpoints/alexnet-owt-7be5be79.pth").expanduser()
        return cached if cached.is_file() else None
    return None


def lpips_sha256(configured: str) -> str | None:
    """Hash of the weights that scores are made with; None without any."""
    weights = lpips_weights(configured)
    return None if weights is None else sha256_file(weights)


def lpips(image: np.ndarray, truth: np.ndarray, weights: Path) -> float:
    """Learned perceptual distance (Zhang et al. 2018, AlexNet, version 0.1); lower is nearer.

    image, truth: (H, W, 3) in [0, 1]. `weights` is torchvision's AlexNet file.
    Raises UserError when the `lpips` package, which carries the linear heads, is not installed.
    """
    extras.need("lpips", "torch", "torchvision", use="LPIPS needs", extra="lpips")
    import torch

    model = _lpips_model(weights)
    first, second = (
        torch.from_numpy(np.ascontiguousarray(array.transpose(2, 0, 1))).float()[None] * 2 - 1
        for array in (image, truth)
    )
    with torch.no_grad():
        return float(model(first, second))


_making = threading.Lock()  # several threads may ask at once


def _lpips_model(weights: Path):
    with _making:
        return _made_lpips_model(weights)


@functools.cache
def _made_lpips_model(weights: Path):
    import torch

    from ..common.torchvision_cpu import import_torchvision

    import_torchvision()
    from lpips import LPIPS

    model = LPIPS(net="alex", pnet_rand=True, verbose=False).eval()
    state = torch.load(weights, map_location="cpu", weights_only=True)
    layers = [model.net.slice1, model.net.slice2, model.net.slice3, model.net.slice4, model.net.slice5]
    convolutions = {name: layer for part in layers for name, layer in part.named_children() if hasattr(layer, "weight")}
    for name, layer in convolutions.items():
        layer.load_state_dict({key: state[f"features.{name}.{key}"] for key in ("weight", "bias")})
    return model
