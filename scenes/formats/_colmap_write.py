"""Writes COLMAP models: the chosen views where every reader looks, the test views where none trains on them."""

import json
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...common.errors import UserError
from ...common.files import read_json, write_json
from ..companions import beside
from ..image_files import is_file, stored_name
from ..splits import LEAST_TRACK
from ..subset import place_image
from ..types import Cameras, Points, Scene, Split

FOLDERS = ("images", "images_2", "images_4", "images_8")
TEST = "test.txt"  # beside the model: names of the images that are held out, one a line
TEST_MODEL = "test/sparse/0"  # the held-out images' own model, their pictures in test/images
BOTH_MODEL = "colmap/sparse/0"  # nerfstudio's, with the images of both splits
DEPTH_PARAMS = "depth_params.json"  # the 3DGS authors', beside the model
EVALUATED = 8  # nerfstudio's curves are of every 8th image where there is no test split


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> list[str]:
    """Writes the chosen views as sparse/0, with images/, and what masks and smaller copies there are, beside it.

    COLMAP has no splits, and its readers train on what is in sparse/0 whatever else lies about. So the test views have
    a model, and a folder, of their own: test/sparse/0 and test/images. Nerfstudio wants both in one model, and finds
    it in colmap/sparse/0 with the lists of names that it obeys: train_list.txt, val_list.txt and test_list.txt (none
    of it where a name has a line break, which cuts it in two there). Without them it would hold out every 8th of the
    chosen views; where there is no test split those are listed for its curves, and trained on all the same.
    sparse/0/test.txt, the list of the 3DGS authors' reader, names the test views again (as JSON where a name has a line
    break).

    A scene that was read from COLMAP keeps its cameras, the tracks between the views written, and all points that at
    least two training views of the capture see, whichever were chosen; any other becomes a model of pinhole (or
    OpenCV) cameras, with its points but without tracks. Returns notes for people.
    """
    train, test = scene.train.subset(indices), scene.test
    names = _stored_names(scene, train, test)
    for name in (*names["train"], *names["test"]):
        if not name.isprintable() and any("\ud800" <= letter <= "\udfff" for letter in name):
            raise UserError(
                f"image '{name}' has a name that is not UTF-8 text, which COLMAP's files cannot hold; rename it"
            )
    smaller = _smaller_folders(scene, [*names["train"], *names["test"]])
    _write_model(out, "sparse/0", scene, names, ("train",), train.cameras)
    _place(scene, names["train"], train.paths, smaller, out, copy)
    every = [*names["train"], *names["test"]]
    for source, place in beside(scene.root, every) if scene.format == "colmap" else _of_frames(names, train, test):
        place_image(source, out / place, copy)
    notes = _notes(scene, train, smaller)
    if len(test):
        _place(scene, names["test"], test.paths, smaller, out, copy)
        _write_model(out / "test", "sparse/0", scene, names, ("test",), test.cameras)
        _place(scene, names["test"], test.paths, smaller, out / "test", copy)
        lines = [json.dumps(name) if "\n" in name else name for name in names["test"]]
        (out / "sparse" / "0" / TEST).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    _depth_params(scene, every, out)
    if any(name.splitlines() != [name] for name in every):
        return [*notes, "an image's name has a line break: nerfstudio, which cannot be told of it, gets no model"]
    splits, cameras = (
        (("train", "test"), (train.cameras, test.cameras)) if len(test) else (("train",), (train.cameras,))
    )
    if _write_model(out, BOTH_MODEL, scene, names, splits, *cameras):
        held = names["test"] or names["train"][::EVALUATED]
        for split, listed in (("train", names["train"]), ("val", held), ("test", held)):
            (out / f"{split}_list.txt").write_text("".join(f"{name}\n" for name in listed), encoding="utf-8")
    return notes


def _of_frames(names: dict[str, list[str]], train: Split, test: Split) -> list[tuple[Path, str]]:
    """Masks and depth images that another format has for its frames, and where nerfstudio's COLMAP reader looks."""
    found = []
    for key, split in (("train", train), ("test", test)):
        for kind, files in (("masks", split.masks), ("depths", split.depths)):
            for name, file in zip(names[key], files, strict=False):
                if file is not None:
                    found.append((file, f"{kind}/{PurePosixPath(name).with_suffix(file.suffix).as_posix()}"))
    return found


def _depth_params(scene: Scene, names: Sequence[str], out: Path) -> None:
    """Writes the part of the 3DGS authors' depth_params.json (scales by image, for `-d`) that is of these images."""
    if scene.format != "colmap" or not is_file(file := scene.details["models"]["train"] / DEPTH_PARAMS):
        return
    known, stems = read_json(file, "depth parameters"), {name.rsplit(".", 1)[0] for name in names}
    write_json(out / "sparse" / "0" / DEPTH_PARAMS, {key: known[key] for key in known if key in stems})


def _notes(scene: Scene, train: Split, smaller: Sequence[str]) -> list[str]:
    """What of the capture is left out, or written as few readers have it."""
    if scene.format == "colmap":
        here = (*smaller, _images_folder(scene).name)
        gone = [name for name in FOLDERS if name not in here and (scene.root / name).is_dir()]
        return [f"{name}/ is left out: it does not have a picture of every image's name" for name in gone]
    if train.cameras.distortion is not None and train.cameras.distortion[:, 4].any():
        return [
            "cameras with k3 are FULL_OPENCV in COLMAP, which nerfstudio and gsplat do not open: run colmap "
            "image_undistorter first"
        ]
    return []


def _stored_names(scene: Scene, train: Split, test: Split) -> dict[str, list[str]]:
    """Names of the images of both splits in the model: COLMAP's own, or made of another format's paths."""
    if scene.format == "colmap":
        return {"train": list(train.names), "test": list(test.names)}
    every, paths = [*train.names, *test.names], [*train.paths, *test.paths]
    stored = [stored_name(name, path, i) for i, (name, path) in enumerate(zip(every, paths, strict=True))]
    stored = [PurePosixPath(name).as_posix() for name in stored]  # "./train/r_0.png" is no name to a reader of COLMAP
    if all(name.startswith("images/") for name in stored):
        stored = [name.removeprefix("images/") for name in stored]
    return {"train": stored[: len(train)], "test": stored[len(train) :]}


def _images_folder(scene: Scene) -> Path:
    return scene.details["images"] if scene.format == "colmap" else scene.root / "images"


def _smaller_folders(scene: Scene, names: Sequence[str]) -> list[str]:
    """Folders of smaller pictures that have all of them. In one with gaps every later picture would be another's:
    gsplat matches the sorted files of two folders one by one."""
    if scene.format != "colmap":
        return []
    others = [name for name in FOLDERS if name != _images_folder(scene).name]
    return [other for other in others if all(is_file(scene.root / other / name) for name in names)]


def _place(
    scene: Scene, names: Sequence[str], paths: Sequence[Path], smaller: Sequence[str], out: Path, copy: bool
) -> None:
    """Images under the names of the model; smaller ones too, where the capture has them."""
    for name, path in zip(names, paths, strict=True):
        place_image(path, out / _images_folder(scene).name / name, copy)
        for folder in smaller:
            place_image(path.parents[len(PurePosixPath(name).parts)] / folder / name, out / folder / name, copy)


def _write_model(
    out: Path, place: str, scene: Scene, names: dict[str, list[str]], splits: Sequence[str], *cameras: Cameras
) -> bool:
    """Writes one model of these splits; False where no single model that was read has all of their images."""
    wanted = [name for split in splits for name in names[split]]
    if splits == ("train",) and "triangulated" in scene.details:
        model = scene.details["triangulated"]
    elif scene.format == "colmap":
        source = scene.details["models"].get("+".join(splits))
        if source is None:
            return False
        model = _reduced(source, wanted, scene.points)
        have = {image.name for image in model.images.values() if image.has_pose}
        if have != set(wanted):  # never half of what was asked for
            raise UserError(
                f"COLMAP model '{source}' has {len(have)} of the {len(wanted)} images to be written to {place}"
            )
    else:
        model = new_model(cameras, wanted, scene.points)
    (out / place).mkdir(parents=True)
    model.write(out / place)
    if not all(name.isascii() for name in wanted):
        model.write_text(out / place)  # which the 3DGS authors' reader falls back to: of binary names it reads ASCII
    return True


def _deregister(model: Any, frame_id: int, source: Path) -> None:
    """Raises UserError where keypoints name points that the model does not have: a damaged one is found out here."""
    try:
        model.deregister_frame(frame_id)
    except (IndexError, KeyError, RuntimeError, ValueError) as error:
        raise UserError(f"COLMAP model '{source}' is damaged: {str(error).splitlines()[0]}") from None


def _reduced(source: Path, wanted: Sequence[str], points: Points | None) -> Any:
    """The model with these images alone, and with all of `points`: those whose tracks are gone have none."""
    import pycolmap

    model, kept = pycolmap.Reconstruction(source), set(wanted)
    try:
        whole = [{model.images[i.id].name for i in frame.data_ids} for frame in model.frames.values()]
    except KeyError as error:
        raise UserError(
            f"COLMAP model '{source}' is damaged: its frames have image {str(error)[:40]}, which it does not have"
        ) from None
    if any(names & kept and not names <= kept for names in whole):
        model = _without_rigs(model, kept)  # a frame goes or stays with all of its cameras
    for image in list(model.images.values()):
        if image.name not in kept and image.has_pose:
            _deregister(model, image.frame_id, source)
    missing: dict[tuple, int] = {}  # how many points lie in one place with one colour
    for key in _keys(points):
        missing[key] = missing.get(key, 0) + 1
    for point_id, point in list(model.points3D.items()):
        seen_by = {element.image_id for element in point.track.elements}
        key = (*point.xyz.tolist(), *point.color.tolist())
        if missing.get(key) and len(seen_by) >= LEAST_TRACK:
            missing[key] -= 1
        else:
            model.delete_point3D(point_id)  # its track is gone, or the training views do not know it
    for key, count in missing.items():
        for _ in range(count):
            model.add_point3D(np.array(key[:3]), pycolmap.Track(), np.array(key[3:], np.uint8))
    return model


def _keys(points: Points | None) -> list[tuple]:
    if points is None:
        return []
    return [(*xyz, *rgb) for xyz, rgb in zip(points.xyz.tolist(), points.rgb.tolist(), strict=True)]


def _without_rigs(model: Any, kept: set[str]) -> Any:
    """The images `kept` of the model with a pose each of its own, and the tracks between them."""
    import pycolmap

    made = pycolmap.Reconstruction()
    for camera in model.cameras.values():
        made.add_camera_with_trivial_rig(camera)
    for image_id, image in model.images.items():
        if image.name in kept and image.has_pose:
            seen = [pycolmap.Point2D(point.xy) for point in image.points2D]
            alone = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image_id)
            alone.points2D = pycolmap.Point2DList(seen)
            made.add_image_with_trivial_frame(alone, image.cam_from_world())
    for point in model.points3D.values():
        track = pycolmap.Track()
        for element in point.track.elements:
            if element.image_id in made.images:
                track.add_element(element.image_id, element.point2D_idx)
        made.add_point3D(point.xyz, track, point.color)
    return made


def new_model(groups: Sequence[Cameras], names: Sequence[str], points: Points | None) -> Any:
    """A model of the cameras, pinholes or OpenCV's, with these image names; points have colours and no tracks."""
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
    if points is not None:
        for xyz, rgb in zip(points.xyz, points.rgb, strict=True):
            model.add_point3D(xyz, pycolmap.Track(), rgb)
    return model
