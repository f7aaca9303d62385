"""Inputs that fuzzing found, each as small as it gets: what was an exception, or words of a library, is a sentence."""

import contextlib
import io
import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.fuzz import _files, _records, _scenes
from viewbench.backends import _snapshot
from viewbench.common import catalogue
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.files import sealed, sha256_file, unsealed
from viewbench.common.settings import PACKAGE
from viewbench.scenes import digest, features
from viewbench.scenes._quiet import silenced
from viewbench.scenes.download import unpack
from viewbench.scenes.download.receipt import is_there
from viewbench.scenes.download.unfinished import State
from viewbench.scenes.image_files import check_whole, image_size
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.seen import FILE, shares_of
from viewbench.scenes.splits import held_out
from viewbench.scenes.subset import write_scene
from viewbench.scenes.validate import check_present, check_scene
from viewbench.selectors._selection import load_selection
from viewbench.workflow import _study

HEADS = ["{'descr': '|b1', 'shape': (3, }, }", "{'descr': '<f2', 'fortran_order': False, 'shape': (True, 4), }"]


def npy(head: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + b"\0" * 64


def refused(call, *arguments) -> str:
    with pytest.raises(UserError) as caught:
        call(*arguments)
    return str(caught.value)


@pytest.mark.parametrize("head", HEADS)
def test_heads_of_arrays_at_which_numpy_fails_in_its_own_ways(tmp_path, head):
    (tmp_path / "a.npy").write_bytes(npy(head))
    assert features.cached(tmp_path / "a.npy") is None
    assert "a.npy" in refused(features.load_user_features, tmp_path / "a.npy", 3)
    with zipfile.ZipFile(tmp_path / _snapshot.FILE, "w") as archive:
        archive.writestr("plain.npy", npy(head))
    assert _snapshot.read(tmp_path, lambda stored, plain: stored) is None


@pytest.mark.parametrize("row", [np.zeros((2, 2), np.float32), np.array([np.nan], np.float32), np.zeros(3, np.int32)])
def test_a_row_of_the_cache_that_is_none_is_made_again(tmp_path, row):
    np.save(tmp_path / "row.npy", row)
    assert features.cached(tmp_path / "row.npy") is None


def test_a_rig_that_does_not_have_its_camera(tmp_path):
    _scenes.of_rig("txt", tmp_path)
    rigs = tmp_path / "model" / "sparse" / "0" / "rigs.txt"
    rows = rigs.read_text().split("\n")
    words = rows[-2].split()
    rigs.write_text("\n".join([*rows[:-2], " ".join([*words[:4], "CAMERA", "2", "0"]), ""]))
    assert "rig" in refused(open_scene, str(tmp_path / "model"), _scenes.SETTINGS)


def test_lenses_and_times_of_nan(tmp_path):
    scene = _scenes.room(tmp_path)
    lens = np.zeros((3, 5))
    lens[1, 2] = np.nan
    bad = replace(scene.train, cameras=replace(scene.train.cameras, distortion=lens))
    assert scene.train.names[1] in refused(check_scene, replace(scene, train=bad))
    late = replace(scene.train, times=np.array([0, 1, np.inf]))
    assert scene.train.names[2] in refused(check_scene, replace(scene, train=late))


@pytest.mark.parametrize("time", [10**400, float("inf"), "7", None])
def test_times_of_a_phone_that_are_none(tmp_path, time):
    _scenes.of_scannetpp("iphone", tmp_path)
    file = tmp_path / "iphone" / "pose_intrinsic_imu.json"
    table = json.loads(file.read_text())
    table["frame_000000"]["timestamp"] = time
    file.write_text(json.dumps(table))
    assert open_scene(str(tmp_path), _scenes.SETTINGS).train.times is None


@pytest.mark.parametrize("names", [3.5, "a", {"a": 1}, True])
def test_lists_of_transforms_that_are_none(tmp_path, names):
    _scenes.of_nerfstudio(tmp_path / "in")
    file = tmp_path / "in" / "room" / "transforms.json"
    table = json.loads(file.read_text())
    file.write_text(json.dumps({**table, "train_filenames": [table["frames"][0]["file_path"]], "val_filenames": names}))
    assert "val_filenames" in refused(open_scene, str(tmp_path / "in" / "room"), _scenes.SETTINGS)


def test_a_subset_of_transforms_with_nan_in_a_field_of_their_own(tmp_path):
    _scenes.room(tmp_path / "room")
    file = tmp_path / "room" / "transforms_train.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "mine": float("nan")}))
    scene = open_scene(str(tmp_path / "room"), _scenes.SETTINGS)
    assert "NaN" in refused(write_scene, scene, np.arange(2), tmp_path / "out", "transforms")
    assert not (tmp_path / "out").exists()


def test_names_longer_than_a_file_system_takes(tmp_path):
    _scenes.of_scannetpp("iphone", tmp_path / "phone")
    file = tmp_path / "phone" / "iphone" / "pose_intrinsic_imu.json"
    table = json.loads(file.read_text())
    file.write_text(json.dumps({**table, "a" * 300: table["frame_000000"]}))
    assert "a" * 300 not in open_scene(str(tmp_path / "phone"), _scenes.SETTINGS).train.names
    _scenes.of_rgbd("tum-rgbd", tmp_path)
    (tmp_path / "room0" / "depth.txt").write_text(f"100.0 depth/{'a' * 300}.png\n100.1 depth/1.png\n")
    depths = open_scene(str(tmp_path / "room0"), _scenes.SETTINGS).train.depths
    assert [path is not None for path in depths] == [False, True, False]


def test_keypoints_of_points_that_the_model_does_not_have(tmp_path):
    _scenes.of_rig("txt", tmp_path)
    points = tmp_path / "model" / "sparse" / "0" / "points3D.txt"
    rows = points.read_text().split("\n")
    points.write_text("\n".join(row for i, row in enumerate(rows) if i != 5))
    scene = open_scene(str(tmp_path / "model"), _scenes.SETTINGS)
    assert "damaged" in refused(write_scene, scene, np.array([0, 2]), tmp_path / "out", "colmap")


def test_a_transform_between_cameras_that_has_no_inverse(tmp_path):
    _scenes.of_seven(tmp_path)
    matrix = np.eye(4)
    matrix[3, 3] = 0
    np.savetxt(tmp_path / "room0" / "depth_to_color.txt", matrix)
    assert "depth_to_color.txt" in refused(open_scene, str(tmp_path / "room0"), _scenes.SETTINGS)


def test_a_scale_of_depth_so_small_that_its_unit_is_infinite(tmp_path):
    _scenes.of_rgbd("replica", tmp_path)
    file = tmp_path / "cam_params.json"
    table = json.loads(file.read_text())
    table["camera"]["scale"] = 5e-324
    file.write_text(json.dumps(table))
    assert open_scene(str(tmp_path / "room0"), _scenes.SETTINGS).depth_unit == 0


def test_a_pose_of_infinities_is_said_once_and_without_a_warning(tmp_path, recwarn):
    _scenes.of_kitti(tmp_path)
    poses = tmp_path / "poses" / "04.txt"
    rows = poses.read_text().split("\n")
    poses.write_text("\n".join([" ".join(["inf"] * 12), *rows[1:]]))
    assert "000000.png" in refused(open_scene, str(tmp_path / "sequences" / "04"), _scenes.SETTINGS)
    assert [str(one.message) for one in recwarn if one.category is RuntimeWarning] == []


def test_a_lens_whose_formula_overflows(tmp_path, recwarn):
    scene = _scenes.room(tmp_path)
    lens = np.full((3, 5), 1e308)
    bad = replace(scene.train, cameras=replace(scene.train.cameras, distortion=lens))
    assert "distortion" in refused(load_images, bad, np.array([0]), 16)
    assert [str(one.message) for one in recwarn if one.category is RuntimeWarning] == []


def test_a_png_at_whose_chunk_pil_fails_by_an_index(tmp_path):
    """A profile without its name's end, behind the pixels: it is looked at when they are read."""
    made = io.BytesIO()
    Image.new("RGB", (64, 48)).save(made, format="PNG")
    kind, body = b"iCCP", b""
    chunk = struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    end = made.getvalue().index(b"IEND") - 4
    (tmp_path / "a.png").write_bytes(made.getvalue()[:end] + chunk + made.getvalue()[end:])
    assert image_size(tmp_path / "a.png") == (64, 48)
    assert "a.png" in refused(check_whole, tmp_path / "a.png")


def test_a_picture_that_is_one_line_of_a_million_pixels(tmp_path):
    made = io.BytesIO()
    Image.new("1", (2_000_000, 1)).save(made, format="PNG")
    (tmp_path / "a.png").write_bytes(made.getvalue())
    assert "2000000 x 1" in refused(image_size, tmp_path / "a.png")


def tags_of_nothing(path) -> None:
    """A photo whose EXIF says that a tag's data lie beyond its end."""
    data = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x0f\0\x02\xff\xff\xff\x00\0\0\0\x08"
    Image.new("RGB", (8, 8)).save(path, exif=data)


def test_pil_does_not_warn_of_exif(tmp_path):
    """In a process of its own: pytest takes warnings to itself."""
    tags_of_nothing(tmp_path / "a.jpg")
    with pytest.warns(UserWarning, match="Tag data|Corrupt EXIF"), Image.open(tmp_path / "a.jpg") as image:
        image.getexif()
    code = f"""
from pathlib import Path
from viewbench.scenes.orientation import upright_size
print(upright_size(Path({str(tmp_path / "a.jpg")!r})))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("(8, 8)\n", "")


def test_libtiff_does_not_write_to_stderr(tmp_path, capfd):
    _files.pixels("1").save(tmp_path / "fax.tif", compression="group4")
    data = bytearray((tmp_path / "fax.tif").read_bytes())
    with Image.open(tmp_path / "fax.tif") as image:
        at = vars(image)["tag_v2"][273][0]
    data[at : at + 8] = b"\xff" * 8
    (tmp_path / "fax.tif").write_bytes(data)
    with contextlib.suppress(UserError):
        check_whole(tmp_path / "fax.tif")
    assert capfd.readouterr().err == ""


def test_stderr_comes_back_after_the_last_of_several(capfd):
    with silenced(True):
        with silenced(True), silenced(False):
            os.write(2, b"lost\n")
        os.write(2, b"lost too\n")
    os.write(2, b"kept\n")
    assert capfd.readouterr().err == "kept\n"


@pytest.mark.parametrize("record", [[], 3, None, {"a": float("nan"), "content_sha256": "0" * 64}])
def test_records_that_were_never_sealed(record):
    assert "x.json" in refused(unsealed, record, "x.json")
    assert unsealed(sealed({"a": 1}), "x.json") == {"a": 1}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("notes", {"below_precision_from": "~"}),
        ("notes", []),
        ("gains", "x"),
        ("names", [1, 2]),
        ("seconds", {"select": "a"}),
        ("cut_from", None),
    ],
)
def test_selections_with_parts_of_other_kinds(tmp_path, key, value):
    _records.of_selection(tmp_path)
    file = tmp_path / "selection.json"
    load_selection(file)
    file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    assert key in refused(load_selection, file)


@pytest.mark.parametrize("key", ["gains", "seed", "other"])
def test_selections_of_nan(tmp_path, key):
    _records.of_selection(tmp_path)
    file = tmp_path / "selection.json"
    file.write_text(
        json.dumps({**json.loads(file.read_text()), key: [float("nan")] if key == "gains" else float("inf")})
    )
    assert "selection.json" in refused(load_selection, file)


@pytest.mark.parametrize("rule", ["every:" + "9" * 30, "blocks:" + "9" * 30, "every:" + "9" * 5000])
def test_rules_with_numbers_that_no_machine_holds(rule):
    assert "holdout" in refused(held_out, rule, 20)


@pytest.mark.parametrize("digits", [30, 5000])
def test_settings_and_studies_with_numbers_that_no_machine_holds(tmp_path, digits):
    pytest.importorskip("jsonschema")
    (tmp_path / "a.toml").write_text(f"[compute]\nthreads = {'9' * 5000}\n")
    assert "a.toml" in refused(settings_file.load, tmp_path / "a.toml")
    study = _study.STUDIES / "tiny.yaml"
    rows = [row for row in study.read_text().split("\n") if not row.startswith("seeds:")]
    (tmp_path / "a.yaml").write_text("\n".join([*rows, f"seeds: {'9' * digits}", ""]))
    assert "a.yaml" in refused(_study.load, str(tmp_path / "a.yaml"), _scenes.SETTINGS)


def test_an_archive_with_a_file_and_a_folder_of_one_name(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("room/a", b"a")
        archive.writestr("room/a/b", b"b")
    assert "a.zip" in refused(taken, tmp_path)


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan"), float("inf")])
def test_shares_that_are_none(tmp_path, share):
    (tmp_path / FILE).write_text(json.dumps({"seen": {"a": share}}))
    assert FILE in refused(shares_of, tmp_path, ["a"])


@pytest.mark.parametrize(
    "record", ["[]", '{"force": NaN}', '{"unpacked": [[]], "directory": 3}', '{"force": -Infinity']
)
def test_a_damaged_state_of_a_download_is_none(tmp_path, record):
    (tmp_path / "state.json").write_text(record)
    state = State(tmp_path / "state.json", tmp_path / "staging")
    assert (state.directory, state.unpacked) == (None, [])
    state.begin(False)
    state.has_unpacked("a.zip")
    assert State(tmp_path / "state.json", tmp_path / "staging").unpacked == ["a.zip"]


@pytest.mark.parametrize("entry", [3, [], ["x"], {"a": 1}, [1, 2, 3, 4, "no hash"]])
def test_damaged_hashes_of_the_cache_are_made_again(tmp_path, monkeypatch, entry):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(digest, "REMEMBERED_BYTES", 0)
    monkeypatch.setattr(digest, "SETTLED_S", -9)  # the file is of now
    file = tmp_path / "a.bin"
    file.write_bytes(b"a")
    os.utime(file, (1e9, 1e9))
    true = digest.file_sha256(file)
    (known,) = (tmp_path / "cache").rglob("*.json")
    assert os.fsencode(file).hex() in json.loads(known.read_text())
    known.write_text(json.dumps({os.fsencode(file).hex(): entry}))
    assert digest.file_sha256(file) == true


@pytest.mark.parametrize("packed", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_DEFLATED])
def test_archives_whose_decoder_fails_in_its_own_way(tmp_path, packed):
    content = np.random.default_rng(0).bytes(3000)
    with zipfile.ZipFile(tmp_path / "a.zip", "w", packed) as archive:
        archive.writestr("room/a.bin", content)
    whole = (tmp_path / "a.zip").read_bytes()
    for at in range(45, 400, 7):
        (tmp_path / "a.zip").write_bytes(whole[:at] + b"\xff\xff\xff" + whole[at + 3 :])
        with contextlib.suppress(unpack.DamagedError):
            taken(tmp_path)
            assert (tmp_path / "out" / "a.bin").read_bytes() == content  # bits that stand for nothing


def taken(folder, done=lambda count: None):
    with unpack.damaged("a.zip"), zipfile.ZipFile(folder / "a.zip") as archive:
        unpack.extract(archive, unpack.members(archive, "room/", (), "a.zip"), folder / "out", "a.zip", done)


def test_a_full_disk_is_no_damaged_archive(tmp_path):
    def full(count):
        raise OSError(28, "No space left on device", "a")

    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("room/a.bin", b"a")
    with pytest.raises(OSError, match="No space"):
        taken(tmp_path, full)


@pytest.mark.parametrize("files", ["x", [], 3, {"a": "b"}, None])
def test_receipts_that_nobody_wrote(tmp_path, files):
    _records.of_downloads(tmp_path)
    receipt = tmp_path / "set" / "room" / "download.json"
    assert is_there(_records.LISTED, _records.DATA, tmp_path)
    receipt.write_text(json.dumps({"files": files}))
    assert "download.json" in refused(is_there, _records.LISTED, _records.DATA, tmp_path)
    receipt.write_text("[]")
    assert "download.json" in refused(is_there, _records.LISTED, _records.DATA, tmp_path)


CATALOGUES = [
    ("bytes = 5", 'bytes = "5"'),
    ("bytes = 5", "bytes = 1" + "0" * 400),
    ("bytes = 5", "bytes = nan"),
    ("bytes = 5", "about_gb = {}"),
    ('folder = "room"', 'folder = "../room"'),
    ('folder = "room"', "folder = 3"),
    ('also = ["a"]', "also = [1]"),
    ('name = "CC"', "name = 1"),
    ('title = "A"', "title = []"),
]


@pytest.mark.parametrize(("line", "other"), CATALOGUES)
def test_catalogues_with_values_of_other_kinds(tmp_path, monkeypatch, line, other):
    text = """[set]
title = "A"
home = ""
citation = ""
source = ""
[set.licence]
name = "CC"
address = ""
says = ""
[set.scenes.room]
address = "https://example.org/a.zip"
bytes = 5
folder = "room"
also = ["a"]
"""
    file = tmp_path / "catalogue.toml"
    monkeypatch.setenv(catalogue.VARIABLE, str(file))
    file.write_text(text)
    assert catalogue._read.__wrapped__(str(file))["set"].size == "0.00 MB"
    assert line in text
    file.write_text(text.replace(line, other))
    assert "catalogue.toml" in refused(catalogue._read.__wrapped__, str(file))


@pytest.mark.parametrize("width", [0, -3, 10**400, 2**62])
def test_widths_that_no_picture_has(tmp_path, width):
    scene = _scenes.room(tmp_path)
    assert "width" in refused(load_images, scene.train, np.array([0]), width)


@pytest.mark.parametrize("value", [1e308, float("inf"), float("nan"), 10**400, "x", None])
def test_models_to_be_drawn_with_numbers_that_are_none(tmp_path, value):
    pytest.importorskip("numba")
    from viewbench.backends import splat

    _records.of_model(tmp_path)
    scene, _ = _records.small_scene()
    file = tmp_path / "model" / "splat.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "near": value}))
    assert "splat.json" in refused(splat.render, tmp_path / "model", scene.test.cameras)


@pytest.mark.parametrize(("key", "value"), [("backend", 3), ("width", {}), ("width", None), ("files", [])])
def test_records_of_models_of_other_kinds(tmp_path, key, value):
    pytest.importorskip("numba")
    from viewbench.backends._evaluate import evaluate

    _records.of_model(tmp_path)
    scene, _ = _records.small_scene()
    file = tmp_path / "model" / "train.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))

    def scored():
        evaluate(tmp_path / "model", scene, tmp_path / "out", settings=_scenes.SETTINGS)

    assert "train.json" in refused(scored)


FIGURES = [
    ("metrics.json", "psnr_db", "x"),
    ("metrics.json", "seconds", None),
    ("metrics.json", "lpips", ...),
    ("selection.json", "seconds", {"select": "a"}),
    ("train.json", "seconds", True),
    ("train.json", "commit", []),
]


@pytest.mark.parametrize(("file", "key", "value"), FIGURES)
def test_cells_that_lack_a_figure(tmp_path, file, key, value):
    pytest.importorskip("jsonschema")
    from viewbench.workflow import _collect

    asked = _records._asked()
    _records.of_cell(tmp_path)
    assert _collect._figures(_records.CELL, tmp_path, asked)["psnr_db"] == 20
    record = json.loads((tmp_path / file).read_text())
    record = {name: one for name, one in record.items() if name != key} | ({} if value is ... else {key: value})
    (tmp_path / file).write_text(json.dumps(record))
    if file == "train.json":  # which the scores name
        scores = json.loads((tmp_path / "metrics.json").read_text())
        scores["train_sha256"] = sha256_file(tmp_path / file)
        (tmp_path / "metrics.json").write_text(json.dumps(scores))
    assert file in refused(_collect._figures, _records.CELL, tmp_path, asked)


@pytest.mark.parametrize("file", ["packets.npz", "facts.json", "lost.json", "frame_000001.jpg"])
@pytest.mark.parametrize("content", [b"", b"[[1]]", b"{}", b"PK\x05\x06" + b"\0" * 18])
def test_what_is_damaged_in_the_cache_of_a_video_is_found_out_anew(tmp_path, monkeypatch, file, content):
    pytest.importorskip("av")
    from viewbench.scenes.formats import video

    if file.endswith("jpg") and content:
        pytest.skip("a picture that is there and none is said by whoever reads it")
    _records.of_caches(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    before = video.read(tmp_path / "walk.mp4", cache_gb=1)
    (damaged,) = (tmp_path / "cache").rglob(file)
    damaged.write_bytes(content)
    after = video.read(tmp_path / "walk.mp4", cache_gb=1)
    assert after.train.names == before.train.names
    np.testing.assert_array_equal(after.train.times, before.train.times)
    check_present(after)


def test_a_frame_of_a_model_whose_image_is_taken_out_of_the_list(tmp_path):
    _scenes.of_colmap("txt", tmp_path)
    images = tmp_path / "model" / "sparse" / "0" / "images.txt"
    assert (images.parent / "frames.txt").is_file()
    rows = images.read_text().split("\n")
    at = 2 + next(number for number, row in enumerate(rows) if row and not row.startswith("#"))
    images.write_text("\n".join([*rows[:at], *rows[at + 2 :]]))
    scene = open_scene(str(tmp_path / "model"), _scenes.SETTINGS)
    assert "damaged" in refused(write_scene, scene, np.arange(len(scene.train)), tmp_path / "out", "colmap")


def test_names_in_records_longer_than_a_file_system_takes(tmp_path):
    from viewbench.backends._evaluate import altered_file

    name = "a" * 300
    _records.of_downloads(tmp_path)
    (tmp_path / "set" / "room" / "download.json").write_text(json.dumps({"files": {name: 5}}))
    assert "changed" in refused(is_there, _records.LISTED, _records.DATA, tmp_path)
    assert altered_file(tmp_path, {"files": {name: "0" * 64}}) == name


def test_features_that_are_no_numbers_of_32_bits(tmp_path, recwarn):
    rows = np.ones((3, 4))
    np.save(tmp_path / "a.npy", rows * 1e30)
    assert features.load_user_features(tmp_path / "a.npy", 3).dtype == np.float32
    rows[1, 2] = 1e300
    np.save(tmp_path / "a.npy", rows)
    assert "row 1" in refused(features.load_user_features, tmp_path / "a.npy", 3)
    assert [str(one.message) for one in recwarn if one.category is RuntimeWarning] == []


SIGNALLING = np.full((3, 4), 0x7C01, np.uint16).view(np.float16)  # NaN at which processors raise "invalid"


@pytest.mark.parametrize("rows", [SIGNALLING, np.full((3, 4), "a"), np.ones((3, 4), complex), np.ones((2, 4), "f2")])
def test_shipped_features_that_are_none(tmp_path, rows, recwarn):
    from viewbench.scenes import shipped_features

    _files.of_shipped(tmp_path)
    file = tmp_path / "features" / "enc.npy"
    assert len(shipped_features.read(tmp_path, "enc", lambda: _files.MADE_BY)) == 3
    np.save(file, rows)
    file.with_suffix(".sha256").write_text(shipped_features._sums(file))
    assert "enc.npy" in refused(shipped_features.read, tmp_path, "enc", lambda: _files.MADE_BY)
    assert [str(one.message) for one in recwarn if one.category is RuntimeWarning] == []


def mixed(path, names) -> None:
    """A PLY of one vertex: signalling NaN of 32 bits, beside the second column's 1e300 of 64."""
    kinds = ["double" if number == 1 else "float" for number in range(len(names))]
    head = "".join(f"property {kind} {name}\n" for kind, name in zip(kinds, names, strict=True))
    values = [struct.pack("<d", 1e300) if kind == "double" else struct.pack("<I", 0x7F800001) for kind in kinds]
    begin = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
    path.write_bytes(f"{begin}{head}end_header\n".encode() + b"".join(values))


def test_points_and_gaussians_of_kinds_that_do_not_fit_each_other(tmp_path, recwarn):
    from viewbench.backends import _gaussian_ply
    from viewbench.scenes.ply import read_points

    mixed(tmp_path / "a.ply", ["x", "y", "z", "red", "green", "blue"])
    assert len(read_points(tmp_path / "a.ply")) == 1
    mixed(tmp_path / "b.ply", _gaussian_ply.fields(0))
    assert np.isinf(_gaussian_ply.load(tmp_path / "b.ply").means[0, 1])
    assert [str(one.message) for one in recwarn if one.category is RuntimeWarning] == []


STUDIES = [
    *[("ratios", [None]), ("ratios", 3), ("selectors", [{"name": 1e5, "selector": "a"}]), ("selectors", ["a"])],
    *[("backends", [{"name": "splat", "grid": []}]), ("backends", [{"name": "splat", "grid": {"ratios": ["a"]}}])],
    *[("title", 3), ("scenes", [[]]), ("seeds", "ab")],
]


DESCRIPTIONS = [
    *[("n_train", "4"), ("n_test", None), ("room", 3), ("walk", ["a"]), ("seen", {"a": 1}), ("seen", ["a"])],
    *[("points", 3), ("points", [[1, 2]]), ("train", []), ("test", {"positions": [["a", 1, 2]]})],
]


@pytest.mark.parametrize(("key", "value"), DESCRIPTIONS)
def test_descriptions_of_scenes_with_parts_of_other_kinds(tmp_path, key, value):
    from tests.reports.fixtures import make_study
    from viewbench.reports import _study as of_reports

    folder = make_study(tmp_path / "study", scenes=("room_human",), selectors=("random",), ratios=(0.1,), seeds=(0,))
    study = of_reports.load(folder)
    record = json.loads((folder / "scenes" / "room_human.json").read_text())
    assert study.scene("room_human").n_train == record["n_train"]
    (folder / "scenes" / "room_human.json").write_text(json.dumps({**record, key: value}))
    assert "room_human.json" in refused(study.scene, "room_human")


@pytest.mark.parametrize(("key", "value"), STUDIES)
def test_descriptions_of_studies_with_parts_of_other_kinds(tmp_path, key, value):
    from tests.reports.fixtures import make_study
    from viewbench.reports import _study as of_reports

    folder = make_study(tmp_path / "study", scenes=("room_human",), selectors=("random",), ratios=(0.1,), seeds=(0,))
    record = json.loads((folder / "study.json").read_text())
    assert of_reports.load(folder).ratios == (0.1,)
    (folder / "study.json").write_text(json.dumps({**record, key: value}))
    assert "study.json" in refused(of_reports.load, folder)


def test_a_camera_model_of_two_lines(tmp_path):
    _scenes.of_scannetpp("fisheye", tmp_path)
    file = tmp_path / "dslr" / "nerfstudio" / "transforms.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "camera_model": "MY\n\tOWN"}))
    scene = open_scene(str(tmp_path), _scenes.SETTINGS)
    assert scene.train.lens == "MY OWN"
    assert any("MY OWN" in note for note in scene.notes)


def test_a_colour_of_a_command_that_no_machine_holds(tmp_path):
    (tmp_path / "a.toml").write_text(f'[command.x]\ntrain = ["a"]\nbackground = [0, 0, 1{"0" * 400}]\n')
    assert "background" in refused(settings_file.load, tmp_path / "a.toml")


@pytest.mark.parametrize("place", ["~nobody-of-this-name/a", "~nobody\\u0000/a"])
def test_a_home_that_is_nobodys(tmp_path, place):
    (tmp_path / "a.toml").write_text(f'[scenes.a]\npath = "{place}"\n[data]\nroot = "~"\n')
    settings = settings_file.load(tmp_path / "a.toml")
    assert "home" in refused(settings.folder_of, settings.scenes["a"])


@pytest.mark.parametrize("at", [0, 2])
def test_a_line_of_times_that_has_commas_alone(tmp_path, at):
    _scenes.of_trajectory(tmp_path, True)
    times = tmp_path / "times.txt"
    rows = times.read_text().split("\n")
    times.write_text("\n".join([*rows[:at], ",", *rows[at:]]))

    def opened():
        return open_scene(
            str(tmp_path / "room0"), _scenes.SETTINGS, poses=str(tmp_path / "poses.txt"), times=str(times)
        )

    if at:
        assert "line 3" in refused(opened)
    else:
        assert opened().train.times is not None  # a heading


def test_test_views_whose_names_no_file_system_takes(tmp_path):
    _scenes.of_scannetpp("fisheye", tmp_path)
    file = tmp_path / "dslr" / "nerfstudio" / "transforms.json"
    table = json.loads(file.read_text())
    for frame in table["test_frames"]:
        frame["file_path"] = f"{'a' * 300}.JPG"
    file.write_text(json.dumps(table))
    lists = tmp_path / "dslr" / "train_test_lists.json"
    lists.write_text(json.dumps({**json.loads(lists.read_text()), "test": [f"{'a' * 300}.JPG"]}))
    assert not len(open_scene(str(tmp_path), _scenes.SETTINGS).test)


@pytest.mark.parametrize("place", ["", "package:"])
def test_settings_with_paths_that_no_file_system_takes(tmp_path, place):
    from viewbench.scenes.whereabouts import absence

    (tmp_path / "a.toml").write_text(f'[scenes.a]\npath = "{place}{"b" * 300}"\n[data]\nroot = "{tmp_path}"\n')
    settings = settings_file.load(tmp_path / "a.toml")
    assert "bbb" in (absence(["a"], settings) or "")
    assert "bbb" in refused(open_scene, "a", settings)


def test_a_trajectory_whose_name_no_file_system_takes(tmp_path):
    _scenes.of_trajectory(tmp_path, True)

    def opened():
        return open_scene(str(tmp_path / "room0"), _scenes.SETTINGS, poses=str(tmp_path / ("b" * 300)))

    assert "missing" in refused(opened)


@pytest.mark.parametrize("value", [1e300, 10**400, float("nan"), float("inf"), "x", None])
@pytest.mark.parametrize("key", ["began", "said", "pid", "running"])
def test_times_and_processes_of_runs_that_are_none(tmp_path, key, value):
    pytest.importorskip("jsonschema")
    from viewbench.workflow import _progress_file

    _records.of_progress(tmp_path)
    file = tmp_path / _progress_file.FILE
    record = json.loads(file.read_text())
    assert _progress_file.read(tmp_path) is not None
    record[key] = [{**record["running"][0], "since": value}] if key == "running" else value
    file.write_text(json.dumps(record))
    run = _progress_file.read(tmp_path)
    assert run is None or (key == "pid" and not run.alive)


@pytest.mark.parametrize("content", [b"[" * 4000, b'{"pid": 1' + b"0" * 40 + b"}", b'{"pid": Infinity}'])
def test_files_of_a_run_that_no_run_wrote(tmp_path, content):
    from viewbench.common import holding
    from viewbench.workflow import _alone

    (tmp_path / "held.json").write_bytes(content)
    with open(tmp_path / "held.json", "rb") as held:
        assert not _alone._lives(holding.read(held.fileno()).get("pid"))


RECORDS = [
    *[("selection", "indices", ["a"]), ("selection", "indices", 3), ("train", "curve", 0.5), ("train", "curve", [3])],
    *[("train", "curve", [{"step": {}}]), ("train", "gpu", "a"), ("metrics", "views", [{"name": "a"}])],
]


@pytest.mark.parametrize(("name", "key", "value"), RECORDS)
def test_records_of_cells_that_reports_cannot_use(tmp_path, name, key, value):
    from tests.reports.fixtures import make_study
    from viewbench.reports import _study as of_reports

    folder = make_study(tmp_path / "study", scenes=("room_human",), selectors=("random",), ratios=(0.1,), seeds=(0,))
    cell = of_reports.load(folder).done[0]
    record = cell.read(name)
    (cell.folder / f"{name}.json").write_text(json.dumps({**record, key: value}))
    assert key in refused(cell.read, name)


def test_a_point_too_far_away_for_the_files_of_others(tmp_path):
    from viewbench.scenes.ply import read_points, write_points

    points = _scenes.room(tmp_path / "room").points
    assert points is not None
    write_points(tmp_path / "a.ply", points)
    far = points.xyz.copy()
    far[3, 1] = -1e39
    assert "point 3" in refused(write_points, tmp_path / "b.ply", replace(points, xyz=far))
    assert len(read_points(tmp_path / "a.ply")) == len(points)
    assert not (tmp_path / "b.ply").exists()


def test_a_figure_whose_square_no_machine_holds():
    from viewbench.reports import _study as of_reports

    assert (of_reports._number("1e9"), of_reports._number("inf")) == (1e9, None)
    with pytest.raises(ValueError, match="no figure"):  # of which `read_cells` makes a sentence
        of_reports._number("1e300")
