"""The command that a user types next: what trains on a subset, or makes poses for it, in the words of that tool."""

import shlex
from pathlib import Path

from ...common.files import read_json
from ...scenes.formats import _colmap_files
from ...scenes.formats._colmap_write import FOLDERS
from ...scenes.image_files import is_file


def commands(out: Path, written: str, held: bool, depth_unit: float = 0.0) -> list[str]:
    """Lines for the tools that open a subset in the format `written`; `held` says whether it has test views.

    The programs are train.py of the 3DGS authors, nerfstudio's ns-train, simple_trainer.py of gsplat, and colmap.
    """
    folder = shlex.quote(str(out))
    if written == "colmap":
        return _of_colmap(out, folder, held)
    if written == "transforms":
        return _of_transforms(out, folder, held, depth_unit)
    images = shlex.quote(str(out / "images"))
    work = shlex.quote(str(out / "colmap"))
    return [
        f"COLMAP: mkdir -p {work} && colmap automatic_reconstructor --image_path {images} --workspace_path {work}",
        f"nerfstudio: ns-process-data images --data {images} --output-dir {shlex.quote(str(out / 'nerfstudio'))}",
    ]


def _of_colmap(out: Path, folder: str, held: bool) -> list[str]:
    pictures = next((name for name in FOLDERS if (out / name).is_dir()), "images")
    model = shlex.quote(str(out / "model"))
    if _colmap_files.pinholes(out / "sparse" / "0"):
        smaller = "" if pictures == "images" else f" -i {pictures}"
        lines = [f"3DGS: python train.py -s {folder} -m {model}{smaller}"]
        if held:  # whose pictures then lie in model/train: all of that folder are to be drawn
            lines[0] += f" && python render.py -m {model} -s {shlex.quote(str(out / 'test'))}{smaller}"
    else:
        flat = f"{out}_undistorted"
        undistort = f"colmap image_undistorter --image_path {shlex.quote(str(out / pictures))} --input_path "
        undistort += f"{shlex.quote(str(out / 'sparse' / '0'))} --output_path {shlex.quote(flat)}"
        sparse = shlex.quote(f"{flat}/sparse")
        move = f"mkdir {sparse}/0 && mv {sparse}/*.bin {sparse}/0/"
        lines = [f"3DGS: {undistort} && {move} && python train.py -s {shlex.quote(flat)} -m {model}"]
    if pictures == "images":  # the others count on the pictures of the full size
        if (out / "colmap" / "sparse" / "0").is_dir():
            lines.append(f"nerfstudio: ns-train splatfacto --data {folder} colmap")
        lines.append(f"gsplat: python simple_trainer.py default --data_dir {folder} --data_factor 1")
    return lines


def _of_transforms(out: Path, folder: str, held: bool, depth_unit: float) -> list[str]:
    lines, blender = [], out / "transforms_train.json"
    if (out / "transforms.json").is_file():
        depth = f" nerfstudio-data --depth-unit-scale-factor {depth_unit:g}" if depth_unit else ""
        lines.append(f"nerfstudio: ns-train splatfacto --data {folder}{depth}")
    if blender.is_file():
        table = read_json(blender, "transforms")
        if "camera_angle_x" in table and all(is_file(out / f"{frame['file_path']}.png") for frame in table["frames"]):
            if not lines and (out / "transforms_val.json").is_file():  # nerfstudio evaluates on it
                lines.append(f"nerfstudio: ns-train splatfacto --data {folder} blender-data")
            # Without --eval the 3DGS authors' reader of this form adds the test views to the training views.
            lines.append(f"3DGS: python train.py -s {folder}" + (" --eval" if held else ""))
    if not any(line.startswith("3DGS") for line in lines):
        other = shlex.quote(f"{out}_colmap")
        lines.append(f"3DGS: viewbench convert {folder} --to colmap --out {other} && python train.py -s {other}")
    return lines
