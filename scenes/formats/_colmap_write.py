"""Writes COLMAP models: the chosen views where every reader looks, the test views where none trains on them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..image_files import is_file, stored_name
from ..subset import place_image
from ..types import Cameras, Points, Scene

FOLDERS = ("images", "images_2", "images_4", "images_8")
TEST = "test.txt"  # beside the model: names of the images that are held out, one a line
TEST_MODEL = "test/sparse/0"  # the held-out images' own model, their pictures in test/images
BOTH_MODEL = "colmap/sparse/0"  # nerfstudio's, with the images of both splits
LEAST_TRACK = 2  # images that triangulate a point


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes the chosen views as sparse/0, with images/ and what smaller ones there are beside it.

    COLMAP has no splits, and its readers train on what is in sparse/0 whatever else lies about. So the test views have
    a model, and a folder, of their own: test/sparse/0 and test/images. Nerfstudio wants both in one model, and finds
    it in colmap/sparse/0 with the lists of names that it obeys: train_list.txt, val_list.txt and test_list.txt.
    sparse/0/test.txt, the list of the 3DGS authors' reader, names the test views again (as JSON where a name has a
    line break). Trainers that read images/ without a model find the test images there too.

    A scene that was read from COLMAP keeps its cameras, the tracks between the views written, and all points that at
    least two training views of the capture see, whichever were chosen; any other becomes a model of pinhole (or
    OpenCV) cameras, with its points but without tracks.
    """
    train = scene.train.subset(indices)
    if scene.format == "colmap":
        names = {"train": list(train.names), "test": list(scene.test.names)}
    else:
        every, paths = [*train.names, *scene.test.names], [*train.paths, *scene.test.paths]
        stored = [stored_name(name, path, i) for i, (name, path) in enumerate(zip(every, paths, strict=True))]
        if all(name.startswith("images/") for name in stored):
            stored = [name.removeprefix("images/") for name in stored]
        names = {"train": stored[: len(train)], "test": stored[len(train) :]}
    _write_model(out, "sparse/0", scene, names, ("train",), train.cameras)
    _place(scene, names["train"], train.paths, out, copy)
    if not len(scene.test):
        return
    _place(scene, names["test"], scene.test.paths, out, copy)
    _write_model(out / "test", "sparse/0", scene, names, ("test",), scene.test.cameras)
    _place(scene, names["test"], scene.test.paths, out / "test", copy)
    lines = [json.dumps(name) if "\n" in name else name for name in names["test"]]
    (out / "sparse" / "0" / TEST).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    if _write_model(out, "colmap/sparse/0", scene, names, ("train", "test"), train.cameras, scene.test.cameras):
        for split, key in (("train", "train"), ("val", "test"), ("test", "test")):
            text = "".join(f"{name}\n" for name in names[key])
            (out / f"{split}_list.txt").write_text(text, encoding="utf-8")


def _place(scene: Scene, names: Sequence[str], paths: Sequence[Path], out: Path, copy: bool) -> None:
    """Images under the names of the model; smaller ones too, where the capture has them."""
    read = scene.details["images"] if scene.format == "colmap" else scene.root / "images"
    for name, path in zip(names, paths, strict=True):
        place_image(path, out / read.name / name, copy)
        if scene.format == "colmap":
            for other in FOLDERS:
                if other != read.name and is_file(scene.root / other / name):
                    place_image(scene.root / other / name, out / other / name, copy)


def _write_model(
    out: Path, place: str, scene: Scene, names: dict[str, list[str]], splits: Sequence[str], *cameras: Cameras
) -> bool:
    """Writes one model of these splits; False where no single model that was read has all of their images."""
    wanted = [name for split in splits for name in names[split]]
    if scene.format == "colmap":
        source = scene.details["models"].get("+".join(splits))
        if source is None:
            return False
        model = _reduced(source, wanted, scene.points)
    else:
        model = _new_model(scene, cameras, wanted)
    (out / place).mkdir(parents=True)
    model.write(out / place)
    return True


def _reduced(source: Path, wanted: Sequence[str], points: Points | None) -> Any:
    """The model with these images alone, and with all of `points`: those whose tracks are gone have none."""
    import pycolmap

    model, kept = pycolmap.Reconstruction(source), set(wanted)
    for image in list(model.images.values()):
        if image.name not in kept and image.has_pose:
            model.deregister_frame(image.frame_id)
    if points is None:
        for point_id in list(model.points3D):
            model.delete_point3D(point_id)
        return model
    missing: dict[tuple[float, ...], list[np.ndarray]] = {}  # colours by place: two points may lie in one
    for xyz, rgb in zip(points.xyz.tolist(), points.rgb, strict=True):
        missing.setdefault(tuple(xyz), []).append(rgb)
    for point_id, point in list(model.points3D.items()):
        seen_by = {element.image_id for element in point.track.elements}
        here = missing.get(tuple(point.xyz.tolist()))
        if here and len(seen_by) >= LEAST_TRACK:
            here.pop()
        else:
            model.delete_point3D(point_id)  # its track is gone, or the training views do not know it
    for place, colours in missing.items():
        for rgb in colours:
            model.add_point3D(np.array(place), pycolmap.Track(), rgb)
    return model


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
