"""Imports torchvision beside a CPU build of torch, for which the registry carries a CUDA build only."""

from types import ModuleType
from typing import Any

_kept: list[Any] = []  # a torch Library lives as long as its object


def import_torchvision() -> ModuleType:
    """`import torchvision`, with the two operators declared that its CUDA build misses beside CPU torch.

    The operators are declared, not implemented: nothing here runs them, and a call would raise.
    """
    import torch

    try:
        import torchvision
    except RuntimeError as error:
        if "torchvision::" not in str(error):
            raise
        library = torch.library.Library("torchvision", "FRAGMENT")
        for operator in ("nms", "qnms"):
            library.define(f"{operator}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        _kept.append(library)
        import sys

        for name in [name for name in sys.modules if name.split(".")[0] == "torchvision"]:
            del sys.modules[name]
        import torchvision
    return torchvision
