"""The 3D points that the chosen views alone tell: those of the capture that two of them see, or new ones."""

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError
from .features import Progress, silent
from .splits import LEAST_TRACK
from .types import Cameras, Points, Scene

EXHAUSTIVE = 40  # views: every pair of so many is matched
NEIGHBOURS = 20  # pairs a view beyond that, the nearest in place and direction
LARGEST = 1600  # pixels of the longer side that features are looked for at
FEATURES = 4096  # a picture
BATCH = 8  # pictures between two words of progress
WIDE = 2.0  # radians between two viewing directions: more, and they share nothing


def seen(scene: Scene, indices: Sequence[int]) -> Scene:
    """The scene with the points alone that at least two of the training views at `indices` see.

    Raises UserError where the format does not tell who sees a point, and where nothing is left.
    """
    if scene.points is None or scene.points.seen_by is None:
        raise UserError(f"scene '{scene.name}' does not say which views see a point; use --points all or triangulate")
    chosen = np.zeros(len(scene.train), dtype=bool)
    chosen[np.asarray(indices)] = True
    use = [i for i, views in enumerate(scene.points.seen_by) if chosen[views].sum() >= LEAST_TRACK]
    if not use:
        raise UserError(f"no point is seen by two of the {len(indices)} chosen views; choose more, or --points all")
    points, tracks = scene.points, scene.points.seen_by
    return dataclasses.replace(scene, points=Points(points.xyz[use], points.rgb[use], tuple(tracks[i] for i in use)))


def triangulated(scene: Scene, indices: Sequence[int], progress: Progress = silent) -> Scene:
    """The scene with points triangulated by COLMAP from the chosen training views alone, at their own poses.

    SIFT features of each picture, matched between all pairs of up to EXHAUSTIVE views and between near ones of more,
    then `pycolmap.triangulate_points`: what structure-from-motion on the chosen pictures would know if it were given
    their poses. `details["triangulated"]` has the model for the writer of COLMAP's files.

    Raises UserError for unposed scenes, for lenses other than OpenCV's, and where no point is found.
    """
    if not scene.posed:
        raise UserError(f"scene '{scene.name}' has no poses to triangulate with; run COLMAP on the chosen images")
    if scene.train.lens:
        raise UserError(f"cameras are {scene.train.lens}, which is not triangulated; undistort the capture first")
    import pycolmap

    order = np.sort(np.asarray(indices, dtype=np.int64))
    views = scene.train.subset(order)
    pycolmap.logging.minloglevel = 2  # its own progress is written over ours
    with tempfile.TemporaryDirectory(prefix="viewbench-") as folder:
        work = Path(folder)
        links = [f"{number:06d}{path.suffix}" for number, path in enumerate(views.paths)]
        (work / "images").mkdir()
        for link, path in zip(links, views.paths, strict=True):
            (work / "images" / link).symlink_to(path.resolve())
        _describe(work, links, progress)
        model = _posed(work / "matches.db", views.cameras)
        _match(work, links, views.cameras)
        progress(len(links), len(links), "matched")
        (work / "model").mkdir()
        model = pycolmap.triangulate_points(model, work / "matches.db", work / "images", work / "model")
    if not model.num_points3D():
        raise UserError(f"no point could be triangulated from the {len(views)} chosen views; choose more of them")
    number = {}
    for image in model.images.values():
        number[image.image_id] = int(image.name.split(".")[0])
        image.name = views.names[number[image.image_id]]
    found = list(model.points3D.values())
    points = Points(
        np.array([point.xyz for point in found]),
        np.array([point.color for point in found], dtype=np.uint8),
        tuple(order[sorted({number[element.image_id] for element in point.track.elements})] for point in found),
    )
    return dataclasses.replace(scene, points=points, details={**scene.details, "triangulated": model})


def _describe(work: Path, names: list[str], progress: Progress) -> None:
    """Features of the images, in matches.db; each has a camera of its own there."""
    import pycolmap

    options = pycolmap.FeatureExtractionOptions()
    options.max_image_size = LARGEST
    options.sift.max_num_features = FEATURES
    options.use_gpu = False
    for start in range(0, len(names), BATCH):
        pycolmap.extract_features(
            work / "matches.db",
            work / "images",
            names[start : start + BATCH],
            pycolmap.CameraMode.PER_IMAGE,
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )
        progress(min(start + BATCH, len(names) - 1), len(names), "features")


def _posed(database: Path, cameras: Cameras) -> Any:
    """A model without points: the database's images, by their numbers, with these cameras and poses.

    The database gets the cameras too: matches are verified by them.
    """
    import pycolmap

    from .formats._colmap_write import new_model

    names = [str(number) for number in range(len(cameras))]
    made = new_model([cameras], names, None)
    given = {int(image.name): image for image in made.images.values()}
    model, file = pycolmap.Reconstruction(), pycolmap.Database.open(database)
    for image in file.read_all_images():
        known = given[int(image.name.split(".")[0])]
        camera = pycolmap.Camera(made.cameras[known.camera_id].todict())
        camera.camera_id, camera.has_prior_focal_length = image.camera_id, True
        file.update_camera(camera)
        model.add_camera_with_trivial_rig(camera)
        posed = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image.image_id)
        model.add_image_with_trivial_frame(posed, known.cam_from_world())
    file.close()
    return model


def _match(work: Path, names: list[str], cameras: Cameras) -> None:
    """Verified matches of near pairs, in matches.db."""
    import pycolmap

    pairs = "".join(f"{names[i]} {names[j]}\n" for i, j in near_pairs(cameras))
    (work / "pairs.txt").write_text(pairs, encoding="utf-8")
    matching, pairing = pycolmap.FeatureMatchingOptions(), pycolmap.ImportedPairingOptions()
    matching.use_gpu = False
    pairing.match_list_path = str(work / "pairs.txt")
    pycolmap.match_image_pairs(work / "matches.db", matching, pairing, device=pycolmap.Device.cpu)


def near_pairs(cameras: Cameras) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of views that may share something: of many, those nearest in place and direction."""
    n = len(cameras)
    extent = float(np.ptp(cameras.positions, axis=0).max()) or 1.0
    pairs: set[tuple[int, int]] = set()
    for i in range(n):
        angle = np.arccos(np.clip(cameras.forward @ cameras.forward[i], -1, 1))
        apart = np.linalg.norm(cameras.positions - cameras.positions[i], axis=1) / extent + angle
        apart[angle > WIDE] = np.inf
        apart[i] = np.inf
        near = np.argsort(apart, kind="stable")[: n if n <= EXHAUSTIVE else NEIGHBOURS]
        pairs |= {(min(i, int(j)), max(i, int(j))) for j in near if np.isfinite(apart[j])}
    return sorted(pairs)
