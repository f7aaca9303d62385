"""The command that a user types next: what trains on a subset, or makes poses for it, in the words of that tool."""

import shlex
from pathlib import Path


def commands(out: Path, written: str, held: bool, depth_unit: float = 0.0) -> list[str]:
    """Lines for the tools that open a subset in the format `written`; `held` says whether it has test views.

    The programs are train.py of the 3DGS authors, nerfstudio's ns-train, simple_trainer.py of gsplat, and colmap.
    """
    folder = shlex.quote(str(out))
    if written == "colmap":
        return [
            f"3DGS: python train.py -s {folder}"
            + (f", then render.py -s {shlex.quote(str(out / 'test'))}" if held else ""),
            f"nerfstudio: ns-train splatfacto --data {folder} colmap",
            f"gsplat: python simple_trainer.py default --data_dir {folder} --data_factor 1",
        ]
    if written == "transforms":
        lines = []
        if (out / "transforms.json").is_file():
            depth = f" nerfstudio-data --depth-unit-scale-factor {depth_unit:g}" if depth_unit else ""
            lines.append(f"nerfstudio: ns-train splatfacto --data {folder}{depth}")
        elif (out / "transforms_train.json").is_file():
            lines.append(f"nerfstudio: ns-train splatfacto --data {folder} blender-data")
        if (out / "transforms_train.json").is_file():
            # Without --eval its reader of Blender's form adds the test views to the training views.
            lines.append(f"3DGS: python train.py -s {folder}" + (" --eval" if held else ""))
        return lines
    images = shlex.quote(str(out / "images"))
    work = shlex.quote(str(out / "colmap"))
    return [
        f"COLMAP: mkdir -p {work} && colmap automatic_reconstructor --image_path {images} --workspace_path {work}",
        f"nerfstudio: ns-process-data images --data {images} --output-dir {shlex.quote(str(out / 'nerfstudio'))}",
    ]
