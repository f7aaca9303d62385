"""COLMAP: sparse/0 in binary or text, images in images/ or images_2, images_4, images_8."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...common import bounded, limits
from ...common.errors import UserError
from ..companions import first_of
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


def _model(root: Path, number: int | None = None) -> Path | None:
    """The folder of the model to read: where a capture fell apart into several, the one with most images.

    Raises UserError where there is none with the `number` that was asked for.
    """
    numbered = _numbered(root)
    if number is not None:
        if number not in numbered:
            known = ", ".join(map(str, numbered)) or "none"
            raise UserError(f"'{root / 'sparse'}' has no model {number} (there are: {known}); name one of those")
        return numbered[number]
    if len(numbered) > 1:
        return numbered[max(numbered, key=lambda key: (_image_count(numbered[key]), -key))]
    return next((path for path in (*(root / name for name in MODELS), *numbered.values()) if _is_model(path)), None)


def _numbered(root: Path) -> dict[int, Path]:
    """The models in sparse/ by their numbers, in order."""
    folders = [path for path in (root / "sparse").glob("[0-9]*") if path.name.isdecimal() and _is_model(path)]
    return {int(path.name): path for path in sorted(folders, key=lambda path: int(path.name))}


def _image_count(model: Path) -> int:
    """Images of a model as its file says, without reading it whole. 0 where it cannot be told."""
    try:
        if (model / "images.bin").is_file():
            with (model / "images.bin").open("rb") as file:
                return int.from_bytes(file.read(8), "little")
        bounded.checked(model / "images.txt", limits.COLMAP_BYTES)
        begins, count = True, 0
        with (model / "images.txt").open("rb") as file:
            while line := file.readline(limits.LINE_LETTERS):  # of points a line may have any length
                count += begins and not line.startswith(b"#")
                begins = line.endswith(b"\n")
        return count // 2  # two lines an image
    except OSError:
        return 0


def read(root: Path, model_number: int | None = None) -> Scene:
    """Reads the registered images in natural order of their names, with points and tracks.

    Of several models in sparse/ it is that with most images, or the one with the number that is given. Raises UserError
    for a model that pycolmap cannot read, for image names that leave the folder of images, and for cameras without a
    focal length.
    """
    model = _model(root, model_number)
    if model is None:
        raise UserError(f"'{root}' has no COLMAP model: no cameras, images and points3D in sparse/0")
    reconstruction, images = _registered(model)
    folder = next((root / name for name in FOLDERS if (root / name).is_dir()), root / "images")
    every, points = _split(reconstruction, images, folder, root), _points(reconstruction, images)
    files, notes = [model], [*_others(root, model), *_resized(reconstruction, images, every, folder)]
    details: dict[str, Any] = {"images": folder}
    test = _test_model(root, model)
    if test is not None:
        test_images = test[1]
        kept = np.arange(len(images))
        held_split = _split(*test, folder=root / TEST_MODEL.split("/")[0] / folder.name, beside=root)
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
        details["holdout_note"] = (
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


def _split(reconstruction: Any, images: Sequence[Any], folder: Path, beside: Path) -> Split:
    """Frames of these images, whose pictures are in `folder`, and masks and depth images in folders of `beside`."""
    try:
        world_to_camera = np.stack([image.cam_from_world().matrix() for image in images])
    except (RuntimeError, ValueError, IndexError, KeyError) as error:
        raise UserError(f"COLMAP model of '{beside}': an image has no place in its rig ({error})") from None
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
    paths = tuple(folder / name for name in names)
    lens = next((name for image in images if (name := _lens(reconstruction.cameras[image.camera_id]))), "")
    depths, masks = (first_of(beside, kind, names) for kind in ("depths", "masks"))
    return Split(names, paths, _fitted(cameras, paths), lens=lens, depths=depths, masks=masks)


def _fitted(cameras: Cameras, paths: Sequence[Path]) -> Cameras:
    """The cameras at the size that the images have: images_2 and the like, and images that were resized where they lie.

    Where an image has another shape than its camera the camera stays as it is; `check_present` finds it.
    """
    sizes = np.stack([cameras.width, cameras.height], axis=1)
    one = bool((sizes == sizes[0]).all())
    heads = [_size(path) for path in (paths[:1] if one else paths)]
    found = np.array([head or size for head, size in zip(heads * (len(paths) if one else 1), sizes, strict=True)])
    scale = found / sizes
    # Sizes are whole numbers: the two scales may differ by a pixel of the smaller picture.
    alike = np.abs(scale[:, 0] - scale[:, 1]) * sizes.max(axis=1) <= 1.5 * np.maximum(1, scale.max(axis=1))
    found = np.where(alike[:, None], found, sizes).astype(np.int64)
    return cameras if (found == sizes).all() else cameras.resized(found[:, 0], found[:, 1])


def _size(path: Path) -> tuple[int, int] | None:
    """Width and height of an image; None where it cannot be read, which whoever wants its pixels says."""
    try:
        return image_size(path)
    except UserError:
        return None


def _others(root: Path, model: Path) -> tuple[str, ...]:
    """A note where the capture fell apart into several models."""
    numbered = _numbered(root)
    if len(numbered) < 2 or model.parent != root / "sparse":
        return ()
    counts = ", ".join(f"{key} with {_image_count(path)}" for key, path in numbered.items())
    return (f"sparse/ has {len(numbered)} models (images: {counts}); {model.name} is read, --model names another",)


def _resized(reconstruction: Any, images: Sequence[Any], frames: Split, folder: Path) -> tuple[str, ...]:
    """A note where the images in images/ are not as big as the model's cameras."""
    camera = reconstruction.cameras[images[0].camera_id]
    size, found = (camera.width, camera.height), (int(frames.cameras.width[0]), int(frames.cameras.height[0]))
    if folder.name != "images" or size == found:
        return ()
    return (f"images are {found[0]} x {found[1]}, the model's cameras {size[0]} x {size[1]}: the cameras were scaled",)


def _listed(file: Path) -> list[str]:
    """Names in test.txt; one with a line break is written as JSON."""
    try:
        text = bounded.data(file, "list", limits.TEXT_BYTES).decode("utf-8")
        lines = [line for line in text.split("\n", limits.LINES)[: limits.LINES] if line.strip()]
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
    if max(camera.width, camera.height) > limits.SIDE:
        raise UserError(f"COLMAP camera {camera.camera_id} is of {camera.width} x {camera.height} pixels")
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
