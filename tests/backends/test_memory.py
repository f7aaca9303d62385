"""The memory of a training is that of all who took part in it."""

import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from tests.backends.conftest import nearest_command, settings_with
from viewbench.backends import _memory, _process, _train
from viewbench.backends._types import Budget, Job
from viewbench.common.errors import UserError
from viewbench.common.settings import load as load_settings
from viewbench.scenes.load import open_scene

MIB = 1 << 20
# A program whose child, not it, holds the memory; it ends a moment after the child has said that it has it.
PARENT = """
import subprocess, sys
child = "import sys, time; held = bytearray(b'x') * (300 << 20); time.sleep(0.6)"
subprocess.run([sys.executable, "-c", child], check=True)
"""


def test_children_of_a_program_count(tmp_path):
    with _memory.watched(os.getpid()) as own:
        time.sleep(0.15)
    usage = _process.run([sys.executable, "-c", PARENT], tmp_path, tmp_path / "log", "it")
    assert 300 * MIB < usage.rss_bytes < own.rss_bytes + 450 * MIB


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="getrusage is all there is elsewhere")
def test_the_peak_of_a_process_is_not_that_of_who_started_it(tmp_path):
    """getrusage's outlives exec: a program that a large one starts would begin with its peak."""
    code = "from viewbench.backends._memory import peak_rss_bytes; print(peak_rss_bytes())"
    large = (
        f"held = bytearray(b'x') * (400 << 20); import os, sys; os.execv(sys.executable, ['python', '-c', {code!r}])"
    )
    done = subprocess.run([sys.executable, "-c", large], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 200 * MIB


def test_the_record_of_a_training_has_it(small_room, tmp_path):
    scene = open_scene(str(small_room), load_settings())
    names = [scene.train.names[i] for i in (0, 4)]
    chosen = {"indices": [0, 4], "names": names, "n_views": len(scene.train), "selector": "random", "seed": 0}
    program = [sys.executable, "-c", PARENT + "\nopen('kept', 'w')\n", "{out}", "{iterations}"]
    settings = settings_with(large=nearest_command(train=program))
    job = Job("command:large", 0, Budget(3), 48)
    record = _train.train(scene, chosen, job, tmp_path, settings=settings)
    assert record["peak_rss_bytes"] > 300 * MIB
    assert record["peak_gpu_bytes"] is None


@pytest.fixture
def fake_gpu(tmp_path, monkeypatch):
    """An nvidia-smi on PATH that answers what a file says."""
    answers = tmp_path / "answers"
    tool = tmp_path / "bin" / "nvidia-smi"
    tool.parent.mkdir()
    tool.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\ncat {answers}\n')
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tool.parent}{os.pathsep}{os.environ['PATH']}")
    return answers


def test_gpu_memory_is_that_of_the_program_and_its_children(fake_gpu, tmp_path, monkeypatch):
    monkeypatch.setattr(_memory, "GPU_EVERY_S", 0.1)
    code = f"import os, time; open({str(fake_gpu)!r}, 'w').write(f'{{os.getpid()}}, 2048\\n1, 999\\n'); time.sleep(0.7)"
    fake_gpu.write_text("")
    usage = _process.run([sys.executable, "-c", code], tmp_path, tmp_path / "log", "it")
    assert usage.gpu_bytes == 2048 * MIB
    assert "--query-compute-apps=pid,used_memory" in (tmp_path / "asked").read_text()


@pytest.mark.parametrize(
    "answer", ["No devices were found\n", "[N/A], [N/A]\n", "12, [Not Supported]\n", "99, 2048\n", ""]
)
def test_a_gpu_that_says_nothing_of_use_is_none(fake_gpu, answer):
    fake_gpu.write_text(answer)
    assert _memory.gpu_bytes({12}) is None


def test_a_slow_answer_holds_nobody_up(fake_gpu, tmp_path):
    answered = tmp_path / "answered"
    (tmp_path / "bin" / "nvidia-smi").write_text(f"#!/bin/sh\nsleep 8\ntouch {answered}\n")
    _process.run([sys.executable, "-c", "pass"], tmp_path, tmp_path / "log", "it")
    with pytest.raises(UserError, match=r"stopped after 0\.3 s"):
        _process.run([sys.executable, "-c", "import time; time.sleep(30)"], tmp_path, tmp_path / "log", "it", 0.3)
    assert not answered.exists()


def test_no_gpu_is_none(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert _memory.gpu_bytes({1}) is None


def test_watching_ends_with_the_body():
    before = set(threading.enumerate())  # one that waits for an answer may be left of another test
    with _memory.watched(os.getpid()) as usage:
        held = np.ones(40 * MIB, np.uint8)
        time.sleep(0.5)
    time.sleep(0.5)
    assert usage.rss_bytes > held.nbytes
    assert not {thread for thread in threading.enumerate() if thread.name == _memory.WATCHER} - before
