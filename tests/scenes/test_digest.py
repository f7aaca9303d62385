"""One hash for what a scene is, wherever it lies."""

import json
import os
import shutil
import time

import pytest

from viewbench.common.settings import load as load_settings
from viewbench.scenes import digest
from viewbench.scenes.digest import scene_sha256
from viewbench.scenes.load import open_scene


def hashed(folder, **options):
    return scene_sha256(open_scene(str(folder), load_settings(), **options))


@pytest.fixture
def room(small_room, tmp_path):
    shutil.copytree(small_room, tmp_path / "room")
    return tmp_path / "room"


def test_the_folder_and_the_times_do_not_matter(small_room, room, tmp_path):
    for path in room.rglob("*"):
        os.utime(path, (1, 1))
    assert hashed(room) == hashed(small_room)


@pytest.mark.parametrize("file", ["transforms_train.json", "transforms_test.json", "points3d.ply", "image"])
def test_any_byte_matters(room, file):
    before = hashed(room)
    path = sorted((room / "test").iterdir())[0] if file == "image" else room / file
    data = path.read_bytes()
    path.write_bytes(data + b"\n" if path.suffix == ".json" else data[:-1] + bytes([data[-1] ^ 1]))
    assert hashed(room) != before


def test_the_test_split_matters(room):
    (room / "transforms_test.json").unlink()
    rules = ["none", "every:3", "every:4", "blocks:3"]
    assert len({hashed(room, holdout=rule) for rule in rules}) == len(rules)


def test_hashes_of_large_scenes_are_kept_and_renewed(room, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(digest, "REMEMBERED_BYTES", 0)
    monkeypatch.setattr(digest, "SETTLED_S", 0.05)
    read = []
    real = digest.sha256_file
    monkeypatch.setattr(digest, "sha256_file", lambda path: read.append(path.name) or real(path))
    time.sleep(0.1)
    first = hashed(room)
    assert len(read) == 12 + 4 + 3
    read.clear()
    assert (hashed(room), read) == (first, [])
    image = sorted((room / "train").iterdir())[0]
    stamp = image.stat()
    data = image.read_bytes()
    image.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    os.utime(image, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # as a tool that keeps times leaves it
    time.sleep(0.1)
    second = hashed(room)
    assert (second != first, read) == (True, [image.name])
    (cache,) = (tmp_path / "cache" / "viewbench" / "digests").iterdir()
    old = cache.with_name("old.json")
    old.write_text("{}")
    os.utime(old, (1, 1))
    for damaged in ("{", "[]", json.dumps({"x": 1})):
        cache.write_text(damaged)
        assert hashed(room) == second
    assert not old.exists()


def test_a_file_that_has_just_changed_is_not_kept(room, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(digest, "REMEMBERED_BYTES", 0)
    hashed(room)
    files = list((tmp_path / "cache").rglob("*.json"))
    assert not files or json.loads(files[0].read_text()) == {}


def test_a_home_that_cannot_be_written_to_costs_time_only(room, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
    monkeypatch.setattr(digest, "REMEMBERED_BYTES", 0)
    monkeypatch.setattr(digest, "SETTLED_S", -10)
    assert hashed(room) == hashed(room)


def test_a_missing_picture_has_a_hash_of_its_own(room):
    before = hashed(room)
    victim = next((room / "train").glob("*.jpg"))
    content = victim.read_bytes()
    victim.unlink()
    gone = hashed(room)
    assert gone != before
    victim.write_bytes(content)
    assert hashed(room) == before
