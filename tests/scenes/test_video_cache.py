"""The bound on the pictures of videos that are kept: the oldest go, never those that somebody uses."""

import os
import subprocess
import sys

import pytest

from viewbench.common.settings import PACKAGE
from viewbench.scenes.formats import _video_cache

pytest.importorskip("fcntl")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(_video_cache, "_held", {})
    return tmp_path / "viewbench" / "video"


def fill(folder, age, size=600_000_000):
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "frame_000000.jpg", "wb") as file:
        file.truncate(size)  # a sparse file
    (folder / _video_cache.LOCK).touch()
    for path in (folder / _video_cache.LOCK, folder):
        os.utime(path, (1e9 - age, 1e9 - age))


def test_the_oldest_go_until_the_rest_fits(cache, capsys):
    for name, age in (("a", 30), ("b", 10), ("c", 20), ("d", 5)):
        fill(cache / name, age)
    _video_cache.trim(2)
    assert sorted(path.name for path in cache.iterdir()) == ["b", "c", "d"]
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "0.60 GB" in said[0]
    assert "'" + str(cache / "a") + "'" in said[0]
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["d"]


def test_use_makes_a_folder_young_and_holds_it(cache):
    for name, age in (("a", 30), ("b", 10)):
        fill(cache / name, age)
    assert _video_cache.hold("a") == cache / "a"
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["a"]
    fill(cache / "b", 10, 2_000_000_000)
    _video_cache.hold("b")
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["a", "b"]


def test_what_another_process_uses_stays_until_it_ends(cache):
    for name, age in (("a", 30), ("b", 10)):
        fill(cache / name, age)
    code = "from viewbench.scenes.formats import _video_cache as c; c.hold('a'); print('held', flush=True); input()"
    path = os.environ.get("PYTHONPATH", "") + os.pathsep + str(PACKAGE / ".editor")
    other = subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "held\n"
    os.utime(cache / "a" / _video_cache.LOCK, (1, 1))  # older again than the other
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["a"]
    fill(cache / "b", 10)
    os.utime(cache / "a" / _video_cache.LOCK, (1, 1))
    other.communicate("\n", timeout=60)
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["b"]


def test_folders_of_an_older_version_go_too(cache):
    fill(cache / "a", 30)
    (cache / "a" / _video_cache.LOCK).unlink()
    os.utime(cache / "a", (1, 1))
    fill(cache / "b", 10)
    _video_cache.trim(1)
    assert sorted(path.name for path in cache.iterdir()) == ["b"]
