"""COLMAP: sparse/0 in binary or text, images in images/ or images_2, images_4, images_8."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common.errors import UserError
from viewbench.scenes.formats import _colmap_files
from viewbench.scenes.formats._frames import natural
from viewbench.scenes.image_files import image_size, is_file, leaves, stored_name
from viewbench.scenes.types import OPENCV, Cameras, Points, Scene, Split

WRITABLE = True
MODELS = ("sparse/0", "sparse", "sparse_txt", "colmap/sparse/0", ".")
FOLDERS = ("images", "images_2", "images_4", "images_8")
TEST = "test.txt"  # beside the model: names of the images that are held out, one a line
# How many of k1, k2, p1, p2, k3 stand behind the focal lengths and the centre in a camera's parameters.
LENSES = {"SIMPLE_PINHOLE": 0, "PINHOLE": 0, "SIMPLE_RADIAL": 1, "RADIAL": 2, "OPENCV": 4, "FULL_OPENCV": 5}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None; a model that nerfstudio left beside its transforms.json is not."""
    model = _model(root)
    if model == root / "colmap" / "sparse" / "0" and (root / "transforms.json").is_file():
        return None
    return None if model is None else f"it has a model in {model.relative_to(root)}"


def _model(root: Path) -> Path | None:
    for folder in MODELS:
        for suffix in ("bin", "txt"):
            if all((root / folder / f"{name}.{suffix}").is_file() for name in ("cameras", "images", "points3D")):
                return root / folder
    return None


def read(root: Path) -> Scene:
    """Reads the registered images in natural order of their names, with points and tracks.

    Raises UserError for a model that pycolmap cannot read, for image names that leave the folder of images, and for
    cameras without a focal length.
    """
    import pycolmap

    model = _model(root)
    if model is None:
        raise UserError(f"'{root}' has no COLMAP model: no cameras, images and points3D in sparse/0")
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
    folder = next((root / name for name in FOLDERS if (root / name).is_dir()), root / "images")
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
    if folder.name != "images":  # images_2, images_4, images_8: the model speaks of the full size
        cameras = cameras.scaled(image_size(folder / names[0])[0])
    lens = next((name for image in images if (name := _lens(reconstruction.cameras[image.camera_id]))), "")
    every = Split(names, tuple(folder / name for name in names), cameras, lens=lens)
    held = _held_out(model, names)
    kept = np.setdiff1d(np.arange(len(names)), held)
    train_ids = (images[i].image_id for i in kept)
    place = {image_id: index for index, image_id in enumerate(train_ids)}
    return Scene(
        name=root.name,
        root=root,
        format="colmap",
        train=every.subset(kept),
        test=every.subset(held),
        points=_points(reconstruction, place),
        files=tuple(sorted(path for path in model.iterdir() if path.suffix in (".bin", ".txt"))),
        notes=_others(model),
        details={"model": model, "images": folder} | _convention(root, held),
    )


def _others(model: Path) -> tuple[str, ...]:
    """A note where the capture fell apart into several models."""
    models = [path for path in model.parent.glob("[0-9]*") if path.is_dir()] if model.name == "0" else []
    return (f"{len(models)} models in {model.parent.name}/; only the first is read",) if len(models) > 1 else ()


def _convention(root: Path, held: np.ndarray) -> dict[str, str]:
    """Mip-NeRF 360 and LLFF, which have poses_bounds.npy, test on every 8th image unless somebody says otherwise."""
    return {"holdout": "every:8"} if (root / "poses_bounds.npy").is_file() and not len(held) else {}


def _held_out(model: Path, names: tuple[str, ...]) -> np.ndarray:
    """Indices of the images that test.txt beside the model names. Raises UserError for a name that is not there."""
    if not (model / TEST).is_file():
        return np.zeros(0, dtype=np.int64)
    try:
        listed = [line for line in (model / TEST).read_text(encoding="utf-8").split("\n") if line]
    except UnicodeDecodeError:
        raise UserError(f"'{model / TEST}' is no text file of image names") from None
    index = {name: i for i, name in enumerate(names)}
    # A name with a line break is written as JSON; no other name is looked up so.
    index |= {json.dumps(name): i for i, name in enumerate(names) if "\n" in name}
    unknown = [name for name in listed if name not in index]
    if unknown:
        raise UserError(f"'{model / TEST}' names image '{unknown[0]}', which the model does not have")
    return np.array(sorted({index[name] for name in listed}), dtype=np.int64)


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


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes sparse/0 with the chosen and the test images, and images/ with what smaller ones there are beside it.

    A scene that was read from COLMAP keeps its cameras, its points that at least two of those images see, and their
    tracks; any other becomes a model of pinhole (or OpenCV) cameras without tracks. COLMAP has no splits: the names of
    the test images stand in sparse/0/test.txt, where the 3DGS authors' reader looks too. A name with a line break is
    written there as JSON.
    """
    import pycolmap

    from viewbench.scenes.subset import place_image

    train = scene.train.subset(indices)
    kept, paths = [*train.names, *scene.test.names], [*train.paths, *scene.test.paths]
    if scene.format == "colmap":
        model = pycolmap.Reconstruction(scene.details["model"])
        wanted = set(kept)
        for image in list(model.images.values()):
            if image.name not in wanted and image.has_pose:
                model.deregister_frame(image.frame_id)
        for point_id, point in list(model.points3D.items()):
            if len({element.image_id for element in point.track.elements}) < 2:
                model.delete_point3D(point_id)
    else:
        kept = [stored_name(name, path, i) for i, (name, path) in enumerate(zip(kept, paths, strict=True))]
        if all(name.startswith("images/") for name in kept):
            kept = [name.removeprefix("images/") for name in kept]
        model = _new_model(scene, [train.cameras, scene.test.cameras], kept)
    folder = out / "sparse" / "0"
    folder.mkdir(parents=True)
    model.write(folder)
    read = scene.details["images"] if scene.format == "colmap" else scene.root / "images"
    for name, path in zip(kept, paths, strict=True):
        place_image(path, out / read.name / name, copy)
    if scene.format == "colmap":
        for other in FOLDERS:
            for name in kept:
                if other != read.name and is_file(scene.root / other / name):
                    place_image(scene.root / other / name, out / other / name, copy)
    if len(scene.test):
        lines = [json.dumps(name) if "\n" in name else name for name in kept[len(train) :]]
        (folder / TEST).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _new_model(scene: Scene, groups: Sequence[Cameras], names: Sequence[str]) -> Any:
    """A model of the cameras of both splits with these image names; points have colours and no tracks."""
    import pycolmap

    model = pycolmap.Reconstruction()
    camera_of: dict[tuple, int] = {}
    for name, camera in zip(names, (camera for cameras in groups for camera in cameras), strict=True):
        lens = [] if camera.distortion is None else camera.distortion[0].tolist()
        kind = "PINHOLE" if not any(lens) else "FULL_OPENCV" if lens[4] else "OPENCV"
        focal = [float(value[0]) for value in (camera.fx, camera.fy, camera.cx, camera.cy)]
        params = (focal + [*lens, 0.0, 0.0, 0.0])[: {"PINHOLE": 4, "OPENCV": 8, "FULL_OPENCV": 12}[kind]]
        key = (kind, int(camera.width[0]), int(camera.height[0]), *params)
        if key not in camera_of:
            camera_of[key] = len(camera_of) + 1
            made = pycolmap.Camera(model=kind, width=key[1], height=key[2], params=params, camera_id=camera_of[key])
            model.add_camera_with_trivial_rig(made)
        image = pycolmap.Image(name=name, camera_id=camera_of[key], image_id=model.num_images() + 1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(camera.world_to_camera()[0, :3]))
    if scene.points is not None:
        for xyz, rgb in zip(scene.points.xyz, scene.points.rgb, strict=True):
            model.add_point3D(xyz, pycolmap.Track(), rgb)
    return model
