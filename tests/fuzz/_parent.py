"""Runs workers, each in a process of its own, and finds the inputs that end or stop one."""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from unittest import mock

from tests.fuzz._reader import Input, Reader, changes, lay_out
from tests.fuzz._worker import Board, Finding, mind_warnings, save, valid_capture, work

LIMIT_S = 40.0  # of CPU for one input, which is read up to five times; or waiting for so many times that
WAITS = 12
SHORT = Path("/dev/shm") if Path("/dev/shm").is_dir() else Path(tempfile.gettempdir())


@dataclass
class Tally:
    """What came of the inputs of one reader."""

    name: str
    inputs: int = 0
    opened: int = 0
    refused: int = 0
    died: int = 0
    cpu_s: float = 0.0
    most_s: float = 0.0
    findings: list[Path] = field(default_factory=list)

    def row(self) -> list[str]:
        """Reader, inputs, inputs a second of CPU, refused and opened in percent, the longest in s, findings."""
        n = max(1, self.inputs)
        rate = self.inputs / self.cpu_s if self.cpu_s else 0.0
        share = [f"{100 * self.refused / n:.1f}", f"{100 * self.opened / n:.1f}"]
        return [self.name, str(self.inputs), f"{rate:.0f}", *share, f"{self.most_s:.2f}", str(len(self.findings))]


@dataclass
class _Running:
    pid: int
    left: range
    home: Path
    board: Board
    killed: bool = False
    seen: int = -1  # the input that it was at when it was last looked at
    cpu_s: float = 0.0  # and what it had used then


class Runner:
    """One reader's inputs, with the valid capture made once."""

    def __init__(self, reader: Reader, seed: int, out: Path, jobs: int):
        self.reader, self.seed, self.out, self.jobs = reader, seed, out, jobs
        self.home = Path(tempfile.mkdtemp(prefix=f"viewbench-fuzz-{reader.name}-", dir=SHORT))
        self.tally, self.broken = Tally(reader.name), ""
        mind_warnings()
        try:
            self.valid = valid_capture(reader, self.home / "made")
            self._warm()
        except BaseException:
            shutil.rmtree(self.home)
            raise

    def __enter__(self) -> "Runner":
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self.home, ignore_errors=True)

    def _warm(self) -> None:
        """Opens the valid capture here, so that workers have what it imports; it raises where that is not valid."""
        lay_out(self.home / "warm" / "capture", self.valid)
        with mock.patch.dict(os.environ, {"XDG_CACHE_HOME": str(self.home / "warm" / "cache")}):
            (self.home / "warm" / "cache").mkdir()
            each = [(name,) for name in self.valid] if self.reader.whole else [()] * 3
            for number, named in enumerate(each):
                spare = self.home / "warm" / "spare"
                self.reader.use(Input(self.home / "warm" / "capture", named, Random(number), spare))
                shutil.rmtree(spare, ignore_errors=True)
        shutil.rmtree(self.home / "warm")

    def run(self, first: int, count: int) -> Tally:
        """Puts inputs `first` to `first + count - 1` through the reader, shared by the workers."""
        running = [
            self._start(range(first + k, first + count, self.jobs), self.home / f"worker{k}", Board())
            for k in range(min(self.jobs, count))
        ]
        boards = [one.board for one in running]
        try:
            while running:
                time.sleep(0.01)
                running = [alive for one in running if (alive := self._watched(one))]
        finally:
            for one in running:
                with contextlib.suppress(ProcessLookupError, ChildProcessError):  # one that has ended
                    os.kill(one.pid, signal.SIGKILL)
                    os.waitpid(one.pid, 0)
        for board in boards:
            _, _, opened, refused, spent, most = board.read()
            self.tally.opened += opened
            self.tally.refused += refused
            self.tally.cpu_s += spent
            self.tally.most_s = max(self.tally.most_s, most)
        self.tally.inputs += count
        self.tally.findings = sorted(self.out.glob(f"{self.reader.name}-*.json"))
        return self.tally

    def _start(self, numbers: range, home: Path, board: Board) -> _Running:
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if not pid:
            status = 1
            try:
                work(self.reader, self.valid, numbers, self.seed, home, self.out, board)
                status = 0
            except BaseException:
                import traceback

                (home / "broken").write_text(traceback.format_exc())
            finally:
                os._exit(status)
        return _Running(pid, numbers, home, board)

    def _watched(self, one: _Running) -> _Running | None:
        """The worker, or the one that goes on in its place; None where its inputs are through."""
        done, status = os.waitpid(one.pid, os.WNOHANG)
        number, began, *_ = one.board.read()
        if not done:
            if number in one.left and not one.killed and _stuck(one, number, began):
                one.killed = True
                with contextlib.suppress(ProcessLookupError):
                    os.kill(one.pid, signal.SIGUSR1)
                    time.sleep(0.2)
                    os.kill(one.pid, signal.SIGKILL)
            return one
        if not status and number == one.left.stop:
            return None
        broken = one.home / "broken"
        if (os.WIFEXITED(status) and broken.exists()) or number not in one.left:
            raise RuntimeError(
                f"the harness failed at input {number}: {broken.read_text() if broken.exists() else status}"
            )
        self._ended(one, number, status)
        left = range(number + one.left.step, one.left.stop, one.left.step)
        if not left:
            return None
        return self._start(left, one.home, one.board)

    def _ended(self, one: _Running, number: int, status: int) -> None:
        """Records the input that ended its process."""
        name = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"exit {os.WEXITSTATUS(status)}"
        trace = (one.home / "trace").read_text(errors="replace")[-3000:]
        said = (one.home / "said").read_text(errors="replace")[-1000:]
        rows = [row.strip() for row in trace.split("\n") if "File" in row]
        ours = next(
            (row for row in rows if not any(part in row for part in ("/tests/", "/lib/python", "<frozen"))), "?"
        )
        kind = "hang" if one.killed else f"died of {name}"
        change = changes(self.reader, self.valid, self.seed, number)
        save(self.out, self.reader, number, self.seed, Finding(kind, ours, f"{trace}\n{said}"), change)
        self.tally.died += 1


def _stuck(one: _Running, number: int, began: float) -> bool:
    """Whether the worker has been at one input for too long: by its own clock from when it is first seen at it."""
    if number != one.seen:
        one.seen, one.cpu_s = number, _cpu_s(one.pid)
        return False
    if _cpu_s(one.pid) - one.cpu_s > LIMIT_S:
        return True
    return time.time() - began > WAITS * LIMIT_S and _state(one.pid) == "S"  # it waits, not for its turn of the CPU


def _state(pid: int) -> str:
    """What the process does: "R" where it runs or could, "S" where it waits for something."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return ""


def _cpu_s(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
