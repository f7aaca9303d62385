"""Fuzzed captures: one small capture a format, opened, checked, looked at and written as a user would."""

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from PIL import Image

from tests.fuzz._reader import Input, InvalidError, Reader
from tests.scenes import test_euroc, test_kitti, test_rgbd, test_scannetpp, test_trajectory, walks
from viewbench.common import plugins
from viewbench.common import settings as settings_file
from viewbench.common.settings import PACKAGE
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.splits import hold_out
from viewbench.scenes.subset import write_scene, written_format
from viewbench.scenes.summary import summary
from viewbench.scenes.types import Scene, Split
from viewbench.scenes.validate import check_present, check_scene

SETTINGS = settings_file.load(PACKAGE / "environment.toml")
RULES = ("", "", "none", "every:2", "blocks:2")


def looked_at(given: Input, sub: str = ".", format: str = "", **reading: Any) -> None:
    """Opens the capture (mostly by its reader alone), checks what came of it, and goes on as a user would."""
    root, rng = given.root / sub, given.rng
    if rng.random() < 0.25 or not format:
        scene = open_scene(str(root), SETTINGS, holdout=rng.choice(RULES if given.changed else RULES[:1]), **reading)
    else:
        module = plugins.load("scenes.formats", format)
        module.detect(root)
        with np.errstate(all="ignore"):  # as open_scene has it
            scene = hold_out(module.read(root, **reading), "")
        check_scene(scene)
    check(scene, given.root)
    json.dumps(summary(scene), allow_nan=False)
    if rng.random() < 0.5:
        check_present(scene)
        if len(scene_sha256(scene)) != 64:
            raise InvalidError("a hash of another length")
        if scene.posed and not scene.train.lens:
            pixels, cameras = load_images(scene.train, np.array([rng.randrange(len(scene.train))]), 16)
            if pixels.shape[1:] != (cameras.height[0], 16, 3) or not np.isfinite(pixels).all():
                raise InvalidError("pixels of another shape, or NaN")
        if rng.random() < 0.2:
            written = rng.choice((written_format(scene), "transforms", "colmap"))
            chosen = np.arange(len(scene.train))[: rng.choice((1, 2, 3))]
            write_scene(scene, chosen, given.spare, written)
            _contained(given.spare)
            if written != "images" and written != "video":
                check_scene(open_scene(str(given.spare), SETTINGS, allow_outside=True))


def check(scene: Scene, root: Path) -> None:
    """Raises InvalidError for a scene that no code should be given."""
    if not len(scene.train):
        raise InvalidError("no training views")
    for split in (scene.train, scene.test):
        _check_split(split, root)
    for path in scene.files:
        if not _within(path, root):
            raise InvalidError("a metadata file outside the capture")
    points = scene.points
    if points is not None:
        if points.xyz.shape != (len(points), 3) or points.rgb.shape != (len(points), 3) or points.rgb.dtype != np.uint8:
            raise InvalidError("points of another shape")
        if not np.isfinite(points.xyz).all():
            raise InvalidError("points that are not finite")
        for views in points.seen_by or ():
            if len(views) and not 0 <= min(views) <= max(views) < len(scene.train):
                raise InvalidError("a track of a view that is not there")
    if not np.isfinite(scene.depth_unit) or scene.depth_unit < 0:
        raise InvalidError("a depth unit that is no length")
    for note in scene.notes:
        if "\n" in note:
            raise InvalidError("a note of several lines")


def _check_split(split: Split, root: Path) -> None:
    n, cameras = len(split.names), split.cameras
    if cameras.c2w.shape != (n, 4, 4) or cameras.c2w.dtype != np.float64 or not np.isfinite(cameras.c2w).all():
        raise InvalidError("poses that are not finite, or of another shape")
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        values = getattr(cameras, name)
        if values.shape != (n,) or not np.isfinite(values).all():
            raise InvalidError(f"{name} of another shape, or not finite")
        if name not in ("cx", "cy") and not (values > 0).all():
            raise InvalidError(f"{name} is not above 0")
        if name in ("width", "height") and values.dtype != np.int64:
            raise InvalidError(f"{name} is {values.dtype}")
    lens = cameras.distortion
    if lens is not None and (lens.shape != (n, 5) or not np.isfinite(lens).all()):
        raise InvalidError("distortion of another shape, or not finite")
    if split.times is not None and split.times.shape != (n,):
        raise InvalidError("times of another shape")
    if split.times is not None and not np.isfinite(split.times).all():
        raise InvalidError("times that are not finite")
    for files in (split.paths, split.depths, split.masks):
        if len(files) not in (0, n):
            raise InvalidError("another number of files than of frames")
        if not all(path is None or _within(path, root) for path in files):
            raise InvalidError("a file outside the capture")


def _within(path: Path, root: Path) -> bool:
    """Whether a path stays in the folder, or in the cache that readers have beside it."""
    normal = os.path.normpath(path)
    return any(
        normal == str(folder) or normal.startswith(f"{folder}{os.sep}") for folder in (root, root.parent / "cache")
    )


def _contained(folder: Path) -> None:
    """Raises InvalidError where something was written beside the folder, not in it."""
    if not folder.is_dir():
        raise InvalidError("nothing was written")
    extra = [path.name for path in folder.parent.iterdir() if path.name.startswith(".part-")]
    if extra:
        raise InvalidError("a temporary folder is left")


def opens(sub: str = ".", format: str = "", **reading: Any) -> Callable[[Input], None]:
    """`looked_at` with these arguments; options that are paths of the capture begin with "@"."""

    def use(given: Input) -> None:
        told = {k: given.root / v[1:] if isinstance(v, str) and v[:1] == "@" else v for k, v in reading.items()}
        looked_at(given, sub, format, **told)

    return use


def picture(path: Path, size: tuple[int, int] = (32, 24), mode: str = "RGB", value: Any = 100, **options: Any) -> None:
    """A small picture of one colour."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new(mode, size, value).save(path, **options)


def shrink(root: Path, rows: int = 60) -> None:
    """Cuts long lists of numbers, whose every line is like the others."""
    for path in root.rglob("*"):
        if path.suffix in (".csv", ".tum", ".txt") and path.stat().st_size > 6000:
            path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:rows]))


def of_rgbd(form: str, root: Path) -> None:
    with mock.patch.object(test_rgbd, "N", 3):
        test_rgbd.FORMATS[form](root / "room0")
    for number in range(3):
        if form == "scannet":
            picture(root / "room0" / "depth" / f"{number}.png", (64, 48), "I;16", 1000)
        if form == "tum-rgbd":
            picture(root / "room0" / "depth" / f"{number}.png", (64, 48), "I;16", 1000)
    if form == "tum-rgbd":
        rows = [f"{100 + 0.1 * number:.4f} depth/{number}.png" for number in range(3)]
        (root / "room0" / "depth.txt").write_text("\n".join(rows))
    if form == "scannet":
        depth = np.eye(4)
        depth[0, 0], depth[1, 1], depth[0, 2], depth[1, 2] = 50, 51, 32, 24
        test_rgbd.text(root / "room0" / "intrinsic" / "intrinsic_depth.txt", depth)
        for name in ("extrinsic_color", "extrinsic_depth"):
            test_rgbd.text(root / "room0" / "intrinsic" / f"{name}.txt", np.eye(4))
    if form == "seven-scenes":
        (root / "room0" / "TrainSplit.txt").write_text("sequence1\n")


def of_seven(root: Path) -> None:
    with mock.patch.object(test_rgbd, "N", 7):
        test_rgbd.seven(root / "room0")
    (root / "room0" / "TrainSplit.txt").write_text("sequence1\n")
    (root / "room0" / "TestSplit.txt").write_text("sequence2\n")


def of_euroc(root: Path) -> None:
    times_s = walks.walk("made up")
    assert times_s is not None
    stamps = [round(value * 1e6) * 1000 + 555 for value in times_s[0]]
    test_euroc.euroc(root, 2, times=[stamps[5] + 1, stamps[15] + 2, stamps[25] + 3])
    shrink(root)


def of_kitti(root: Path) -> None:
    with mock.patch.object(test_kitti, "N", 3):
        test_kitti.kitti(root, numbers=range(3))


def of_scannetpp(kind: str, root: Path) -> None:
    train, test = test_scannetpp.TRAIN[:3], test_scannetpp.TEST[:1]
    with mock.patch.multiple(test_scannetpp, TRAIN=train, TEST=test):
        if kind == "iphone":
            test_scannetpp.iphone(root)
            return
        folder = test_scannetpp.dslr(root, kind == "undistorted")
        test_scannetpp.colmap(folder / "colmap")


def of_trajectory(root: Path, times: bool = False) -> None:
    with mock.patch.object(test_trajectory, "N", 3):
        if not times:
            test_trajectory.capture(root / "room0")
        else:
            test_trajectory.capture(root / "room0", name=lambda i, stamp: f"{i}.png")
            poses = walks.matrices(*walks.walk("made up")[1:])[:3]  # pyright: ignore[reportOptionalSubscript]
            np.savetxt(root / "poses.txt", poses[:, :3].reshape(3, 12))
            (root / "times.txt").write_text("".join(f"{1e9 + i:.3f} {i}.png\n" for i in range(3)))
            (root / "room0" / "traj.tum").unlink()
    shrink(root, 80)
    (root / "room0" / "camera.txt").write_text("50 51 31.5 23.5 0.01 0 0 0\n")


def room(root: Path) -> Scene:
    """Four frames and forty points of the generated room, small, in Blender's form; and the scene."""
    source = PACKAGE / "scenes" / "generated_room" / "human"
    (root / "train").mkdir(parents=True)
    (root / "test").mkdir()
    for split, count in (("train", 3), ("test", 1)):
        table = json.loads((source / f"transforms_{split}.json").read_text(encoding="utf-8"))
        table["frames"] = table["frames"][::20][:count]
        for frame in table["frames"]:
            with Image.open(source / frame["file_path"]) as image:
                image.resize((32, 32)).save(root / frame["file_path"])
        table |= {key: table[key] / table["w"] * 32 for key in ("fl_x", "fl_y", "cx", "cy") if key in table}
        table |= {"w": 32, "h": 32}
        (root / f"transforms_{split}.json").write_text(json.dumps(table), encoding="utf-8")
    from viewbench.scenes.ply import read_points, write_points

    points = read_points(source / "points3d.ply")
    write_points(root / "points3d.ply", replace(points, xyz=points.xyz[:40], rgb=points.rgb[:40]))
    return open_scene(str(root), SETTINGS)


def of_nerfstudio(root: Path) -> None:
    """One transforms.json with lists of names, masks, depth, a lens, and smaller copies."""
    write_scene(room(root.parent / "source"), np.arange(3), root.parent / "model", "colmap", "copy")
    write_scene(open_scene(str(root.parent / "model"), SETTINGS), np.arange(3), root / "room", "transforms", "copy")
    file = root / "room" / "transforms.json"
    table = json.loads(file.read_text(encoding="utf-8"))
    for number, frame in enumerate(table["frames"]):
        frame |= {"mask_path": f"masks/{number}.png", "depth_file_path": f"depths/{number}.png", "time": number / 2}
        picture(root / "room" / "masks" / f"{number}.png", (32, 32), "L", 255)
        picture(root / "room" / "depths" / f"{number}.png", (32, 32), "I;16", 900)
        name = Path(frame["file_path"]).name
        picture(root / "room" / "images_2" / name, (16, 16))
    table |= {"k1": 0.01, "k2": 0.0, "p1": 0.0, "p2": 0.0, "camera_model": "OPENCV"}
    file.write_text(json.dumps(table), encoding="utf-8")
    for path in (root / "room").rglob("*.json"):
        if path != file:
            path.unlink()
    shutil.rmtree(root / "room" / "blender", ignore_errors=True)
    shutil.rmtree(root.parent / "source")
    shutil.rmtree(root.parent / "model")


def of_blender(root: Path) -> None:
    room(root)
    (root / "seen_test.json").write_text('{"schema": 1, "rays_per_view": 4, "seen": {"test/0000.png": 0.5}}')


def of_colmap(form: str, root: Path) -> None:
    import pycolmap

    scene = room(root.parent / "source")
    write_scene(scene, np.arange(3), root / "model", "colmap", "copy")
    for folder in ("test", "colmap"):
        shutil.rmtree(root / "model" / folder, ignore_errors=True)
    folder = root / "model" / "sparse" / "0"
    for path in folder.glob("*.txt"):
        path.unlink()
    for image in (root / "model" / "images").rglob("*.*"):
        picture(root / "model" / "masks" / f"{image.relative_to(root / 'model' / 'images')}.png", (32, 32), "L", 255)
        picture(root / "model" / "images_2" / image.relative_to(root / "model" / "images"), (16, 16))
    if form == "txt":
        pycolmap.Reconstruction(folder).write_text(folder)
        for path in folder.glob("*.bin"):
            path.unlink()
    (folder / "test.txt").write_text(f"{scene.train.names[0]}\n")
    shutil.rmtree(root.parent / "source")


def of_rig(form: str, root: Path) -> None:
    """A model whose frames have two cameras each, with keypoints and tracks."""
    import pycolmap

    options = pycolmap.SyntheticDatasetOptions()
    for key, value in {
        "num_rigs": 1,
        "num_cameras_per_rig": 2,
        "num_frames_per_rig": 2,
        "num_points3D": 12,
        "camera_width": 64,
        "camera_height": 48,
        "camera_params": [50.0, 32.0, 24.0, 0.01],
        "match_config": pycolmap.SyntheticDatasetMatchConfig.CHAINED,
        "num_points2D_without_point3D": 2,
    }.items():
        if hasattr(options, key):
            setattr(options, key, value)
    model = pycolmap.synthesize_dataset(options)
    folder = root / "model" / "sparse" / "0"
    folder.mkdir(parents=True)
    model.write_text(folder) if form == "txt" else model.write_binary(folder)
    for image in model.images.values():
        picture(root / "model" / "images" / image.name, (64, 48), format="PNG")


def of_images(root: Path) -> None:
    from tests.scenes.test_photos import exif

    for number, orientation in enumerate((1, 6, 8)):
        picture(root / "photos" / f"IMG_{number}.jpg", exif=exif(orientation))
    picture(root / "photos" / "IMG_3.png")
    picture(root / "photos" / "IMG_4.tif", compression="tiff_lzw")
    picture(root / "photos" / "IMG_5.webp")


def opens_video(given: Input) -> None:
    """A video goes through its reader alone, with a cache that is new for each."""
    from viewbench.scenes.formats import _video_cache, video
    from viewbench.scenes.thinning import Thinning

    cache = given.root.parent / "cache"
    name = given.changed[0]
    try:
        thinning = given.rng.choice((Thinning(), Thinning(), Thinning(stride=2), Thinning(fps=4.0)))
        scene = video.read(given.root / name, thinning, cache_gb=1)
        check_scene(scene)
        check(scene, given.root)
        check_present(scene)
        if given.rng.random() < 0.2:
            write_scene(scene, np.array([len(scene.train) - 1]), given.spare, "video")
    finally:
        for file in _video_cache._held.values():
            file.close()
        _video_cache._held.clear()
        left = [path.name for path in cache.rglob(".part-*")]
        shutil.rmtree(cache, ignore_errors=True)
        cache.mkdir()
    if left:
        raise InvalidError("a temporary file is left in the cache")


def of_video(codecs: tuple[str, ...], root: Path) -> None:
    from tests.scenes.test_video import CODECS, encode, scenery

    for codec in codecs:  # of 96 x 64: x265 writes beyond its memory for smaller ones
        encode(root / f"{codec.replace(' ', '_')}.{CODECS[codec][3]}", scenery(5), codec)


READERS = (
    Reader("transforms-nerfstudio", of_nerfstudio, opens("room", "transforms"), ("transforms",)),
    Reader("transforms-blender", of_blender, opens(".", "transforms"), ("transforms",)),
    Reader("colmap-binary", lambda root: of_colmap("bin", root), opens("model", "colmap"), ("colmap",)),
    Reader("colmap-text", lambda root: of_colmap("txt", root), opens("model", "colmap"), ("colmap",)),
    Reader("colmap-rigs-binary", lambda root: of_rig("bin", root), opens("model", "colmap"), ("colmap",)),
    Reader("colmap-rigs-text", lambda root: of_rig("txt", root), opens("model", "colmap"), ("colmap",)),
    Reader("images", of_images, opens("photos", "images"), ("images",)),
    Reader("trajectory-tum", of_trajectory, opens("room0", "trajectory"), ("trajectory",)),
    Reader(
        "trajectory-kitti",
        lambda root: of_trajectory(root, True),
        opens("room0", "", poses="@poses.txt", times="@times.txt"),
        ("trajectory",),
    ),
    Reader("tum-rgbd", lambda root: of_rgbd("tum-rgbd", root), opens("room0", "tum-rgbd"), ("tum-rgbd",)),
    Reader("scannet", lambda root: of_rgbd("scannet", root), opens("room0", "scannet"), ("scannet",)),
    Reader("replica", lambda root: of_rgbd("replica", root), opens("room0", "replica"), ("replica",)),
    Reader("seven-scenes", of_seven, opens("room0", "seven-scenes"), ("seven-scenes",)),
    Reader("euroc", of_euroc, opens(".", "euroc"), ("euroc",)),
    Reader("kitti", of_kitti, opens("sequences/04", "kitti"), ("kitti",)),
    Reader("scannetpp-dslr", lambda root: of_scannetpp("undistorted", root), opens(".", "scannetpp"), ("scannetpp",)),
    Reader("scannetpp-fisheye", lambda root: of_scannetpp("fisheye", root), opens(".", "scannetpp"), ("scannetpp",)),
    Reader("scannetpp-iphone", lambda root: of_scannetpp("iphone", root), opens(".", "scannetpp"), ("scannetpp",)),
    Reader("video-mp4", lambda root: of_video(("h264", "hevc"), root), opens_video, ("video",), "av", True),
    Reader(
        "video-other",
        lambda root: of_video(("h264 ts", "h264 mkv", "mpeg4 avi", "vp9", "mjpeg", "h264 one key"), root),
        opens_video,
        ("video",),
        "av",
        True,
    ),
)
