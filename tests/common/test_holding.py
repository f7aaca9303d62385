"""Who writes what: one process a folder, and temporary files that go when their writer is dead and not before."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from viewbench.common import holding
from viewbench.common.errors import UserError
from viewbench.common.files import whole

pytestmark = pytest.mark.skipif(holding.fcntl is None, reason="this system has no flock")
DAY_S = 86400


def child(code: str, folder: Path) -> subprocess.Popen:
    """A process that runs the code in the folder, and has said a line when this returns."""
    process = subprocess.Popen([sys.executable, "-c", code], cwd=folder, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    return process


def kill(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)


WRITES = """
import time
from pathlib import Path
from viewbench.common.files import whole, whole_folder
with whole("a.json"), whole_folder("b"):
    print("there", flush=True)
    time.sleep(600)
"""
HOLDS = """
import time
from pathlib import Path
from viewbench.common.holding import alone
with alone(Path("cell")):
    print("there", flush=True)
    time.sleep({seconds})
"""


def aged(path: Path, seconds: float) -> Path:
    date = time.time() - seconds
    os.utime(path, (date, date))
    return path


def test_temporary_files_go_with_their_writer(tmp_path):
    writer = child(WRITES, tmp_path)
    for path in tmp_path.iterdir():
        aged(path, 2 * DAY_S)  # however old: who writes it lives
    assert holding.sweep(tmp_path) == []
    kill(writer)
    left = sorted(tmp_path.iterdir())
    assert len(left) == 2
    assert sorted(holding.sweep(tmp_path)) == left
    assert list(tmp_path.iterdir()) == []


def test_what_may_still_be_written_stays(tmp_path):
    with whole(tmp_path / "a.json") as temporary:
        assert holding.sweep(tmp_path) == []
        temporary.write_text("{}")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    young = tmp_path / f"{holding.prefix()}young.json"  # it may have its name and not its lock
    young.touch()
    other = tmp_path / f"{holding.TEMPORARY}another-1.json"
    other.touch()
    aged(other, DAY_S / 2)
    assert holding.sweep(tmp_path) == [], "another machine's, half a day old"
    aged(young, 10)
    aged(other, 2 * DAY_S)
    assert sorted(holding.sweep(tmp_path)) == sorted([young, other])


def test_one_process_writes_a_folder(tmp_path):
    writer = child(HOLDS.format(seconds=600), tmp_path)
    words = f"is being written by process {writer.pid} on .*run this again"
    with pytest.raises(UserError, match=words), holding.alone(tmp_path / "cell", patience_s=0.5):
        raise AssertionError("two at once")
    kill(writer)
    with holding.alone(tmp_path / "cell", patience_s=0.5):
        assert [path.name for path in (tmp_path / "cell").iterdir()] == [holding.WRITER]
    assert list((tmp_path / "cell").iterdir()) == []


def test_who_is_ending_is_waited_for(tmp_path):
    writer = child(HOLDS.format(seconds=1.5), tmp_path)
    with holding.alone(tmp_path / "cell"):
        assert writer.wait(60) == 0


def test_many_take_turns(tmp_path):
    """Each adds one to a number that it reads first; names that are removed and made anew let none in between."""
    code = """
from pathlib import Path
from viewbench.common.holding import alone
print("there", flush=True)
for _ in range(20):
    with alone(Path("cell"), 120):
        count = Path("count")
        count.write_text(str(int(count.read_text() or 0) + 1) if count.exists() else "1")
"""
    for process in [child(code, tmp_path) for _ in range(3)]:
        assert process.wait(120) == 0
    assert (tmp_path / "count").read_text() == "60"


def test_a_writer_that_was_killed_leaves_nothing_for_good(tmp_path):
    kill(child(HOLDS.format(seconds=600), tmp_path))
    assert holding.sweep(tmp_path) == []  # young
    aged(tmp_path / "cell" / holding.WRITER, 10)
    assert holding.sweep(tmp_path) == [tmp_path / "cell" / holding.WRITER]


def test_a_record_says_where_its_process_would_be_seen():
    here = holding.me()
    assert holding.reaches(here)
    assert holding.reaches({**here, "boot": "before"}), "this machine, before it was started anew"
    assert holding.reaches({**here, "host": "c0ffee"}), "a container on it"
    assert not holding.reaches({**here, "boot": "x", "host": "other"})
    assert not holding.reaches({**here, "boot": "x", "machine": "other"})
    assert "process" in holding.named({})
