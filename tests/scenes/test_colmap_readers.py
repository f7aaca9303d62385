"""A written COLMAP subset as the tools that it is for read it, with their default options.

Nerfstudio's reader is its own code, imported from its package; what gsplat's examples and the 3DGS authors' code do is
restated here, since no package has it: `examples/datasets/colmap.py` of gsplat and `scene/dataset_readers.py`.
"""

from pathlib import Path

import numpy as np
import pycolmap
import pytest

from tests.conftest import known
from tests.nerfstudio_code import dataparser
from tests.scenes.test_transforms import frames, write
from tests.scenes.test_written import colmap, picture
from viewbench.common.errors import UserError
from viewbench.common.settings import load as load_settings
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.scenes.validate import check_present

NAMES = [f"frame{number:02d}.png" for number in range(24)]
CHOSEN = [20, 3, 7, 11, 15]  # in the order chosen


@pytest.fixture
def written(tmp_path):
    """A capture of 24 frames with a smaller copy, every 4th held out, of whose 18 training frames five were chosen."""
    folder = colmap(tmp_path / "in", NAMES)
    model = pycolmap.Reconstruction(folder / "sparse" / "0")
    for place in np.random.default_rng(0).uniform(-1, 1, (30, 3)):
        model.add_point3D(place, pycolmap.Track(), np.array([9, 8, 7], np.uint8))
    model.write(folder / "sparse" / "0")
    for name in NAMES:
        picture(folder / "images_2" / name, (6, 4))
    scene = open_scene(str(folder), load_settings(), holdout="every:4")
    wanted = [NAMES[i] for i in CHOSEN if i % 4]
    indices = [scene.train.names.index(name) for name in wanted]
    write_subset(scene, {"indices": indices}, tmp_path / "out")
    return tmp_path / "out", set(wanted), set(scene.test.names)


def images_of(model: Path) -> list[str]:
    return sorted(image.name for image in pycolmap.Reconstruction(model).images.values())


def test_splits_have_models_of_their_own(written):
    out, chosen, test = written
    assert set(images_of(out / "sparse" / "0")) == chosen
    assert set(images_of(out / "test" / "sparse" / "0")) == test
    assert set(images_of(out / "colmap" / "sparse" / "0")) == chosen | test
    assert {path.name for path in (out / "test" / "images").iterdir()} == test


def test_3dgs_trains_on_the_chosen_views_alone(written):
    """readColmapSceneInfo: the images of sparse/0, all of them without --eval, and without those of test.txt where
    llffhold is 0; with --eval alone every 8th by name is tested on."""
    out, chosen, test = written
    names = images_of(out / "sparse" / "0")
    assert set(names) == chosen
    assert all((out / "images" / name).is_file() for name in names)
    listed = (out / "sparse" / "0" / "test.txt").read_text().split()
    assert {name for name in names if name not in listed} == chosen
    assert not {name for number, name in enumerate(names) if number % 8} & test
    # render.py -s OUT/test draws the test views
    assert set(images_of(out / "test" / "sparse" / "0")) == test


@pytest.mark.parametrize("factor", [1, 2])
def test_gsplat_trains_on_no_test_view(written, factor):
    """Parser: images by name of sparse/0; the files of images/ and of images_N/ are matched in sorted order. Dataset:
    every 8th of them validates."""
    out, chosen, test = written
    names = images_of(out / "sparse" / "0")
    folders = [out / "images", out / (f"images_{factor}" if factor > 1 else "images")]
    files, smaller = ([path.name for path in sorted(folder.iterdir())] for folder in folders)
    assert files == smaller, "the two lists are matched one by one"
    trained = {smaller[files.index(name)] for number, name in enumerate(names) if number % 8}
    assert trained <= chosen
    assert not trained & test


@pytest.fixture(scope="module")
def nerfstudio():
    """Nerfstudio's reader."""
    with dataparser("colmap_dataparser") as module:
        yield module


def nerfstudio_split(module, data: Path, split: str, **options) -> list[str]:
    """File names that the reader gives a split, with its default options but for the pictures' size."""
    parser = module.ColmapDataParserConfig(data=data, downscale_factor=1, **options).setup()
    return [Path(name).name for name in parser.get_dataparser_outputs(split).image_filenames]


def test_nerfstudio_trains_on_all_chosen_views_and_tests_on_the_others(written, nerfstudio):
    out, chosen, test = written
    assert set(nerfstudio_split(nerfstudio, out, "train")) == chosen
    assert set(nerfstudio_split(nerfstudio, out, "val")) == set(nerfstudio_split(nerfstudio, out, "test")) == test


def test_nerfstudio_reads_the_chosen_model_too(written, nerfstudio):
    """Pointed at sparse/0 it finds lists of views that the model does not have, and refuses: nothing leaks."""
    out, _, _ = written
    with pytest.raises(RuntimeError, match="were not found"):
        nerfstudio_split(nerfstudio, out, "test", colmap_path=Path("sparse/0"))


def rig(folder):
    """Twelve frames of a rig of two cameras, and points that pairs of images see."""
    model = pycolmap.Reconstruction()
    sensors = []
    made = pycolmap.Rig(rig_id=1)
    for number in (1, 2):
        model.add_camera(pycolmap.Camera(camera_id=number, model="PINHOLE", width=12, height=8, params=[10, 10, 6, 4]))
        sensors.append(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, number))
    made.add_ref_sensor(sensors[0])
    aside = pycolmap.Rigid3d(pycolmap.Rotation3d(np.array([0, 0, 0, 1.0])), np.array([-0.1, 0, 0]))
    made.add_sensor(sensors[1], aside)
    model.add_rig(made)
    for number in range(12):
        frame = pycolmap.Frame(frame_id=number + 1, rig_id=1)
        frame.rig_from_world = pycolmap.Rigid3d(
            pycolmap.Rotation3d(np.array([0, 0, 0, 1.0])), np.array([-float(number), 0, 0])
        )
        images = [
            pycolmap.Image(name=f"{side}/{number:02d}.png", camera_id=camera, image_id=2 * number + camera)
            for camera, side in ((1, "left"), (2, "right"))
        ]
        for image in images:
            image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.array([6.0, 4.0]))])
            image.frame_id = frame.frame_id
            frame.add_data_id(image.data_id)
        model.add_frame(frame)
        for image in images:
            model.add_image(image)
        model.register_frame(frame.frame_id)
    for first in range(1, 23):
        track = pycolmap.Track()
        for image_id in (first, first + 1):
            if not model.images[image_id].points2D[0].has_point3D():
                track.add_element(image_id, 0)
        if track.length() == 2:
            model.add_point3D(np.array([first, 0.0, 5.0]), track, np.array([first, 0, 0], np.uint8))
    (folder / "sparse" / "0").mkdir(parents=True)
    model.write(folder / "sparse" / "0")
    for image in model.images.values():
        picture(folder / "images" / image.name, (12, 8))
    return folder


@pytest.mark.parametrize("indices", [[0, 5, 17], [3], list(range(18))])
def test_of_a_rig_the_chosen_images_stay_and_their_siblings_go(tmp_path, indices):
    scene = open_scene(str(rig(tmp_path / "in")), load_settings(), holdout="every:4")
    assert (len(scene.train), len(scene.test)) == (18, 6)
    write_subset(scene, {"indices": indices}, tmp_path / "out")
    chosen, test = {scene.train.names[i] for i in indices}, set(scene.test.names)
    for place, names in {"sparse/0": chosen, "test/sparse/0": test, "colmap/sparse/0": chosen | test}.items():
        assert set(images_of(tmp_path / "out" / place)) == names, place
    again = open_scene(str(tmp_path / "out"), load_settings())
    assert (set(again.train.names), set(again.test.names)) == (chosen, test)
    for split, old in ((again.train, scene.train), (again.test, scene.test)):
        order = [old.names.index(name) for name in split.names]
        np.testing.assert_allclose(split.cameras.c2w, old.cameras.c2w[order], atol=1e-12)


def test_a_folder_of_smaller_pictures_with_gaps_is_left_out(tmp_path):
    """gsplat would match every picture behind the gap to another one's camera, test views among them."""
    folder = colmap(tmp_path / "in", NAMES)
    for name in NAMES[:5] + NAMES[6:]:
        picture(folder / "images_2" / name, (6, 4))
    scene = open_scene(str(folder), load_settings(), holdout="every:4")
    write_subset(scene, {"indices": list(range(len(scene.train)))}, tmp_path / "out")
    assert not list((tmp_path / "out").rglob("images_2"))


def test_a_name_that_nerfstudio_would_cut_in_two_gets_no_list(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png", "a.png\nb.png", "c.png"])
    (folder / "sparse" / "0" / "test.txt").write_text("b.png\n")
    scene = open_scene(str(folder), load_settings())
    assert scene.test.names == ("b.png",)
    write_subset(scene, {"indices": [0, 1, 2]}, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*_list.txt"))
    assert not (tmp_path / "out" / "colmap").exists()
    assert open_scene(str(tmp_path / "out"), load_settings()).test.names == ("b.png",)


def test_names_of_another_format_are_plain(tmp_path):
    """Nerfstudio's and Blender's "./images/a.png" is no name to a reader of COLMAP."""
    folder = write(tmp_path / "in", frames("./images/a.png", "./images/b.png"), fl_x=5)
    write_scene(open_scene(str(folder), load_settings()), np.arange(2), tmp_path / "out", "colmap")
    assert images_of(tmp_path / "out" / "sparse" / "0") == ["a.png", "b.png"]
    assert sorted(path.name for path in (tmp_path / "out" / "images").iterdir()) == ["a.png", "b.png"]


def test_what_lies_beside_a_model_does_not_matter(tmp_path):
    folder = colmap(tmp_path / "in", NAMES[:5])
    before = scene_sha256(open_scene(str(folder), load_settings()))
    (folder / "sparse" / "0" / "old.txt").symlink_to("nowhere")
    (folder / "sparse" / "0" / "notes.txt").mkdir()
    colmap(folder / "test", NAMES[:3])
    scene = open_scene(str(folder), load_settings())
    assert (len(scene.train), len(scene.test)) == (5, 0), "a folder test/ that nobody lists is somebody else's"
    assert scene_sha256(scene) == before


def test_a_list_may_have_blanks_and_names_that_were_never_registered(tmp_path):
    folder = colmap(tmp_path / "in", NAMES[:5])
    (folder / "sparse" / "0" / "test.txt").write_text(f"{NAMES[1]} \nlost.png\n\n")
    scene = open_scene(str(folder), load_settings())
    assert scene.test.names == (NAMES[1],)
    assert scene.notes == ("1 of 2 names in test.txt are of no image that has a pose",)
    (folder / "sparse" / "0" / "test.txt").write_text("lost.png\n")
    with pytest.raises(UserError, match=r"names image 'lost\.png', which the model does not have"):
        open_scene(str(folder), load_settings())


def test_without_a_test_split_nerfstudio_trains_on_all_chosen_views(tmp_path, nerfstudio):
    """Its default would hold every 8th out; it needs some to evaluate, which are trained on too."""
    folder = colmap(tmp_path / "in", NAMES)
    model = pycolmap.Reconstruction(folder / "sparse" / "0")
    model.add_point3D(np.zeros(3), pycolmap.Track(), np.zeros(3, np.uint8))
    model.write(folder / "sparse" / "0")
    chosen = list(range(0, 24, 2))
    write_subset(open_scene(str(folder), load_settings()), {"indices": chosen[::-1]}, tmp_path / "out")
    names = [NAMES[i] for i in chosen]
    assert images_of(tmp_path / "out" / "sparse" / "0") == names
    assert not (tmp_path / "out" / "test").exists()
    assert nerfstudio_split(nerfstudio, tmp_path / "out", "train") == names
    assert nerfstudio_split(nerfstudio, tmp_path / "out", "val") == [names[0], names[8]]
    again = open_scene(str(tmp_path / "out"), load_settings())
    assert (list(again.train.names), len(again.test)) == (names, 0)


def test_masks_come_along_under_the_names_of_both_tools(tmp_path, nerfstudio):
    """COLMAP looks for NAME.png.png, nerfstudio for NAME.png; of another frame's nothing comes."""
    folder = colmap(tmp_path / "in", [f"sub/{name}" for name in NAMES[:6]])
    for name in NAMES[:6]:
        for place in (f"masks/sub/{name}.png", f"masks_2/sub/{name}.png", f"depths/sub/{name}"):
            picture(folder / place, (12, 8))
    model = pycolmap.Reconstruction(folder / "sparse" / "0")
    model.add_point3D(np.zeros(3), pycolmap.Track(), np.zeros(3, np.uint8))
    model.write(folder / "sparse" / "0")
    write_subset(open_scene(str(folder), load_settings()), {"indices": [1, 3]}, tmp_path / "out")
    for place in ("masks", "masks_2"):
        found = sorted(path.name for path in (tmp_path / "out" / place).rglob("*.png"))
        assert found == [f"{NAMES[1]}.png", f"{NAMES[3]}.png"]
    parser = nerfstudio.ColmapDataParserConfig(data=tmp_path / "out", downscale_factor=1, depths_path=Path("depths"))
    outputs = parser.setup().get_dataparser_outputs("train")
    assert all(path.is_file() for path in outputs.metadata["depth_filenames"])


def test_the_largest_of_several_models_is_read_or_the_one_that_is_named(tmp_path):
    folder = colmap(tmp_path / "in", NAMES[:3])
    for number, names in ((1, NAMES[3:12]), (2, NAMES[12:14])):
        other = colmap(tmp_path / f"other{number}", names)
        (other / "sparse" / "0").rename(folder / "sparse" / str(number))
        for name in names:
            picture(folder / "images" / name, (12, 8))
    scene = open_scene(str(folder), load_settings())
    assert list(scene.train.names) == NAMES[3:12]
    assert "3 models (images: 0 with 3, 1 with 9, 2 with 2); 1 is read" in " ".join(scene.notes)
    assert list(open_scene(str(folder), load_settings(), model=2).train.names) == NAMES[12:14]
    with pytest.raises(UserError, match=r"no model 7 \(there are: 0, 1, 2\)"):
        open_scene(str(folder), load_settings(), model=7)
    write_subset(scene, {"indices": [0, 5]}, tmp_path / "out")
    assert images_of(tmp_path / "out" / "sparse" / "0") == [NAMES[3], NAMES[8]]


@pytest.mark.parametrize("text", [False, True])
def test_a_capture_whose_model_is_not_number_0_is_found(tmp_path, text):
    folder = colmap(tmp_path / "in", NAMES[:3])
    (folder / "sparse" / "0").rename(folder / "sparse" / "3")
    if text:
        model = pycolmap.Reconstruction(folder / "sparse" / "3")
        for path in (folder / "sparse" / "3").iterdir():
            path.unlink()
        model.write_text(folder / "sparse" / "3")
    assert len(open_scene(str(folder), load_settings()).train) == 3


def test_images_that_were_resized_where_they_lie_have_smaller_cameras(tmp_path):
    folder = colmap(tmp_path / "in", NAMES[:3], size=(6, 4))
    scene = open_scene(str(folder), load_settings())
    assert scene.train.cameras.fx.tolist() == [5.0] * 3
    assert "images are 6 x 4, the model's cameras 12 x 8" in scene.notes[0]
    check_present(scene)


@pytest.mark.parametrize(
    ("size", "words"), [((8, 8), "cropped or squeezed"), ((8, 12), "turned on its side"), ((9, 4), "cropped")]
)
def test_images_of_another_shape_are_named_before_anything_is_chosen(tmp_path, size, words):
    folder = colmap(tmp_path / "in", NAMES[:3])
    picture(folder / "images" / NAMES[1], size)
    with pytest.raises(UserError, match=rf"{NAMES[1]}' are of 12 x 8 pixels.*{size[0]} x {size[1]}.*{words}"):
        check_present(open_scene(str(folder), load_settings()))


def test_relative_links_move_with_the_capture(tmp_path):
    folder = colmap(tmp_path / "both" / "in", NAMES[:4])
    scene = open_scene(str(folder), load_settings())
    write_subset(scene, {"indices": [2]}, tmp_path / "both" / "out" / "deep", links="relative")
    (tmp_path / "both").rename(tmp_path / "moved")
    again = open_scene(str(tmp_path / "moved" / "out" / "deep"), load_settings())
    assert again.train.paths[0].is_symlink()
    check_present(again)


def test_all_points_of_the_training_views_come_along(data_root, tmp_path):
    """As the benchmark gives them to every choice; those that only held-out views triangulated do not."""
    scene = open_scene("hololens_space", load_settings())
    write_subset(scene, {"indices": list(range(0, len(scene.train), 10))}, tmp_path / "out")
    read = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    points = known(scene.points)
    assert read.num_points3D() == len(points) < 34397
    ours = np.sort(points.xyz, axis=0)
    np.testing.assert_array_equal(np.sort([point.xyz for point in read.points3D.values()], axis=0), ours)
