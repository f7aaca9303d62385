"""COLMAP: sparse/0 in binary or text, images in images/ or images_2, images_4, images_8."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import UserError
from ..image_files import image_size, is_file, leaves
from ..splits import training_points
from ..types import OPENCV, Cameras, Points, Scene, Split
from . import _colmap_files
from ._colmap_write import BOTH_MODEL, FOLDERS, TEST, TEST_MODEL, write
from ._frames import natural

__all__ = ["WRITABLE", "detect", "read", "write"]

WRITABLE = True
MODELS = ("sparse/0", "sparse", "sparse_txt", "colmap/sparse/0", ".")
REQUIRED = ("cameras", "images", "points3D")  # files of a model
BOUNDS = "poses_bounds.npy"
# How many of k1, k2, p1, p2, k3 stand behind the focal lengths and the centre in a camera's parameters.
LENSES = {"SIMPLE_PINHOLE": 0, "PINHOLE": 0, "SIMPLE_RADIAL": 1, "RADIAL": 2, "OPENCV": 4, "FULL_OPENCV": 5}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None; a model that nerfstudio left beside its transforms.json is not."""
    model = _model(root)
    if model == root / "colmap" / "sparse" / "0" and (root / "transforms.json").is_file():
        return None
    return None if model is None else f"it has a model in {model.relative_to(root)}"


def _model(root: Path) -> Path | None:
    return next((root / folder for folder in MODELS if _is_model(root / folder)), None)


def read(root: Path) -> Scene:
    """Reads the registered images in natural order of their names, with points and tracks.

    Raises UserError for a model that pycolmap cannot read, for image names that leave the folder of images, and for
    cameras without a focal length.
    """
    model = _model(root)
    if model is None:
        raise UserError(f"'{root}' has no COLMAP model: no cameras, images and points3D in sparse/0")
    reconstruction, images = _registered(model)
    folder = next((root / name for name in FOLDERS if (root / name).is_dir()), root / "images")
    every, points = _split(reconstruction, images, folder), _points(reconstruction, images)
    files, notes = [model], list(_others(model))
    details: dict[str, Any] = {"images": folder}
    full = reconstruction.cameras[images[0].camera_id].width
    if folder.name == "images" and full != every.cameras.width[0]:
        notes.append(f"images are {every.cameras.width[0]} wide and their cameras {full}: cameras are scaled to them")
    test = _test_model(root, model)
    if test is not None:
        test_images = test[1]
        kept = np.arange(len(images))
        held_split = _split(*test, folder=root / TEST_MODEL.split("/")[0] / folder.name)
        files.append(root / TEST_MODEL)
        details["models"] = {"train": model, "test": root / TEST_MODEL}
        both = root / BOTH_MODEL
        if _is_model(both) and {image.name for image in _registered(both)[1]} >= {
            image.name for image in (*images, *test_images)
        }:
            details["models"]["train+test"] = both
    else:
        held, unknown = _held_out(model, every.names)
        notes += unknown
        kept, held_split = np.setdiff1d(np.arange(len(images)), held), every.subset(held)
        details["models"] = dict.fromkeys(("train", "test", "train+test"), model)
    points, left_out = training_points(points, kept, len(images))
    if (root / BOUNDS).is_file() and not len(held_split):
        details["holdout"] = "every:8"  # unless somebody says otherwise
        notes.append(
            f"{BOUNDS} is here, as in Mip-NeRF 360 and LLFF: every 8th image tests, unless --holdout says otherwise"
        )
    return Scene(
        name=root.name,
        root=root,
        format="colmap",
        train=every.subset(kept),
        test=held_split,
        points=points,
        files=tuple(path for folder in files for path in _files(folder)),
        notes=(*notes, *left_out),
        details=details,
    )


def _files(model: Path) -> list[Path]:
    """What a model was read from."""
    names = [f"{name}.{suffix}" for name in (*REQUIRED, "rigs", "frames") for suffix in ("bin", "txt")]
    return sorted(model / name for name in (*names, TEST) if is_file(model / name))


def _test_model(root: Path, model: Path) -> tuple[Any, list[Any]] | None:
    """The test views' own model that viewbench writes; any other folder test/ is none of ours.

    It is known by the list beside the training model, which names just its images.
    """
    if not _is_model(root / TEST_MODEL) or (root / TEST_MODEL) == model or not (model / TEST).is_file():
        return None
    found = _registered(root / TEST_MODEL)
    return found if {image.name for image in found[1]} == set(_listed(model / TEST)) else None


def _is_model(folder: Path) -> bool:
    return any(all((folder / f"{name}.{suffix}").is_file() for name in REQUIRED) for suffix in ("bin", "txt"))


def _registered(model: Path) -> tuple[Any, list[Any]]:
    """The model and its images that have a pose, in natural order of their names."""
    import pycolmap

    _colmap_files.check(model)
    try:
        reconstruction = pycolmap.Reconstruction(model)
    except (RuntimeError, ValueError, IndexError, OSError, MemoryError) as error:
        text = str(error).splitlines() or ["unreadable"]
        raise UserError(f"COLMAP model '{model}' cannot be read: {text[0]}") from None
    try:
        registered = [(natural(image.name), image) for image in reconstruction.images.values() if image.has_pose]
    except UnicodeDecodeError:
        raise UserError(f"COLMAP model '{model}' has an image name that is not UTF-8 text") from None
    images = [image for _, image in sorted(registered, key=lambda pair: pair[0])]
    if not images:
        raise UserError(f"COLMAP model '{model}' has no registered image")
    outside = next((image.name for image in images if leaves(image.name)), None)
    if outside is not None:
        raise UserError(f"COLMAP model '{model}': image '{outside}' leaves the folder of images; correct its name")
    return reconstruction, images


def _split(reconstruction: Any, images: Sequence[Any], folder: Path) -> Split:
    """Frames of these images, whose pictures are in `folder`."""
    world_to_camera = np.stack([image.cam_from_world().matrix() for image in images])
    turn = world_to_camera[:, :, :3].transpose(0, 2, 1)
    poses = np.tile(np.eye(4), (len(images), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = turn, -np.einsum("nij,nj->ni", turn, world_to_camera[:, :, 3])
    values = np.array([_intrinsics(reconstruction.cameras[image.camera_id]) for image in images])
    cameras = Cameras(
        c2w=poses @ OPENCV,
        fx=values[:, 0],
        fy=values[:, 1],
        cx=values[:, 2],
        cy=values[:, 3],
        width=values[:, 4].astype(np.int64),
        height=values[:, 5].astype(np.int64),
        distortion=values[:, 6:] if values[:, 6:].any() else None,
    )
    names = tuple(image.name for image in images)
    if folder.name != "images" or _shrunk(cameras, folder / names[0]):  # the model speaks of the full size
        cameras = cameras.scaled(image_size(folder / names[0])[0])
    lens = next((name for image in images if (name := _lens(reconstruction.cameras[image.camera_id]))), "")
    return Split(names, tuple(folder / name for name in names), cameras, lens=lens)


def _shrunk(cameras: Cameras, image: Path) -> bool:
    """Whether the picture is its camera's drawn smaller, as in the 3DGS authors' Tanks and Temples."""
    try:
        width, height = image_size(image)
    except UserError:
        return False  # whoever wants its pixels says what is wrong with it
    return width < cameras.width[0] and int(cameras[0].scaled(width).height[0]) == height


def _others(model: Path) -> tuple[str, ...]:
    """A note where the capture fell apart into several models."""
    models = [path for path in model.parent.glob("[0-9]*") if path.is_dir()] if model.name == "0" else []
    return (f"{len(models)} models in {model.parent.name}/; only the first is read",) if len(models) > 1 else ()


def _listed(file: Path) -> list[str]:
    """Names in test.txt; one with a line break is written as JSON."""
    try:
        lines = [line for line in file.read_text(encoding="utf-8").split("\n") if line.strip()]
    except UnicodeDecodeError:
        raise UserError(f"'{file}' is no text file of image names") from None
    return [_unquoted(line) for line in lines]


def _unquoted(line: str) -> str:
    """The name that a line stands for: only a line that is the JSON of a name with a line break is read as JSON."""
    try:
        name = json.loads(line) if line.startswith('"') else line
    except ValueError:
        return line
    return name if isinstance(name, str) and "\n" in name else line


def _held_out(model: Path, names: tuple[str, ...]) -> tuple[np.ndarray, list[str]]:
    """Indices of the images that test.txt beside the model names, and a note of those that the model does not have.

    Raises UserError where it has none of them.
    """
    file = model / TEST
    if not file.is_file():
        return np.zeros(0, dtype=np.int64), []
    index = {name: i for i, name in enumerate(names)}
    listed = [name if name in index else name.strip() for name in _listed(file)]
    unknown = [name for name in listed if name not in index]
    if unknown and len(unknown) == len(listed):
        raise UserError(f"'{file}' names image '{unknown[0]}', which the model does not have, and no other")
    notes = [f"{len(unknown)} of {len(listed)} names in {TEST} are of no image that has a pose"] if unknown else []
    return np.array(sorted({index[name] for name in listed if name in index}), dtype=np.int64), notes


def _intrinsics(camera: Any) -> list[float]:
    """fx, fy, cx, cy, width, height, k1, k2, p1, p2, k3; no distortion for a lens that is not OpenCV's."""
    if not camera.focal_length_idxs():  # asked for one, pycolmap would crash
        raise UserError(f"COLMAP camera {camera.camera_id} is {camera.model.name}, which has no focal length")
    focal = [camera.focal_length_x, camera.focal_length_y, camera.principal_point_x, camera.principal_point_y]
    count = 0 if _lens(camera) else LENSES[camera.model.name]
    first = len(camera.params) - count if camera.model.name != "FULL_OPENCV" else 4
    lens = [float(value) for value in camera.params[first : first + count]]
    return [*focal, float(camera.width), float(camera.height), *lens, *[0.0] * (5 - count)]


def _lens(camera: Any) -> str:
    """Name of the camera's model where k1, k2, p1, p2, k3 do not tell all of it, else nothing."""
    model = camera.model.name
    return "" if model in LENSES and not (model == "FULL_OPENCV" and any(camera.params[9:])) else model


def _points(reconstruction: Any, images: Sequence[Any]) -> Points | None:
    """Points with the indices of the images that see them."""
    points = list(reconstruction.points3D.values())
    if not points:
        return None
    place = {image.image_id: index for index, image in enumerate(images)}
    seen = tuple(
        # A set of Python's: numpy's `unique` takes ten times as long for the few of a point.
        np.array(sorted({place[e.image_id] for e in point.track.elements if e.image_id in place}), np.int64)
        for point in points
    )
    return Points(
        xyz=np.array([point.xyz for point in points], dtype=np.float64),
        rgb=np.array([point.color for point in points], dtype=np.uint8),
        seen_by=seen,
    )
