"""Nerfstudio's own code from PyPI, without the packages that reading a capture does not use."""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from unittest.mock import MagicMock

import pytest

UNUSED = ("cv2", "viser", "viser.transforms", "appdirs", "newrawpy", "torch.utils.tensorboard")


@contextmanager
def dataparser(name: str) -> Iterator[ModuleType]:
    """A module of nerfstudio.data.dataparsers; what it imports and does not use is stood in for where it is missing."""
    pytest.importorskip("nerfstudio", reason="nerfstudio is not installed (make dev installs its code alone)")
    stood_in = []
    for module in UNUSED:
        try:
            importlib.import_module(module)
        except ImportError:
            stood_in.append(module)
            sys.modules[module] = MagicMock()
    try:
        yield importlib.import_module(f"nerfstudio.data.dataparsers.{name}")
    finally:
        for module in stood_in:
            del sys.modules[module]
