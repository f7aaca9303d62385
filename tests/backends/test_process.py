"""External programs: their errors in one line, and nothing of them left when the caller is gone."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from viewbench.backends import _process
from viewbench.common.errors import UserError

SLEEPERS = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
print(child.pid, flush=True)
time.sleep(60)
"""


def alive(pid: int) -> bool:
    """Whether the process runs; one that waits to be reaped does not."""
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"


def gone(pid: int) -> bool:
    for _ in range(100):
        if not alive(pid):
            return True
        time.sleep(0.05)
    return False


def test_what_it_prints_is_in_the_log(tmp_path):
    code = "import sys; print('out'); print('err', file=sys.stderr)"
    _process.run([sys.executable, "-c", code], tmp_path, tmp_path / "log", "tool")
    assert sorted((tmp_path / "log").read_text().split()) == ["err", "out"]


def test_words_are_arguments_and_never_a_shell_s(tmp_path):
    nasty = "$(touch gone); `touch gone` | touch gone && 'touch gone' *"
    _process.run([sys.executable, "-c", "import sys; print(sys.argv[1])", nasty], tmp_path, tmp_path / "log", "tool")
    assert (tmp_path / "log").read_text().strip() == nasty
    assert not (tmp_path / "gone").exists()


def test_a_failure_says_the_status_and_the_last_line(tmp_path):
    code = "print('first'); print('no such scene\\n'); raise SystemExit(3)"
    with pytest.raises(UserError, match="tool failed with exit status 3: no such scene"):
        _process.run([sys.executable, "-c", code], tmp_path, tmp_path / "log", "tool")


def test_a_crash_is_named_by_its_signal(tmp_path):
    code = "import os; os.kill(os.getpid(), 11)"
    with pytest.raises(UserError, match="SIGSEGV: it printed nothing"):
        _process.run([sys.executable, "-c", code], tmp_path, tmp_path / "log", "tool")


def test_a_program_that_is_not_there_is_said_to_be_so(tmp_path):
    with pytest.raises(UserError, match="'no-such-trainer' cannot be run: No such file"):
        _process.run(["no-such-trainer"], tmp_path, tmp_path / "log", "tool")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at /proc")
def test_time_out_takes_the_whole_group(tmp_path):
    with pytest.raises(UserError, match=r"stopped after 1\.5 s"):
        _process.run([sys.executable, "-c", SLEEPERS], tmp_path, tmp_path / "log", "tool", timeout_s=1.5)
    assert gone(int((tmp_path / "log").read_text()))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux tells children that their parent died")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_the_program_does_not_outlive_its_caller(tmp_path, number):
    code = (
        "import signal, sys; from pathlib import Path; from viewbench.backends import _process\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell ignores it in what it runs behind itself
        "inner = 'import os, time; print(os.getpid(), flush=True); time.sleep(60)'\n"
        f"_process.run([sys.executable, '-c', inner], Path({str(tmp_path)!r}), Path({str(tmp_path)!r}) / 'log', 'x')\n"
    )
    caller = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    log = tmp_path / "log"
    for _ in range(200):
        if log.exists() and log.read_text().strip():
            break
        time.sleep(0.05)
    os.kill(caller.pid, number)
    caller.wait(10)
    assert gone(int(log.read_text()))
