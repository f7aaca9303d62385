"""Writes cameras and their images as a scene folder that external trainers read: the chosen views and nothing else.

Images are numbered (`00000.png`) in the order given, since the trainers sort by name and a frame's own name may hold
anything. Two layouts, by the names that `viewbench list formats` uses:

    transforms   transforms.json, images/, points3d.ply   nerfstudio, OpenSplat, instant-ngp
    colmap       sparse/0/*.txt, images/                  the 3DGS authors' code and many more

Lens distortion has been taken out of the pictures that backends get, so that no layout needs to tell of it.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError, nearest
from ..common.files import write_json, write_text
from ..scenes.types import Cameras

LAYOUTS = ("transforms", "colmap")
POINTS = "points3d.ply"


def image_name(index: int) -> str:
    """File name, without folder, of the image at `index`."""
    return f"{index:05d}.png"


def write(
    folder: Path,
    layout: str,
    cameras: Cameras,
    images: Iterable[np.ndarray] | None,
    points: tuple[np.ndarray, np.ndarray] | None = None,
    extra: dict[str, Any] | None = None,
) -> None:
    """Writes `cameras` with `images`, (H, W, 3) in [0, 1] each, into `folder`.

    Without images black ones are written: tools that render a dataset want files, and no test image is to be theirs.
    `points` are (P, 3) positions and (P, 3) uint8 colours; `extra` goes to the top of transforms.json.
    Raises UserError for an unknown layout.
    """
    if layout not in LAYOUTS:
        raise UserError(f"unknown format '{layout}'{nearest(layout, LAYOUTS)} (there are: {', '.join(LAYOUTS)})")
    from PIL import Image

    (folder / "images").mkdir(parents=True)
    black = (np.zeros((int(h), int(w), 3)) for h, w in zip(cameras.height, cameras.width, strict=True))
    for index, image in enumerate(black if images is None else images):
        pixels = np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / "images" / image_name(index), compress_level=1)
    if layout == "colmap":
        _write_colmap(folder / "sparse" / "0", cameras, points)
        return
    if points is not None:
        write_points(folder / POINTS, *points)
    write_json(folder / "transforms.json", {**transforms(cameras, points is not None), **(extra or {})})


def transforms(cameras: Cameras, points: bool = False) -> dict[str, Any]:
    """transforms.json with the intrinsics in each frame, where nerfstudio, OpenSplat and instant-ngp all look.

    Instant-ngp divides a frame's cx by the same object's w, so that the sizes stand in the frames too.
    """
    frames = []
    for index, camera in enumerate(cameras):
        frames.append(
            {
                "file_path": f"images/{image_name(index)}",
                "w": int(camera.width[0]),
                "h": int(camera.height[0]),
                "fl_x": float(camera.fx[0]),
                "fl_y": float(camera.fy[0]),
                "cx": float(camera.cx[0]),
                "cy": float(camera.cy[0]),
                "transform_matrix": camera.c2w[0].tolist(),
            }
        )
    return {"camera_model": "PINHOLE", **({"ply_file_path": POINTS} if points else {}), "frames": frames}


def _write_colmap(folder: Path, cameras: Cameras, points: tuple[np.ndarray, np.ndarray] | None) -> None:
    """A COLMAP text model: one camera a frame, images in order, points without tracks."""
    folder.mkdir(parents=True)
    camera_lines, image_lines = [], []
    for index, camera in enumerate(cameras):
        numbers = " ".join(repr(float(values[0])) for values in (camera.fx, camera.fy, camera.cx, camera.cy))
        camera_lines.append(f"{index + 1} PINHOLE {camera.width[0]} {camera.height[0]} {numbers}\n")
        w2c = camera.world_to_camera()[0]
        pose = " ".join(repr(float(value)) for value in [*quaternion(w2c[:3, :3]), *w2c[:3, 3]])
        image_lines.append(f"{index + 1} {pose} {index + 1} {image_name(index)}\n\n")
    point_lines = []
    if points is not None:
        for index, (xyz, rgb) in enumerate(zip(points[0].tolist(), points[1].tolist(), strict=True)):
            numbers = " ".join(map(repr, xyz))
            point_lines.append(f"{index + 1} {numbers} {rgb[0]} {rgb[1]} {rgb[2]} 0\n")
    for name, lines in (("cameras", camera_lines), ("images", image_lines), ("points3D", point_lines)):
        write_text(folder / f"{name}.txt", "".join(lines))


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(4,) unit quaternion w, x, y, z with w ≥ 0 of a (3, 3) rotation.

    The eigenvector of Bar-Itzhack's symmetric matrix for its largest eigenvalue: no case distinction near 180°.
    """
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rotation.flatten()
    symmetric = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    vector = np.linalg.eigh(symmetric)[1][:, -1]
    return vector if vector[0] >= 0 else -vector


def write_points(path: Path, xyz: np.ndarray, rgb: np.ndarray) -> None:
    """A binary PLY of (P, 3) positions and (P, 3) uint8 colours, with the zero normals that 3DGS readers ask for."""
    floats = ("x", "y", "z", "nx", "ny", "nz")
    rows = np.zeros(
        len(xyz), [*((name, "<f4") for name in floats), *((name, "u1") for name in ("red", "green", "blue"))]
    )
    for axis in range(3):
        rows["xyz"[axis]] = xyz[:, axis]
        rows[("red", "green", "blue")[axis]] = rgb[:, axis]
    kinds = {"f": "float", "u": "uchar"}
    properties = "".join(f"property {kinds[rows.dtype[name].kind]} {name}\n" for name in rows.dtype.names or ())
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    path.write_bytes(header.encode() + rows.tobytes())


def read_images(files: list[Path], cameras: Cameras, what: str) -> Iterable[np.ndarray]:
    """Yields (H, W, 3) float32 in [0, 1] of the pictures that a renderer wrote, one for each camera.

    Raises UserError that says how many there are when one is missing, cannot be read or has another size.
    """
    from PIL import Image

    missing = [file for file in files if not file.is_file()]
    if missing:
        raise UserError(
            f"{what} wrote {len(files) - len(missing)} of {len(files)} renders, '{missing[0].name}' is not there; "
            "check `output` and what it printed"
        )
    for file, width, height in zip(files, cameras.width.tolist(), cameras.height.tolist(), strict=True):
        try:
            with Image.open(file) as picture:
                pixels = np.asarray(picture.convert("RGB"), dtype=np.float32) / 255
        except OSError as error:
            raise UserError(f"{what}: render '{file.name}' cannot be read: {error}") from None
        if pixels.shape != (height, width, 3):
            size = f"{pixels.shape[1]} × {pixels.shape[0]}"
            raise UserError(f"{what}: render '{file.name}' is {size} pixels, expected {width} × {height}")
        yield pixels
