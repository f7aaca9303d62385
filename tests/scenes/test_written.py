"""What a subset must hold so that the readers of its format open it: every file that they look for, and no other."""

import json
import math
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from PIL import Image
from plyfile import PlyData

from tests.scenes.test_transforms import frames, opened, write
from viewbench.common.errors import UserError
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.images import load_images
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.scenes.validate import check_present


def files(folder):
    """What lies in a folder, selection.json aside."""
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())
    return sorted(name for name in found if name != "selection.json")


def picture(path, size=(8, 6)):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size).save(path)


def colmap(folder, names, size=(12, 8), images="images", **camera):
    """A model of one camera (a PINHOLE of 12 x 8 unless told) that moves along x, with its images."""
    model = pycolmap.Reconstruction()
    camera = {"model": "PINHOLE", "width": 12, "height": 8, "params": [10, 11, 6, 4], **camera}
    model.add_camera_with_trivial_rig(pycolmap.Camera(camera_id=1, **camera))
    for number, name in enumerate(names, start=1):
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(np.array([0, 0, 0, 1.0])), np.array([-number, 0, 0.0]))
        model.add_image_with_trivial_frame(pycolmap.Image(name=name, camera_id=1, image_id=number), pose)
        picture(folder / images / name, size)
    (folder / "sparse" / "0").mkdir(parents=True)
    model.write(folder / "sparse" / "0")
    return folder


@pytest.mark.parametrize("copy", [False, True])
def test_masks_and_depths_come_along(tmp_path, copy):
    listed = frames("a.png", "b.png", "c.png")
    for frame in listed:
        frame |= {"mask_path": "masks/all.png", "depth_file_path": f"depths/{frame['file_path']}"}
        picture(tmp_path / "in" / frame["depth_file_path"])
    picture(tmp_path / "in" / "masks" / "all.png")
    scene = opened(write(tmp_path / "in", listed, fl_x=5))
    write_subset(scene, {"indices": [2, 0]}, tmp_path / "out", links="copy" if copy else "absolute")
    assert files(tmp_path / "out") == [
        "a.png",
        "c.png",
        "depths/a.png",
        "depths/c.png",
        "masks/all.png",
        "transforms.json",
    ]


def test_blender_scenes_keep_their_three_files(tmp_path):
    for split, count in (("train", 3), ("test", 2), ("val", 2)):
        listed = frames(*(f"./{split}/r_{number}" for number in range(count)))
        for frame in listed:
            picture(tmp_path / "in" / f"{frame['file_path']}.png")
        table = {"camera_angle_x": 1.0, "frames": listed}
        (tmp_path / "in" / f"transforms_{split}.json").write_text(json.dumps(table))
    scene = opened(tmp_path / "in")
    assert (len(scene.train), len(scene.test)) == (3, 2)
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    tables = {
        key: json.loads((tmp_path / "out" / f"transforms_{key}.json").read_text())
        for key in scene.details["names"]
        if key != "spare"
    }
    assert {key: len(table["frames"]) for key, table in tables.items()} == {"train": 1, "test": 2}
    assert "val/r_1.png" in files(tmp_path / "out")
    assert opened(tmp_path / "out").train.names == ("./train/r_1",)


def test_a_dot_in_a_name_is_no_suffix(tmp_path):
    listed = [{**frame, "image": f"{frame['file_path']}.png"} for frame in frames("r_0.25", "r_0.5")]
    scene = opened(write(tmp_path / "in", listed, fl_x=5))
    assert [path.name for path in scene.train.paths] == ["r_0.25.png", "r_0.5.png"]
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    assert files(tmp_path / "out") == ["r_0.5.png", "transforms.json"]


def test_points_have_the_normals_that_readers_of_3dgs_insist_on(small_room, tmp_path):
    write_subset(opened(small_room), {"indices": [1]}, tmp_path / "out")
    vertex = PlyData.read(tmp_path / "out" / "points3d.ply")["vertex"]
    assert {"nx", "ny", "nz", "red", "green", "blue"} <= {prop.name for prop in vertex.properties}


def test_one_camera_stands_at_the_top_of_new_transforms(tmp_path):
    scene = opened(colmap(tmp_path / "in", ["a.png", "b.png", "c.png"]))
    write_scene(scene, np.array([2, 0]), tmp_path / "out", "transforms")
    table = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert table["camera_angle_x"] == pytest.approx(2 * math.atan(12 / 2 / 10))
    assert [table[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")] == [10, 11, 6, 4, 12, 8]
    assert [sorted(frame) for frame in table["frames"]] == [["file_path", "transform_matrix"]] * 2


def test_several_cameras_stand_in_their_frames(tmp_path):
    listed = frames("images/a.png", "images/b.png")
    listed[1]["fl_x"] = 7
    scene = opened(write(tmp_path / "in", listed, fl_x=5))
    write_scene(scene, np.arange(2), tmp_path / "colmap", "colmap")
    assert files(tmp_path / "colmap" / "images") == ["a.png", "b.png"]
    write_scene(opened(tmp_path / "colmap"), np.arange(2), tmp_path / "out", "transforms")
    assert opened(tmp_path / "out").train.cameras.fx.tolist() == [5, 7]


def test_smaller_images_come_along(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "sub/b.png"])
    for name in ("a.png", "sub/b.png"):
        picture(folder / "images_2" / name, (6, 4))
    write_subset(opened(folder), {"indices": [1]}, tmp_path / "out")
    assert files(tmp_path / "out" / "images") == files(tmp_path / "out" / "images_2") == ["sub/b.png"]


def test_a_capture_of_smaller_images_alone_stays_one(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png"], (6, 4), "images_2")
    write_subset(opened(folder), {"indices": [1]}, tmp_path / "out")
    images, cameras = load_images(opened(tmp_path / "out").train, np.array([0]), None)
    assert (images.shape, cameras.fx[0]) == ((1, 4, 6, 3), 5)


def test_names_with_line_breaks_are_held_out_too(tmp_path):
    scene = opened(colmap(tmp_path / "in", ["a\nb.png", '"c".png', "d.png", "e.png"]), holdout="every:2")
    write_subset(scene, {"indices": [0, 1]}, tmp_path / "out")
    again = opened(tmp_path / "out")
    assert (set(again.train.names), set(again.test.names)) == (set(scene.train.names), set(scene.test.names))
    assert "a\nb.png" in scene.train.names + scene.test.names


def test_what_nerfstudio_made_is_read_as_its_own(tmp_path):
    """ns-process-data leaves the COLMAP model, whose poses are others, in colmap/ beside its transforms.json."""
    folder = colmap(tmp_path / "in", ["a.png", "b.png"])
    (folder / "colmap").mkdir()
    (folder / "sparse").rename(folder / "colmap" / "sparse")
    assert opened(folder).format == "colmap"
    assert opened(write(folder, frames("images/a.png", "images/b.png"), fl_x=5)).format == "transforms"


def test_colmap_names_stay_in_the_folder(tmp_path):
    folder = colmap(tmp_path / "in", ["../x.png", "b.png"])
    with pytest.raises(UserError, match="leaves the folder"):
        opened(folder)


@pytest.mark.parametrize("absolute", [False, True])
def test_images_from_outside_are_written_inside(tmp_path, absolute):
    picture(tmp_path / "a.png")
    (tmp_path / "in").mkdir()
    name = str(tmp_path / "a.png") if absolute else "../a.png"
    folder = write(tmp_path / "in", frames(name, "b.png"), fl_x=5)
    scene = opened(folder, allow_outside=True)
    before = files(tmp_path)
    for form in ("colmap", "images", "transforms"):
        write_scene(scene, np.arange(2), tmp_path / form, form)
        written = files(tmp_path / form)
        assert len([name for name in written if name.endswith("a.png")]) == 1
        before += [f"{form}/{name}" for name in written]
    assert files(tmp_path) == sorted(before)


def test_two_images_of_one_name_are_not_mixed_up(tmp_path):
    scene = opened(write(tmp_path / "in", frames("x/a.png", "y/a.png"), fl_x=5))
    with pytest.raises(UserError, match="have one name"):
        write_scene(scene, np.arange(2), tmp_path / "out", "images")
    assert not (tmp_path / "out").exists()


def test_frames_may_share_an_image(tmp_path):
    scene = opened(write(tmp_path / "in", frames("a.png", "./a.png"), fl_x=5))
    write_subset(scene, {"indices": [0, 1]}, tmp_path / "out", links="copy")
    assert len(opened(tmp_path / "out").train) == 2


def test_an_image_of_another_size_is_found_before_anything_is_chosen(tmp_path):
    scene = opened(write(tmp_path / "in", frames("a.png", "b.png", "c.png"), fl_x=5))
    check_present(scene)
    picture(tmp_path / "in" / "c.png", (16, 12))
    with pytest.raises(UserError, match=r"c\.png.*16 x 12"):
        check_present(scene)


def test_a_cut_test_image_is_not_written(small_room, tmp_path):
    import shutil

    shutil.copytree(small_room, tmp_path / "in")
    scene = opened(tmp_path / "in")
    path = scene.test.paths[1]
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(UserError, match=path.name):
        write_subset(scene, {"indices": [1]}, tmp_path / "out")


def test_names_that_are_not_utf8_have_a_hash(tmp_path):
    folder = tmp_path / "in"
    for number in range(2):
        picture(folder / f"{number}.png")
    (folder / "0.png").rename(folder / "caf\udce9.png")
    assert len(scene_sha256(opened(folder))) == 64


@pytest.mark.parametrize("place", ["images", ".", "images/.."])
def test_a_folder_that_has_files_of_the_capture_is_never_replaced(tmp_path, place):
    folder = colmap(tmp_path / "in", ["a.png", "b.png", "c.png"])
    with pytest.raises(UserError, match="holds the capture itself"):
        write_subset(opened(folder), {"indices": [1]}, folder / place, force=True)
    assert len(files(folder / "images")) == 3


def test_nor_is_one_that_its_links_lead_to(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png", "c.png"])
    (folder / "images").rename(tmp_path / "pictures")
    (folder / "images").symlink_to(tmp_path / "pictures")
    with pytest.raises(UserError, match="holds the capture itself"):
        write_subset(opened(folder), {"indices": [1]}, tmp_path / "pictures", force=True)
    write_subset(opened(folder), {"indices": [0, 1]}, tmp_path / "sub")
    with pytest.raises(UserError, match="holds the capture itself"):
        write_subset(opened(tmp_path / "sub"), {"indices": [1]}, tmp_path / "pictures", force=True)
    assert len(files(tmp_path / "pictures")) == 3


def test_a_link_to_a_folder_is_filled_where_it_leads(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png", "c.png"])
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    for _ in range(2):
        write_subset(opened(folder), {"indices": [1]}, tmp_path / "out", force=True)
    assert (tmp_path / "out").is_symlink()
    assert files(tmp_path / "disk" / "images") == ["b.png"]


def test_where_no_link_can_be_made_the_sentence_says_copy(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(1, "Operation not permitted")

    scene = opened(colmap(tmp_path / "in", ["a.png", "b.png"], params=[10, 10, 6, 4]))
    monkeypatch.setattr(Path, "symlink_to", refuse)
    monkeypatch.setattr(Path, "hardlink_to", refuse)
    with pytest.raises(UserError, match="give --copy"):
        write_subset(scene, {"indices": [1]}, tmp_path / "out")
    write_scene(scene, np.array([0, 1]), tmp_path / "out", "transforms", links="copy")
    assert len(files(tmp_path / "out" / "blender")) == 2


def test_masks_and_depths_are_converted_both_ways(tmp_path):
    listed = frames("images/a.jpg", "images/b.jpg", "images/c.jpg")
    for frame in listed:
        frame |= {"mask_path": "masks/all.png", "depth_file_path": f"d/{frame['file_path'][7]}.png"}
        picture(tmp_path / "in" / frame["depth_file_path"])
    picture(tmp_path / "in" / "masks" / "all.png")
    scene = opened(write(tmp_path / "in", listed, fl_x=5), holdout="every:3")
    write_scene(scene, np.arange(2), tmp_path / "colmap", "colmap")
    for kind in ("masks", "depths"):
        assert files(tmp_path / "colmap" / kind) == ["a.png", "b.png", "c.png"]
    back = opened(tmp_path / "colmap")
    assert [path and path.name for path in back.train.depths] == ["b.png", "c.png"]
    write_scene(back, np.arange(2), tmp_path / "back", "transforms")
    table = json.loads((tmp_path / "back" / "transforms.json").read_text())
    for frame in table["frames"]:
        assert (tmp_path / "back" / frame["mask_path"]).is_file()
        assert (tmp_path / "back" / frame["depth_file_path"]).is_file()


def test_names_that_are_no_ascii_have_a_text_model_too(tmp_path):
    write_subset(opened(colmap(tmp_path / "in", ["żółć.png", "b.png"])), {"indices": [0, 1]}, tmp_path / "out")
    assert "żółć.png" in (tmp_path / "out" / "sparse" / "0" / "images.txt").read_text(encoding="utf-8")
    assert (tmp_path / "out" / "sparse" / "0" / "images.bin").is_file()


def test_the_3dgs_authors_depth_scales_come_along(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png"])
    (folder / "sparse" / "0" / "depth_params.json").write_text(json.dumps({"a": {"scale": 1}, "b": {"scale": 2}}))
    write_subset(opened(folder), {"indices": [1]}, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "sparse" / "0" / "depth_params.json").read_text()) == {"b": {"scale": 2}}


def test_what_is_left_out_is_said(tmp_path):
    folder = colmap(tmp_path / "in", ["a.png", "b.png"])
    picture(folder / "images_2" / "a.png", (6, 4))
    _, notes = write_subset(opened(folder), {"indices": [0, 1]}, tmp_path / "out")
    assert "images_2/ is left out" in notes[0]
    scene = opened(write(tmp_path / "bent", frames("a.png", "b.png"), fl_x=5, k1=0.1, k3=0.1))
    assert "FULL_OPENCV" in write_scene(scene, np.arange(2), tmp_path / "colmap", "colmap")[0]
