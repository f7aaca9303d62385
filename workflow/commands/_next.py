"""The command that a user types next: what trains on a subset, or makes poses for it, in the words of that tool."""

import shlex
from pathlib import Path

from ...common.files import read_json
from ...scenes.image_files import is_file


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
        return _of_transforms(out, folder, held, depth_unit)
    images = shlex.quote(str(out / "images"))
    work = shlex.quote(str(out / "colmap"))
    return [
        f"COLMAP: mkdir -p {work} && colmap automatic_reconstructor --image_path {images} --workspace_path {work}",
        f"nerfstudio: ns-process-data images --data {images} --output-dir {shlex.quote(str(out / 'nerfstudio'))}",
    ]


def _of_transforms(out: Path, folder: str, held: bool, depth_unit: float) -> list[str]:
    lines, blender = [], out / "transforms_train.json"
    if (out / "transforms.json").is_file():
        depth = f" nerfstudio-data --depth-unit-scale-factor {depth_unit:g}" if depth_unit else ""
        lines.append(f"nerfstudio: ns-train splatfacto --data {folder}{depth}")
    if blender.is_file():
        frames = read_json(blender, "transforms")["frames"]
        if all(is_file(out / f"{frame['file_path']}.png") for frame in frames):  # which both readers add
            if not lines and (out / "transforms_val.json").is_file():  # nerfstudio evaluates on it
                lines.append(f"nerfstudio: ns-train splatfacto --data {folder} blender-data")
            # Without --eval the 3DGS authors' reader of this form adds the test views to the training views.
            lines.append(f"3DGS: python train.py -s {folder}" + (" --eval" if held else ""))
    if not any(line.startswith("3DGS") for line in lines):
        other = shlex.quote(f"{out}_colmap")
        lines.append(f"3DGS: viewbench convert {folder} --to colmap --out {other} && python train.py -s {other}")
    return lines
