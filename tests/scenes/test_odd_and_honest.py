"""What is odd but honest is read: phones, tools and users write it, and the bounds against harm do not mean it."""

import io
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE
from viewbench.reports import _tracking_errors
from viewbench.scenes.image_files import check_picture, check_whole, image_size
from viewbench.scenes.ply import read_points

PICTURE = np.random.default_rng(3).integers(0, 256, (24, 32, 3), dtype=np.uint8)


def saved(path, kind, **options):
    with open(path, "wb") as file:
        Image.fromarray(PICTURE).save(file, kind, **options)
    return path


def test_a_motion_photo_has_a_video_behind_its_picture(tmp_path):
    path = saved(tmp_path / "a.jpg", "JPEG", progressive=True)
    video = np.random.default_rng(0).integers(0, 256, 12_000_000, dtype=np.uint8).tobytes()
    path.write_bytes(path.read_bytes() + video)
    assert video.count(b"\xff\xda") > 100
    check_whole(path)


def test_a_picture_with_too_many_scans_still_is_refused(tmp_path):
    content = saved(tmp_path / "a.jpg", "JPEG", progressive=True).read_bytes()
    start, end = content.rindex(b"\xff\xda"), content.rindex(b"\xff\xd9")
    path = tmp_path / "b.jpg"
    path.write_bytes(content[:end] + 200 * content[start:end] + content[end:])
    with pytest.raises(UserError, match="scans"):
        check_whole(path)


@pytest.mark.parametrize(("kind", "name"), [("AVIF", "a.jpg"), ("TGA", "a.tga"), ("MPO", "a.jpg"), ("WEBP", "a.png")])
def test_pictures_by_content_or_name(tmp_path, kind, name):
    assert image_size(saved(tmp_path / name, kind)) == (32, 24)


def test_heic_by_another_name(tmp_path):
    pillow_heif = pytest.importorskip("pillow_heif")
    pillow_heif.register_heif_opener()
    path = tmp_path / "a.jpg"
    buffer = io.BytesIO()
    Image.fromarray(np.repeat(np.repeat(PICTURE, 4, 0), 4, 1)).save(buffer, "HEIF")
    path.write_bytes(buffer.getvalue())
    assert image_size(path) == (128, 96)


def test_depth_of_any_kind_that_lies_in_the_capture(tmp_path):
    (tmp_path / "depth.npy.gz").write_bytes(b"\x1f\x8b whatever")
    check_picture(tmp_path / "depth.npy.gz")


def test_depth_behind_a_link(tmp_path):
    np.savez(tmp_path / "depth.npz", np.zeros((2, 2)))
    (tmp_path / "colmap.bin").write_bytes(b"64&48&1&" + bytes(64 * 48 * 4))
    saved(tmp_path / "a.tga", "TGA")
    inside = tmp_path / "capture"
    inside.mkdir()
    for name in ("depth.npz", "colmap.bin", "a.tga"):
        (inside / name).symlink_to(f"../{name}")
        check_picture(inside / name)


@pytest.mark.parametrize("name", ["key", "key.tga", "key.npz"])
def test_a_secret_behind_a_link(tmp_path, name):
    (tmp_path / "id_rsa").write_text("-----BEGIN OPENSSH PRIVATE KEY-----\nabc\n")
    (tmp_path / name).symlink_to("id_rsa")
    with pytest.raises(UserError):
        check_picture(tmp_path / name)


def test_points_behind_another_element(tmp_path):
    head = "ply\nformat ascii 1.0\nelement camera 2\nproperty float focal\nproperty list uchar int seen\n"
    head += "element vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "1.5 2 0 1\n1.5 0\n1 2 3\n4 5 6\n")
    assert read_points(tmp_path / "a.ply").xyz.tolist() == [[1, 2, 3], [4, 5, 6]]


def viewbench(*arguments, cwd, **variables):
    command = [sys.executable, "-P", "-m", "viewbench", *map(str, arguments)]
    environment = {**os.environ, **variables}
    environment.pop("VIEWBENCH_ENVIRONMENT", None) if "VIEWBENCH_ENVIRONMENT" not in variables else None
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)


def test_settings_beside_a_video_are_one_s_own(tmp_path):
    pytest.importorskip("av")
    from tests.scenes.hostile import clip

    (tmp_path / "environment.toml").write_text("[compute]\nthreads = 1\n")
    clip(tmp_path / "walk.mp4")
    done = viewbench("info", "walk.mp4", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_settings_in_a_capture_that_are_named_are_taken(small_room, tmp_path):
    capture = shutil.copytree(small_room, tmp_path / "capture")
    (capture / "environment.toml").write_text("[compute]\nthreads = 1\n")
    done = viewbench("info", ".", cwd=capture)
    assert done.returncode == 2
    assert "VIEWBENCH_ENVIRONMENT=environment.toml" in done.stderr
    done = viewbench("info", ".", cwd=capture, VIEWBENCH_ENVIRONMENT="environment.toml")
    assert done.returncode == 0, done.stderr


def test_a_clone_s_own_settings(tmp_path, run_viewbench):
    done = viewbench("info", ".", cwd=PACKAGE)
    assert "may have come with it" not in done.stderr


def test_a_byte_order_mark_before_transforms(small_room, tmp_path):
    capture = shutil.copytree(small_room, tmp_path / "capture")
    file = capture / "transforms_train.json"
    file.write_text("\ufeff" + json.dumps(json.loads(file.read_text())), encoding="utf-8")
    done = viewbench("info", capture, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("closed", ["1", "2"])
def test_closed_streams(small_room, tmp_path, closed):
    command = f'exec "{sys.executable}" -P -m viewbench info "$1" {closed}>&-'
    done = subprocess.run(
        ["sh", "-c", command, "sh", str(tmp_path / "nothing")], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("password", ["secret/pw", "sec@ret", "plain"])
def test_passwords_of_addresses_are_masked(password):
    uri = f"postgresql://user:{password}@127.0.0.1:9/runs"
    text = f"could not reach {uri}: no password '{password}'"
    masked = _tracking_errors.masked(text, uri)
    assert password not in masked
    assert "127.0.0.1:9/runs" in masked
