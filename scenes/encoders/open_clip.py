"""Any image encoder of open_clip, as open_clip:MODEL/TAG; the paper's is ViT-SO400M-14-SigLIP-384/webli."""

import importlib
import importlib.metadata
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.errors import UserError, nearest
from ...common.files import sha256_file

GPU = True  # it uses one where there is one
DEFAULT = "ViT-SO400M-14-SigLIP-384/webli"


def available() -> str | None:
    """Why the encoder cannot be used here, or None; whether its weights are in reach shows when they are asked for."""
    return extras.missing("open_clip", "torch", "torchvision", use="the encoder open_clip needs", extra="clip")


def version(argument: str) -> str:
    """What the features depend on besides the pictures: the package, the model and its weights."""
    tag = (argument or DEFAULT).partition("/")[2]
    weights = sha256_file(tag) if Path(tag).is_file() else tag
    return f"open_clip {importlib.metadata.version('open_clip_torch')}, {argument or DEFAULT}, weights {weights}"


def encoder(argument: str, device: str) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
    """(input size S in pixels, encode), where encode maps (B, S, S, 3) in [0, 1] to (B, D) float32.

    `argument` is MODEL/TAG, where TAG names pretrained weights or is the path of a file with them. Raises UserError
    for an unknown model, a missing tag, and weights that are neither on disk nor in reach of a hub.
    """
    from ...common import gpu  # no source: which device it is changes nothing
    from ...common.torchvision_cpu import import_torchvision

    import_torchvision()
    import torch

    # By its name, since a type checker takes this file for a package that is not installed.
    open_clip: Any = importlib.import_module("open_clip")

    name, _, tag = (argument or DEFAULT).partition("/")
    known = open_clip.list_models()
    if name not in known:
        raise UserError(f"open_clip has no model '{name}'{nearest(name, known)}; open_clip.list_models() has them all")
    if not tag:
        raise UserError(f"encoder 'open_clip:{argument}' names no weights; write open_clip:MODEL/TAG")
    logging.disable(logging.CRITICAL)  # the hub logs every retry; what is wrong is said once, below
    try:
        model, _, _ = open_clip.create_model_and_transforms(name, pretrained=tag)
    except Exception as error:  # hubs fail in many ways: no network, no such file, no such tag
        words = (str(error).splitlines() or [type(error).__name__])[0].split(". ")[0]
        raise UserError(
            f"weights '{tag}' of open_clip's {name} are not in reach ({words}); "
            "put them on disk and name the file, or use the encoder efficientnet-lite0"
        ) from None
    finally:
        logging.disable(logging.NOTSET)
    if gpu.hold(device) is not None and device != "auto":
        device = "cuda"  # the one that is held, whichever its number
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    model.eval().to(device)
    settings = open_clip.get_model_preprocess_cfg(model)
    size = settings["size"] if isinstance(settings["size"], int) else int(settings["size"][0])
    mean, spread = (torch.tensor(settings[key], device=device).view(1, 3, 1, 1) for key in ("mean", "std"))

    def encode(images: np.ndarray) -> np.ndarray:
        batch = torch.from_numpy(np.ascontiguousarray(images.transpose(0, 3, 1, 2))).to(device)
        with torch.inference_mode():
            features = model.encode_image((batch - mean) / spread)
            return features.float().cpu().numpy()

    return size, encode
