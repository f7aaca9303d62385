"""Photos as telephones make them: turned by an EXIF tag, and HEIC."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image, ImageOps

from viewbench.common import extras
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.scenes.features import picture
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene, write_subset
from viewbench.scenes.validate import check_present
from viewbench.workflow.commands import _main

SETTINGS = settings_file.load()
ORIENTATION = 0x0112


def corners(width=64, height=48):
    pixels = np.full((height, width, 3), 240, np.uint8)
    pixels[: height // 2, : width // 2] = (240, 0, 0)
    pixels[: height // 2, width // 2 :] = (0, 240, 0)
    pixels[height // 2 :, : width // 2] = (0, 0, 240)
    return Image.fromarray(pixels)


def exif(orientation):
    tags = Image.Exif()
    tags[0x010F] = "Maker"
    tags[ORIENTATION] = orientation
    tags.get_ifd(0x8769)[0xA405] = 26  # FocalLengthIn35mmFilm, from which COLMAP starts
    return tags


def photos(folder, orientations, suffix="jpg", **options):
    folder.mkdir()
    for number, orientation in enumerate(orientations):
        tags = (
            {}
            if orientation is None
            else {"exif": exif(orientation).tobytes() if suffix.lower() == "heic" else exif(orientation)}
        )
        corners().save(folder / f"IMG {number}.{suffix}", quality=95, subsampling=0, **tags, **options)
    return folder


def near(path, expected, tolerance=10):
    with Image.open(path) as image:
        seen = np.asarray(image.convert("RGB")).astype(int)
    wanted = np.asarray(expected.convert("RGB")).astype(int)
    return seen.shape == wanted.shape and np.median(np.abs(seen - wanted)) < tolerance


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_written_as_it_is_seen_whatever_reads_it(tmp_path, orientation, suffix):
    folder = photos(tmp_path / "in", [orientation] * 3, suffix)
    with Image.open(folder / f"IMG 1.{suffix}") as image:
        seen = ImageOps.exif_transpose(image).copy()
    scene = open_scene(str(folder), SETTINGS)
    check_present(scene)
    assert (scene.train.cameras.width[0], scene.train.cameras.height[0]) == seen.size
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    written = tmp_path / "out" / "images" / f"IMG 1.{suffix}"
    assert near(written, seen)
    assert written.is_symlink() == (orientation == 1)
    with Image.open(written) as image:
        assert image.getexif().get(ORIENTATION, 1) == 1
        if suffix != "tif":  # PIL does not keep the tags of a TIFF that it turns
            assert image.getexif()[0x010F] == "Maker"
            assert image.getexif().get_ifd(0x8769)[0xA405] == 26
    inner = picture(folder / f"IMG 1.{suffix}", 16)
    np.testing.assert_allclose(inner, picture(written, 16), atol=0.2)
    assert np.abs(inner - np.asarray(seen.convert("RGB").resize((16, 16))) / 255).mean() < 0.05


def test_opencv_and_colmap_agree_on_what_is_written(tmp_path):
    cv2, pycolmap = pytest.importorskip("cv2"), pytest.importorskip("pycolmap")
    folder = photos(tmp_path / "in", [6, 6])
    sizes = []
    write_subset(open_scene(str(folder), SETTINGS), {"indices": [1]}, tmp_path / "out")
    for path in (folder / "IMG 1.jpg", tmp_path / "out" / "images" / "IMG 1.jpg"):
        bitmap = pycolmap.Bitmap.read(str(path), True)
        sizes.append(((bitmap.width, bitmap.height), cv2.imread(str(path)).shape[1::-1]))
    assert sizes == [((64, 48), (48, 64)), ((48, 64), (48, 64))]


def test_photos_held_both_ways_stay_as_the_sensor_saw_them(tmp_path):
    folder = photos(tmp_path / "in", [1, 6, 8, None])
    scene = open_scene(str(folder), SETTINGS)
    check_present(scene)
    assert any("not turned" in note for note in scene.notes)
    assert {(int(w), int(h)) for w, h in zip(scene.train.cameras.width, scene.train.cameras.height, strict=True)} == {
        (64, 48)
    }
    write_subset(scene, {"indices": [0, 1, 2, 3]}, tmp_path / "out")
    for number in range(4):
        name = f"IMG {number}.jpg"
        with Image.open(folder / name) as before, Image.open(tmp_path / "out" / "images" / name) as after:
            np.testing.assert_array_equal(np.asarray(before), np.asarray(after))
            assert after.getexif().get(ORIENTATION, 1) == 1
            assert ImageOps.exif_transpose(after).size == after.size
        changed = (folder / name).read_bytes() != (tmp_path / "out" / "images" / name).read_bytes()
        assert changed == (number in (1, 2))


def test_several_sizes_are_several_cameras(tmp_path):
    folder = photos(tmp_path / "in", [1, 6])
    corners(80, 60).save(folder / "IMG 3.jpg")
    scene = open_scene(str(folder), SETTINGS)
    assert "photos of several sizes" in scene.notes[-1]
    write_subset(scene, {"indices": [0, 1, 2]}, tmp_path / "out")
    sizes = zip(scene.train.cameras.width, scene.train.cameras.height, strict=True)
    for path, size in zip(sorted((tmp_path / "out" / "images").iterdir()), sizes, strict=True):
        with Image.open(path) as image:
            assert image.size == size, "as they are seen"


def test_a_cut_photo_with_a_tag_is_named_and_nothing_is_written(tmp_path):
    folder = photos(tmp_path / "in", [6, 6])
    path = folder / "IMG 1.jpg"
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(UserError, match=r"IMG 1\.jpg"):
        write_subset(open_scene(str(folder), SETTINGS), {"indices": [1]}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def heic(tmp_path):
    """Three photos that pillow-heif wrote, one of them turned."""
    pillow_heif = pytest.importorskip("pillow_heif")
    pillow_heif.register_heif_opener()
    return photos(tmp_path / "in", [1, 1, 1], "HEIC")


def test_heic_is_written_as_what_trainers_read(heic, tmp_path):
    scene = open_scene(str(heic), SETTINGS)
    assert scene.format == "images"
    check_present(scene)
    write_subset(scene, {"indices": [2, 0]}, tmp_path / "out")
    written = sorted((tmp_path / "out" / "images").iterdir())
    assert [path.name for path in written] == ["IMG 0.jpg", "IMG 2.jpg"]
    for path in written:
        assert path.read_bytes()[:3] == b"\xff\xd8\xff"
        assert near(path, corners())
        with Image.open(path) as image:
            assert image.getexif().get_ifd(0x8769)[0xA405] == 26


def test_heic_beside_a_jpeg_of_the_same_name(heic, tmp_path):
    corners().save(heic / "IMG 0.jpg")
    scene = open_scene(str(heic), SETTINGS)
    write_scene(scene, np.arange(4), tmp_path / "out", "images")
    assert sorted(path.name for path in (tmp_path / "out" / "images").iterdir()) == [
        "IMG 0.HEIC.jpg",
        "IMG 0.jpg",
        "IMG 1.jpg",
        "IMG 2.jpg",
    ]


def test_a_heic_that_is_turned(tmp_path):
    pillow_heif = pytest.importorskip("pillow_heif")
    pillow_heif.register_heif_opener()
    folder = photos(tmp_path / "in", [6, 6], "heic")
    scene = open_scene(str(folder), SETTINGS)
    assert (scene.train.cameras.width[0], scene.train.cameras.height[0]) == (48, 64)
    write_subset(scene, {"indices": [1]}, tmp_path / "out")
    assert near(tmp_path / "out" / "images" / "IMG 1.jpg", corners().transpose(Image.Transpose.ROTATE_270))


def test_heic_without_its_package_is_the_line_to_type(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "in"
    folder.mkdir()
    for number in range(2):
        (folder / f"{number}.HEIC").write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    found = extras.importlib.util.find_spec
    monkeypatch.setattr(
        extras.importlib.util, "find_spec", lambda name, *rest: None if name == "pillow_heif" else found(name, *rest)
    )
    assert _main.run(["info", str(folder)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].endswith("pip install 'viewbench[heic]'")


def test_a_broken_heic_is_named(heic):
    (heic / "IMG 1.HEIC").write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    with pytest.raises(UserError, match=r"IMG 1\.HEIC"):
        open_scene(str(heic), SETTINGS)


def test_nothing_of_it_is_imported_for_other_photos(tmp_path):
    """The light install has neither package."""
    folder = photos(tmp_path / "in", [1, 6])
    code = (
        "import sys; from viewbench.common import settings as s; from viewbench.scenes.load import open_scene; "
        f"open_scene({str(folder)!r}, s.load()); assert not {{'pillow_heif', 'cv2', 'av'}} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
