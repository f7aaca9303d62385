"""Nerfstudio's own code from PyPI, without the packages that reading a capture or a configuration does not use."""

import importlib
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

import pytest

from viewbench.common.torchvision_cpu import import_torchvision

# Where `make dev` puts it: among the other packages, most of what it needs would be missing.
FOLDER = Path(sys.prefix) / "nerfstudio"
READING = ("cv2", "viser", "viser.transforms", "appdirs", "newrawpy", "torch.utils.tensorboard")
CONFIGURING = (
    *READING,
    *("fpsample", "nerfacc", "pathos", "pathos.helpers", "pyquaternion", "pytorch_msssim", "tensorly", "tyro"),
)
VIEWERS = (
    *("nerfstudio.viewer.viewer", "nerfstudio.viewer.viewer_elements"),
    *("nerfstudio.viewer_legacy.server.viewer_state", "nerfstudio.viewer_legacy.server.viewer_elements"),
)


@contextmanager
def dataparser(name: str) -> Iterator[ModuleType]:
    """A module of nerfstudio.data.dataparsers."""
    with _without(READING):
        yield importlib.import_module(f"nerfstudio.data.dataparsers.{name}")


@contextmanager
def methods() -> Iterator[dict[str, Any]]:
    """Configurations by the names that `ns-train` knows them by, before its command line changes them."""
    import_torchvision()
    with _without(CONFIGURING, VIEWERS), warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of newer releases of torch than it knows
        yield importlib.import_module("nerfstudio.configs.method_configs").method_configs


@contextmanager
def _without(unused: tuple[str, ...], never: tuple[str, ...] = ()) -> Iterator[None]:
    """What nerfstudio imports and does not use here is stood in for: `unused` where it is missing, `never` always."""
    sys.path.append(str(FOLDER))
    try:
        with _stood_in(unused, never):
            yield
    finally:
        sys.path.remove(str(FOLDER))


@contextmanager
def _stood_in(unused: tuple[str, ...], never: tuple[str, ...]) -> Iterator[None]:
    pytest.importorskip("nerfstudio", reason="nerfstudio is not installed (make dev installs its code alone)")
    stood_in = [*never, *(module for module in unused if not _importable(module))]
    for module in stood_in:
        sys.modules[module] = MagicMock()
    try:
        yield
    finally:
        for module in stood_in:
            del sys.modules[module]


def _importable(module: str) -> bool:
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True
