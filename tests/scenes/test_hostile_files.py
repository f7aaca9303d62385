"""One by one: files that are none, claims of heads, folders that others left, and what a name may do."""

import io
import json
import os
import socket
import sys
import zipfile

import numpy as np
import plyfile
import pytest

from viewbench.backends._evaluate import altered_file
from viewbench.backends._train import _replace_model, _work_folder
from viewbench.common import bounded, gpu, limits
from viewbench.common.errors import UserError, printable
from viewbench.common.files import read_json, sha256_file
from viewbench.common.terminal import Shown, guarded
from viewbench.scenes._ply_table import vertices
from viewbench.scenes.download.unpack import members
from viewbench.scenes.image_files import check_picture
from viewbench.scenes.ply import read_points

KINDS = [("x", "f4"), ("y", "f8"), ("z", "f4"), ("red", "u1"), ("many", "i4"), ("few", "u2")]


@pytest.mark.parametrize(("text", "order"), [(False, "<"), (False, ">"), (True, "=")])
def test_vertices_are_those_that_plyfile_reads(tmp_path, text, order):
    random = np.random.default_rng(0)
    table = np.zeros(200, KINDS)
    for name, kind in KINDS:
        numbers = random.normal(size=200) * 1e3 if kind[0] == "f" else random.integers(0, 200, 200)
        table[name] = numbers.astype(kind)
    faces = np.zeros(3, [("vertex_indices", "i4", (3,))])
    parts = [plyfile.PlyElement.describe(table, "vertex"), plyfile.PlyElement.describe(faces, "face")]
    file = tmp_path / "a.ply"
    plyfile.PlyData(parts, text=text, byte_order=order, comments=["of a scanner"]).write(str(file))
    found, expected = vertices(file), plyfile.PlyData.read(str(file))["vertex"].data
    for name, _ in KINDS:
        assert (found[name] == expected[name]).all()


@pytest.mark.parametrize("before", [False, True])
def test_another_element_before_the_vertices(tmp_path, before):
    cameras = np.zeros(2, [("focal", "f4"), ("k", "u1")])
    table = np.arange(6, dtype="f4").view([("x", "f4"), ("y", "f4"), ("z", "f4")])
    parts = [plyfile.PlyElement.describe(cameras, "camera"), plyfile.PlyElement.describe(table, "vertex")]
    file = tmp_path / "a.ply"
    plyfile.PlyData(parts if before else parts[::-1], byte_order="<").write(str(file))
    assert read_points(file).xyz.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_a_file_grows_beyond_what_it_says(tmp_path, monkeypatch):
    """Files of /proc have zero bytes, whatever is in them."""
    assert bounded.data("/proc/self/status", "file", 1 << 20).startswith(b"Name:")
    with pytest.raises(UserError, match="more than 10 bytes"):
        bounded.data("/proc/self/status", "file", 10)
    (tmp_path / "a.json").write_text("[1, 2]")
    monkeypatch.setattr(limits, "JSON_BYTES", 5)
    with pytest.raises(UserError, match="6 bytes, at most 5 bytes"):
        read_json(tmp_path / "a.json")


def test_what_is_no_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(tmp_path / "socket"))
    for place in (tmp_path / "pipe", tmp_path / "socket", tmp_path, "/dev/zero", "/dev/tty"):
        for reader in (bounded.checked, sha256_file, bounded.array):
            with pytest.raises(OSError):
                reader(place)
        with pytest.raises(UserError):
            read_json(place)
    server.close()


def test_a_link_s_content_is_not_quoted(tmp_path):
    (tmp_path / "secret").write_text("s3cret")
    (tmp_path / "capture").mkdir()
    (tmp_path / "capture/rgb.txt").symlink_to("../secret")
    (tmp_path / "linked").symlink_to("capture")
    (tmp_path / "capture/own.txt").write_text("own")
    assert "s3cret" not in bounded.quoted(tmp_path / "capture/rgb.txt", "s3cret")
    assert "own" not in bounded.quoted(tmp_path / "linked/own.txt", "own")
    assert bounded.quoted(tmp_path / "capture/own.txt", "own") == "'own'"


@pytest.mark.parametrize("listed", [[".."], [""], ["."], ["../precious"], ["/etc"], [7, None], ["old.ply", ".."]])
def test_a_model_replaces_its_own_files_alone(tmp_path, listed):
    """The list of files that an earlier training left may have come with the folder."""
    out, model = tmp_path / "models/mine", tmp_path / "new"
    out.mkdir(parents=True)
    model.mkdir()
    (tmp_path / "models/precious").write_text("kept")
    (out / "notes.txt").write_text("kept")
    (out / "old.ply").write_text("")
    (out / ".files.json").write_text(json.dumps(listed))
    (model / "model.ply").write_text("new")
    _replace_model(model, out)
    assert (tmp_path / "models/precious").read_text() == (out / "notes.txt").read_text() == "kept"
    assert (out / "model.ply").read_text() == "new"
    assert (out / "old.ply").exists() == ("old.ply" not in listed)


def test_a_training_does_not_go_on_through_a_link(tmp_path):
    asked = {"a": 1}
    (tmp_path / "out/.training").mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/.part-1").write_text("kept")
    (tmp_path / "out/.training/asked.json").write_text(json.dumps(asked))
    (tmp_path / "out/.training/model").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UserError, match="through a link"):
        _work_folder(tmp_path / "out", asked, resumes=True)
    assert (tmp_path / "elsewhere/.part-1").exists()


def test_a_model_s_files_are_in_its_folder(tmp_path):
    (tmp_path / "secret").write_text("")
    model = tmp_path / "model"
    model.mkdir()
    (model / "link").symlink_to(tmp_path / "secret")
    (model / "own").write_text("")
    sha256 = sha256_file(tmp_path / "secret")
    assert altered_file(model, {"files": {"own": sha256}}) is None
    for name in ("../secret", str(tmp_path / "secret"), "link"):
        assert altered_file(model, {"files": {"own": sha256, name: sha256}}) == name


def test_locks_of_another_user_lead_nowhere(tmp_path, monkeypatch):
    """/tmp is everybody's: the folder of locks, or a lock in it, may be a link to one of ours."""
    monkeypatch.setattr(gpu.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    home = tmp_path / "home"
    home.mkdir(mode=0o700)
    (tmp_path / "tmp" / gpu.FOLDER).symlink_to(home)
    (home / "GPU-uuid").symlink_to(tmp_path / "precious")
    (tmp_path / "precious").write_text("kept")
    (tmp_path / "precious").chmod(0o600)
    assert gpu._lock("GPU-uuid") == -1
    assert home.stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "precious").stat().st_mode & 0o777 == 0o600
    held = gpu._lock("another")
    assert held is not None
    assert gpu._lock("another") is None
    os.close(held)


@pytest.mark.parametrize("order", ["\x1b[31m", "\x9b31m", "\x07", "\u202e", "\x7f", "\x00"])
def test_a_terminal_is_given_no_orders(order, capsys):
    shown = io.StringIO()
    Shown(shown).write(f"a{order}b\n")
    assert shown.getvalue() == f"a{printable(order)}b\n"
    assert order not in shown.getvalue()
    before = sys.stderr
    with guarded():
        print(f"{order}é\r", file=sys.stderr)
    assert sys.stderr is before
    assert capsys.readouterr().err == f"{printable(order)}é\r\n"
    assert order not in str(UserError(f"frame '{order}'"))


def test_a_sentence_has_an_end():
    text = str(UserError("a" * 100_000 + "\nb"))
    assert len(text) < 4100
    assert text.endswith("a b")


def test_an_archive_becomes_a_few_times_as_large(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "EXPANSION_FREE", 1 << 20)
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene/zeros", bytes(1 << 23))
        archive.writestr("fine/zeros", bytes(1 << 19))
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert list(members(archive, "fine/", (), "a")) == ["zeros"]
        with pytest.raises(UserError, match=r"would become 8\.39 MB"):
            members(archive, "scene/", (), "a")


def test_what_is_copied_is_a_picture(tmp_path):
    from PIL import Image

    for suffix in ("png", "jpg", "webp", "tif", "bmp", "gif", "ppm", "jp2"):
        Image.new("RGB", (8, 8)).save(tmp_path / f"a.{suffix}")
        check_picture(tmp_path / f"a.{suffix}")
    np.save(tmp_path / "a.npy", np.zeros(3))
    check_picture(tmp_path / "a.npy")
    for content in (b"", b"-----BEGIN OPENSSH PRIVATE KEY-----", b"root:x:0:0", b"{}"):
        (tmp_path / "secret").write_bytes(content)
        (tmp_path / "a.png").unlink()
        (tmp_path / "a.png").symlink_to("secret")
        with pytest.raises(UserError, match="no picture"):
            check_picture(tmp_path / "a.png")
