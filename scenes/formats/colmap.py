"""COLMAP: sparse/0 in binary or text, images in images/ or images_2, images_4, images_8."""

from pathlib import Path
from typing import Any

import numpy as np

from viewbench.common.errors import UserError
from viewbench.scenes.formats import _colmap_files
from viewbench.scenes.formats._frames import image_size, natural
from viewbench.scenes.types import OPENCV, Cameras, Points, Scene, Split

WRITABLE = True
MODELS = ("sparse/0", "sparse", "sparse_txt", "colmap/sparse/0", ".")
FOLDERS = ("images", "images_2", "images_4", "images_8")
TEST = "test.txt"  # beside the model: names of the images that are held out, one a line
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
    every = Split(names, tuple(folder / name for name in names), cameras)
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
        details={"model": model, "images": folder} | _convention(root, held),
    )


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
    unknown = [name for name in listed if name not in index]
    if unknown:
        raise UserError(f"'{model / TEST}' names image '{unknown[0]}', which the model does not have")
    return np.array(sorted({index[name] for name in listed}), dtype=np.int64)


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


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes sparse/0 with the chosen and the test images, and images/.

    A scene that was read from COLMAP keeps its cameras, its points that at least two of those images see, and their
    tracks; any other becomes a model of pinhole (or OpenCV) cameras without tracks. COLMAP has no splits: the names of
    the test images stand in sparse/0/test.txt, where the 3DGS authors' reader looks too.
    """
    import pycolmap

    from viewbench.scenes.subset import place_image

    kept = [*(scene.train.names[i] for i in indices), *scene.test.names]
    paths = dict(zip((*scene.train.names, *scene.test.names), (*scene.train.paths, *scene.test.paths), strict=True))
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
        model = _new_model(scene, indices)
    folder = out / "sparse" / "0"
    folder.mkdir(parents=True)
    model.write(folder)
    for name in kept:
        place_image(paths[name], out / "images" / name, copy)
    if len(scene.test):
        (folder / TEST).write_text("".join(f"{name}\n" for name in scene.test.names), encoding="utf-8")


def _new_model(scene: Scene, indices: np.ndarray) -> Any:
    """A model of the chosen and the test views; points have colours and no tracks."""
    import pycolmap

    model = pycolmap.Reconstruction()
    camera_of: dict[tuple, int] = {}
    for split in (scene.train.subset(indices), scene.test):
        for name, camera in zip(split.names, split.cameras, strict=True):
            lens = None if camera.distortion is None else camera.distortion[0].tolist()
            focal = [float(value[0]) for value in (camera.fx, camera.fy, camera.cx, camera.cy)]
            key = (int(camera.width[0]), int(camera.height[0]), *focal, *(lens or []))
            if key not in camera_of:
                camera_of[key] = len(camera_of) + 1
                made = pycolmap.Camera(
                    model="OPENCV" if lens else "PINHOLE",
                    width=key[0],
                    height=key[1],
                    params=focal + (lens or []),
                    camera_id=camera_of[key],
                )
                model.add_camera_with_trivial_rig(made)
            image = pycolmap.Image(name=name, camera_id=camera_of[key], image_id=model.num_images() + 1)
            pose = pycolmap.Rigid3d(camera.world_to_camera()[0, :3])
            model.add_image_with_trivial_frame(image, pose)
    if scene.points is not None:
        for xyz, rgb in zip(scene.points.xyz, scene.points.rgb, strict=True):
            model.add_point3D(xyz, pycolmap.Track(), rgb)
    return model
