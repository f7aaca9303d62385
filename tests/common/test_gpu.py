"""One GPU a job, with devices that do not exist: nvidia-smi is a script that answers what a file says."""

import fcntl
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import known
from viewbench.common import gpu
from viewbench.common.errors import UserError

JOB = """
import os, sys, time
from pathlib import Path
from tests.conftest import known
from viewbench.common import gpu
from viewbench.common.errors import UserError
lease = gpu.hold(sys.argv[3] if len(sys.argv) > 3 else "cuda")
name = os.environ["CUDA_VISIBLE_DEVICES"]
Path(sys.argv[1], f"{sys.argv[2]}.start").write_text(f"{name} {time.monotonic()}")
while not Path(sys.argv[1], f"{sys.argv[2]}.go").exists():
    time.sleep(0.01)
Path(sys.argv[1], f"{sys.argv[2]}.end").write_text(f"{time.monotonic()}")
print(lease.record())
"""


@pytest.fixture
def two(tmp_path, monkeypatch):
    """A machine with two devices, and locks of its own."""
    tool = tmp_path / "bin" / "nvidia-smi"
    tool.parent.mkdir()
    tool.write_text(
        '#!/bin/sh\ncase "$1" in *index,uuid*) printf "0, GPU-aa\\n1, GPU-bb\\n";; '
        f"*compute-apps*) cat {tmp_path}/apps;; esac\n"
    )
    tool.chmod(0o755)
    (tmp_path / "apps").write_text("")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("PATH", f"{tool.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    return tmp_path


def start(place: Path, name: str, wanted: str = "cuda", **variables: str) -> subprocess.Popen:
    command = [sys.executable, "-c", JOB, str(place), name, wanted]
    return subprocess.Popen(
        command, env={**os.environ, **variables}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def appears(path: Path, seconds: float = 20) -> str:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if path.exists() and (text := path.read_text()):
            return text
        time.sleep(0.01)
    raise AssertionError(f"{path.name} did not appear")


def test_three_jobs_on_two_devices(two):
    jobs = {name: start(two, name) for name in "ab"}
    taken = {name: appears(two / f"{name}.start").split()[0] for name in "ab"}
    assert set(taken.values()) == {"GPU-aa", "GPU-bb"}, "side by side they get different devices"
    jobs["c"] = start(two, "c")
    assert "waiting for a GPU (2 in use by other jobs)" in known(jobs["c"].stderr).readline()
    assert not (two / "c.start").exists()
    (two / "b.go").touch()
    device, began = appears(two / "c.start").split()
    assert device == taken["b"]
    assert float(began) > float(appears(two / "b.end"))
    for name in "ac":
        (two / f"{name}.go").touch()
    said = {name: jobs[name].communicate(timeout=20)[0] for name in jobs}
    waited = {name: float(text.split("'waited_s': ")[1].split(",")[0]) for name, text in said.items()}
    assert waited["c"] > max(waited["a"], waited["b"])


def test_a_job_that_is_killed_gives_its_device_back(two):
    first = start(two, "a", CUDA_VISIBLE_DEVICES="1")
    appears(two / "a.start")
    second = start(two, "b", CUDA_VISIBLE_DEVICES="1")
    assert "waiting" in known(second.stderr).readline()
    first.send_signal(signal.SIGKILL)
    assert appears(two / "b.start").split()[0] == "1"
    (two / "b.go").touch()
    assert second.wait(20) == 0
    first.communicate()


def test_one_device_has_one_lock_by_whichever_name(two):
    first = start(two, "a", CUDA_VISIBLE_DEVICES="GPU-bb")
    assert appears(two / "a.start").split()[0] == "GPU-bb"
    second = start(two, "b")
    assert appears(two / "b.start").split()[0] == "GPU-aa"
    third = start(two, "c", CUDA_VISIBLE_DEVICES="1")
    assert "waiting" in known(third.stderr).readline()
    for name in "abc":
        (two / f"{name}.go").touch()
    assert [job.wait(20) for job in (first, second, third)] == [0, 0, 0]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (None, ["GPU-aa", "GPU-bb"]),
        ("1", ["1"]),
        ("", []),
        ("-1", []),
        ("1,-1,0", ["1"]),
        ("0,0", ["0"]),
        ("NoDevFiles", []),
        ("0,x,1", ["0"]),
        ("GPU-bb, 0", ["GPU-bb", "0"]),
    ],
)
def test_devices_given_from_outside_are_respected(two, monkeypatch, given, expected):
    if given is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", given)
    assert gpu.devices() == expected


def test_a_device_that_is_named_is_the_one(two):
    job = start(two, "a", "cuda:1")
    assert appears(two / "a.start").split()[0] == "GPU-bb"
    (two / "a.go").touch()
    assert job.wait(20) == 0


@pytest.mark.parametrize(("apps", "shared"), [("", "False"), ("GPU-aa, 7\n", "True"), ("GPU-bb, 7\n", "False")])
def test_a_device_that_others_use_is_said_to_be_shared(two, apps, shared):
    (two / "apps").write_text(apps)
    job = start(two, "a")
    appears(two / "a.start")
    (two / "a.go").touch()
    assert f"'shared': {shared}" in job.communicate(timeout=20)[0]


def test_a_device_that_is_not_there_is_refused(two, monkeypatch):
    monkeypatch.setattr(gpu, "_held", None)
    with pytest.raises(UserError, match="device is 'cuda:5', and there are 2 devices"):
        gpu.hold("cuda:5")


def test_a_file_system_without_locks_keeps_nobody_from_a_device(two, monkeypatch):
    def refuse(file, how):
        raise OSError(9, "Bad file descriptor")

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert gpu._lock("GPU-aa") == -1


def test_a_program_that_came_later_is_seen(two):
    job = start(two, "a")
    appears(two / "a.start")
    (two / "apps").write_text("GPU-aa, 7\n")
    (two / "a.go").touch()
    assert "'shared': True" in job.communicate(timeout=20)[0]


def test_no_device_is_none(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    monkeypatch.setattr(gpu, "_held", None)
    assert gpu.devices() == []
    assert gpu.hold() is None
    assert gpu.hold("cpu") is None
