"""COLMAP models: what is read, and that pycolmap opens what is written."""

import numpy as np
import pycolmap
import pytest
from PIL import Image

from tests.conftest import known
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene, write_subset

SETTINGS = settings_file.load()
NAMES = ["frame10.png", "frame2.png", "sub/frame1.png", "frame3.png"]


@pytest.fixture(params=["bin", "txt"])
def model(tmp_path, request):
    """Four images and three points, seen by frames 10, 2 and 3, by 10 and 1, and by 2 and 3."""
    made = pycolmap.Reconstruction()
    camera = pycolmap.Camera(model="PINHOLE", width=12, height=8, params=[10, 11, 6, 4], camera_id=1)
    made.add_camera_with_trivial_rig(camera)
    tracks = {0: (1, 2, 4), 1: (1, 3), 2: (2, 4)}
    seen = {image: [p for p, images in tracks.items() if image in images] for image in range(1, 5)}
    for number, name in enumerate(NAMES, start=1):
        image = pycolmap.Image(name=name, camera_id=1, image_id=number)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.array([1.0 + p, 2.0])) for p in seen[number]])
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(np.array([0, 0, 0, 1.0])), np.array([-number, 0, 0.0]))
        made.add_image_with_trivial_frame(image, pose)
        path = tmp_path / "images" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (12, 8), (number, 0, 0)).save(path)
    for point, images in tracks.items():
        track = pycolmap.Track()
        for image in images:
            track.add_element(image, seen[image].index(point))
        made.add_point3D(np.array([point, 1.0, 5.0]), track, np.array([10 * point, 0, 0], np.uint8))
    folder = tmp_path / "sparse" / "0"
    folder.mkdir(parents=True)
    made.write_binary(folder) if request.param == "bin" else made.write_text(folder)
    return tmp_path


def opened(folder, **options):
    return open_scene(str(folder), SETTINGS, **options)


def tracks_of(scene):
    """The training views that see a point, by its place."""
    points = known(scene.points)
    return {tuple(xyz): seen.tolist() for xyz, seen in zip(points.xyz, known(points.seen_by), strict=True)}


def test_frames_come_in_natural_order_with_poses_and_tracks(model):
    scene = opened(model)
    assert scene.format == "colmap"
    assert scene.train.names == ("frame2.png", "frame3.png", "frame10.png", "sub/frame1.png")
    cameras = scene.train.cameras
    # the camera of image k stands at x = k and looks along world z with y down: OpenGL's -z back, y up
    np.testing.assert_allclose(cameras.positions[:, 0], [2, 4, 1, 3], atol=1e-12)
    np.testing.assert_allclose(cameras.forward, [[0, 0, 1]] * 4, atol=1e-12)
    np.testing.assert_allclose(cameras.rotations[0], np.diag([1, -1, -1]), atol=1e-12)
    assert (cameras.fx[0], cameras.fy[0], cameras.width[0], cameras.height[0]) == (10, 11, 12, 8)
    assert tracks_of(scene) == {(0, 1, 5): [0, 1, 2], (1, 1, 5): [2, 3], (2, 1, 5): [0, 1]}


def test_holding_out_renumbers_the_tracks_and_drops_what_test_views_alone_tell(model):
    scene = opened(model, holdout="every:4")
    assert scene.train.names == ("frame3.png", "frame10.png", "sub/frame1.png")
    # the third point was seen by frame 2, which is held out, and by frame 3
    assert tracks_of(scene) == {(0, 1, 5): [0, 1], (1, 1, 5): [1, 2]}
    assert scene.notes == ("1 of 3 points left out: fewer than 2 training views see them",)
    assert opened(model, holdout="every:2").points is None


def test_the_list_beside_the_model_drops_them_too(model):
    (model / "sparse" / "0" / "test.txt").write_text("frame2.png\n")
    listed, held = opened(model), opened(model, holdout="none")
    assert listed.test.names == held.test.names == ("frame2.png",)
    assert sorted(known(listed.points).xyz[:, 0]) == [0, 1]
    assert listed.notes == ("1 of 3 points left out: fewer than 2 training views see them",)


def test_pycolmap_opens_the_subset(model, tmp_path):
    scene = opened(model)
    write_subset(scene, {"indices": [1, 0]}, tmp_path / "out")
    read = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert read.is_valid()
    assert sorted(image.name for image in read.images.values()) == ["frame2.png", "frame3.png"]
    # all points that the capture's training views triangulated stay; the second was seen by none of the two chosen
    tracks = {point.xyz[0]: [e.image_id for e in point.track.elements] for point in read.points3D.values()}
    assert {place: sorted(read.images[i].name for i in track) for place, track in tracks.items()} == {
        0: ["frame2.png", "frame3.png"],
        1: [],
        2: ["frame2.png", "frame3.png"],
    }
    again = opened(tmp_path / "out")
    assert again.train.names == ("frame2.png", "frame3.png")
    np.testing.assert_allclose(again.train.cameras.c2w, scene.train.cameras.c2w[:2], atol=1e-12)
    assert all(path.is_file() for path in again.train.paths)


def test_the_test_split_stays_the_test_split(model, tmp_path):
    scene = opened(model, holdout="every:2")
    write_subset(scene, {"indices": [0]}, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert (again.train.names, again.test.names) == (("frame3.png",), scene.test.names)
    np.testing.assert_allclose(again.test.cameras.c2w, scene.test.cameras.c2w, atol=1e-12)
    assert all(path.is_file() for path in again.test.paths)
    write_subset(again, {"indices": [0]}, tmp_path / "once more")
    third = opened(tmp_path / "once more")
    assert (third.train.names, third.test.names) == (again.train.names, again.test.names)


def test_mip_nerf_360_tests_on_every_eighth_and_says_so(model):
    (model / "poses_bounds.npy").write_bytes(b"")
    scene = opened(model)
    assert scene.test.names == ("frame2.png",)
    assert any("poses_bounds.npy is here" in note and "--holdout" in note for note in scene.notes)
    assert len(opened(model, holdout="none").test) == 0


def test_smaller_images_have_smaller_cameras(model):
    (model / "images").rename(model / "images_2")
    for path in (model / "images_2").rglob("*.png"):
        Image.open(path).resize((6, 4)).save(path)
    scene = opened(model)
    cameras = scene.train.cameras
    assert (cameras.width[0], cameras.height[0], cameras.fx[0], cameras.cx[0]) == (6, 4, 5, 3)


def test_images_that_were_drawn_smaller_in_place_have_smaller_cameras_and_say_so(model):
    """As the 3DGS authors' Tanks and Temples has it: images of half the size, the model's cameras of the full."""
    whole = opened(model)
    assert not any("scaled" in note for note in whole.notes)
    for path in (model / "images").rglob("*.png"):
        Image.open(path).resize((6, 4)).save(path)
    scene = opened(model)
    cameras = scene.train.cameras
    assert (cameras.width[0], cameras.height[0], cameras.fx[0], cameras.cx[0]) == (6, 4, 5, 3)
    assert "images are 6 x 4, the model's cameras 12 x 8: the cameras were scaled" in scene.notes
    assert load_images(scene.train, np.array([0]), None)[0].shape == (1, 4, 6, 3)
    # Or the model was made of smaller pictures than those that lie there now.
    for size, width in (((24, 16), 24), ((6, 6), 12)):  # one of another shape is an error of whoever reads the pixels
        for path in (model / "images").rglob("*.png"):
            Image.open(path).resize(size).save(path)
        scene = opened(model)
        assert scene.train.cameras.width[0] == width
    with pytest.raises(UserError, match="its camera says"):
        load_images(scene.train, np.array([0]), None)
    (model / "images" / "frame2.png").write_bytes(b"no image")
    assert opened(model).train.cameras.width[0] == 12


def test_both_ways_between_the_formats(model, small_room, tmp_path):
    room = opened(small_room)
    write_scene(room, np.arange(12), tmp_path / "colmap", "colmap")
    read = opened(tmp_path / "colmap")
    assert set(read.train.names) == set(room.train.names)
    order = [read.train.names.index(name) for name in room.train.names]
    np.testing.assert_allclose(read.train.cameras.c2w[order], room.train.cameras.c2w, atol=1e-9)
    np.testing.assert_allclose(sorted(known(read.points).xyz.tolist()), sorted(known(room.points).xyz.tolist()))
    write_scene(read, np.arange(12), tmp_path / "back", "transforms")
    back = opened(tmp_path / "back")
    np.testing.assert_allclose(back.train.cameras.c2w, read.train.cameras.c2w, atol=1e-12)
    assert len(back.test) == 4


@pytest.mark.parametrize("name", ["images", "cameras", "points3D"])
def test_a_broken_model_is_one_sentence(model, name):
    for path in (model / "sparse" / "0").glob(f"{name}.*"):
        path.write_bytes(b"1 not a model of anything\n1 2\n")
    with pytest.raises(UserError, match="COLMAP"):
        opened(model)


def test_real_captures(data_root):
    space = opened(data_root / "hololens_space")
    assert len(space.train) == 373
    assert len(known(space.points)) == 34397
    poses = np.loadtxt(data_root / "hololens_space" / "poses.txt").reshape(-1, 4, 4)
    ours = space.train.cameras.c2w @ np.diag([1.0, -1, -1, 1])
    np.testing.assert_allclose(ours, poses, atol=1e-4)
    binary, text = opened(data_root / "real_room", format="colmap"), opened(data_root / "real_room")
    assert len(binary.train) == 35
    assert text.format in ("colmap", "transforms")


@pytest.mark.parametrize("name", ["hololens_space", "real_room", "diorama_room"])
def test_subsets_of_real_captures_open_again(data_root, tmp_path, name):
    scene = opened(data_root / name, holdout="every:8")
    chosen = [7, 0, 3]
    assert write_subset(scene, {"indices": chosen}, tmp_path / "out")[0] == scene.format
    again = opened(tmp_path / "out")
    order = [again.train.names.index(scene.train.names[i]) for i in chosen]
    np.testing.assert_allclose(again.train.cameras.c2w[order], scene.train.cameras.c2w[chosen], atol=1e-9)
    assert set(again.test.names) == set(scene.test.names)
    assert all(path.is_file() for path in (*again.train.paths, *again.test.paths))
    if scene.format == "colmap":
        model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
        assert model.is_valid()
        assert sorted(image.name for image in model.images.values()) == sorted(scene.train.names[i] for i in chosen)
        assert model.num_points3D() > 100
