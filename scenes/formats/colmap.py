"""COLMAP: sparse/0 in binary or text, images in images/ or images_2, images_4, images_8."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common.errors import UserError
from viewbench.scenes.types import OPENCV, Cameras, Points, Scene, Split

WRITABLE = True
MODELS = ("sparse/0", "sparse", "sparse_txt", "colmap/sparse/0", ".")
FOLDERS = ("images", "images_2", "images_4", "images_8")
# Parameters by model: focal lengths, centre, then k1, k2, p1, p2 where the model has them.
PINHOLES = {"SIMPLE_PINHOLE": 0, "PINHOLE": 0, "SIMPLE_RADIAL": 1, "RADIAL": 2, "OPENCV": 4}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    model = _model(root)
    return None if model is None else f"it has a model in {model.relative_to(root)}"


def _model(root: Path) -> Path | None:
    for folder in MODELS:
        for suffix in ("bin", "txt"):
            if all((root / folder / f"{name}.{suffix}").is_file() for name in ("cameras", "images", "points3D")):
                return root / folder
    return None


def read(root: Path) -> Scene:
    """Reads the registered images in natural order of their names, with points and tracks.

    Raises UserError for a model that pycolmap cannot read and a camera model with a lens other than OpenCV's.
    """
    import pycolmap

    model = _model(root)
    if model is None:
        raise UserError(f"'{root}' has no COLMAP model: no cameras, images and points3D in sparse/0")
    try:
        reconstruction = pycolmap.Reconstruction(model)
    except (RuntimeError, ValueError, IndexError, OSError, MemoryError) as error:
        text = str(error).splitlines() or ["unreadable"]
        raise UserError(f"COLMAP model '{model}' cannot be read: {text[0]}") from None
    images = sorted(
        (image for image in reconstruction.images.values() if image.has_pose),
        key=lambda image: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", image.name)],
    )
    if not images:
        raise UserError(f"COLMAP model '{model}' has no registered image")
    folder = next((root / name for name in FOLDERS if (root / name).is_dir()), root / "images")
    poses = np.stack([np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]]) for image in images])
    values = np.array([_intrinsics(reconstruction.cameras[image.camera_id]) for image in images])
    cameras = Cameras(
        c2w=np.linalg.inv(poses) @ OPENCV,
        fx=values[:, 0],
        fy=values[:, 1],
        cx=values[:, 2],
        cy=values[:, 3],
        width=values[:, 4].astype(np.int64),
        height=values[:, 5].astype(np.int64),
        distortion=values[:, 6:] if values[:, 6:].any() else None,
    )
    names = tuple(image.name for image in images)
    train = Split(names, tuple(folder / name for name in names), cameras)
    place = {image.image_id: index for index, image in enumerate(images)}
    return Scene(
        name=root.name,
        root=root,
        format="colmap",
        train=train,
        test=train.subset([]),
        points=_points(reconstruction, place),
        files=tuple(sorted(path for path in model.iterdir() if path.suffix in (".bin", ".txt"))),
        details={"model": model, "images": folder},
    )


def _intrinsics(camera: Any) -> list[float]:
    model = camera.model.name
    if model not in PINHOLES:
        raise UserError(f"COLMAP camera {camera.camera_id} is {model}; undistort it first (colmap image_undistorter)")
    lens = [0.0] * 4
    count = PINHOLES[model]
    if count:
        lens[:count] = [float(value) for value in camera.params[-count:]]
    width, height = float(camera.width), float(camera.height)
    return [
        camera.focal_length_x,
        camera.focal_length_y,
        camera.principal_point_x,
        camera.principal_point_y,
        width,
        height,
        *lens,
    ]


def _points(reconstruction: Any, place: dict[int, int]) -> Points | None:
    points = list(reconstruction.points3D.values())
    if not points:
        return None
    seen = tuple(
        np.unique([place[element.image_id] for element in point.track.elements if element.image_id in place]).astype(
            np.int64
        )
        for point in points
    )
    return Points(
        xyz=np.array([point.xyz for point in points], dtype=np.float64),
        rgb=np.array([point.color for point in points], dtype=np.uint8),
        seen_by=seen,
    )
