"""A process that puts inputs through one reader, and says of each what is wrong with what came of it."""

import base64
import faulthandler
import functools
import hashlib
import json
import mmap
import os
import resource
import shutil
import signal
import struct
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.fuzz._reader import Changes, Input, InvalidError, Reader, apply, changes, contents, lay_out, restore
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE

MEMORY = 4 << 30  # bytes of address space that an input may take beyond what the process has before
LONGEST = 4100  # characters of a sentence
STATE = struct.Struct("<qdqqdd")  # number of the input, when it began, opened, refused, seconds of CPU, the most


@dataclass(frozen=True)
class Finding:
    """What an input brought to light, in words that are the same for inputs of one cause."""

    kind: str
    where: str  # innermost line of viewbench's own code
    text: str

    @property
    def key(self) -> str:
        """Names the cause."""
        return hashlib.sha256(f"{self.kind}\0{self.where}".encode(errors="replace")).hexdigest()[:12]


class Board:
    """What a worker tells its parent while it runs."""

    def __init__(self) -> None:
        self.memory = mmap.mmap(-1, STATE.size)
        self.tell(-1, 0.0, 0, 0, 0.0, 0.0)

    def tell(self, *values: float) -> None:
        STATE.pack_into(self.memory, 0, *values)

    def read(self) -> tuple[int, float, int, int, float, float]:
        return STATE.unpack_from(self.memory, 0)


@functools.cache
def mind_warnings() -> None:
    """Has every warning printed that a user would see once; before any reader sets what it does not want to hear."""
    warnings.simplefilter("always")
    for kind in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
        warnings.simplefilter("ignore", kind)


class Bench:
    """Where a process tries inputs: a copy of the capture, and folders in which nothing may be left."""

    def __init__(self, reader: Reader, valid: Mapping[str, bytes], home: Path):
        self.reader, self.valid, self.home = reader, valid, home
        self.root, self.empty, self.spare = home / "capture", home / "empty", home / "spare"
        shutil.rmtree(home, ignore_errors=True)
        for folder in (self.empty / "tmp", self.empty / "cwd", home / "cache"):
            folder.mkdir(parents=True)
        lay_out(self.root, valid)
        os.environ |= {"TMPDIR": str(self.empty / "tmp"), "XDG_CACHE_HOME": str(home / "cache")}
        os.chdir(self.empty / "cwd")
        self.said = open(home / "said", "w+b")  # noqa: SIM115
        for stream in (1, 2):
            os.dup2(self.said.fileno(), stream)
        os.set_blocking(self.said.fileno(), True)
        mind_warnings()

    def attempt(self, change: Changes, rng: Random) -> tuple[str, Finding | None]:
        """("opened" or "refused", what is wrong) of one input; the capture is valid again afterwards."""
        apply(self.root, change)
        before = set(self._files())
        try:
            outcome, finding = self._use(Input(self.root, tuple(change), rng, self.spare))
        finally:
            shutil.rmtree(self.spare, ignore_errors=True)
        finding = finding or self._left(before) or self._words()
        self.said.seek(0)
        self.said.truncate()
        restore(self.root, self.valid, change)
        return outcome, finding

    def _use(self, given: Input) -> tuple[str, Finding | None]:
        try:
            self.reader.use(given)
        except UserError as error:
            return "refused", _sentence(str(error))
        except (Exception, SystemExit) as error:  # whatever it is, it is what is looked for
            return "refused", Finding(type(error).__name__, _where(error), _last(error))
        return "opened", None

    def _files(self) -> Iterator[str]:
        stack = [str(self.root), str(self.empty)]
        while stack:
            with os.scandir(stack.pop()) as entries:
                for entry in entries:
                    yield entry.path
                    if entry.is_dir(follow_symlinks=False):
                        stack.append(entry.path)

    def _left(self, before: set[str]) -> Finding | None:
        extra = sorted(set(self._files()) - before)
        for path in map(Path, extra):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        return Finding("left behind", Path(extra[0]).suffix, f"{extra[0]} is left") if extra else None

    def _words(self) -> Finding | None:
        self.said.flush()
        size = os.fstat(self.said.fileno()).st_size
        if not size:
            return None
        text = os.pread(self.said.fileno(), 4000, 0).decode(errors="replace").strip()
        first = "".join("#" if letter.isdigit() else letter for letter in text.split("\n")[0])
        return Finding("printed", first.rsplit("/", 1)[-1][:80], text[:1500])


def _sentence(text: str) -> Finding | None:
    if text and "\n" not in text and len(text) <= LONGEST:
        return None
    return Finding("sentence", text[:40], f"{len(text)} characters: {text[:300]!r}")


def _where(error: BaseException) -> str:
    if isinstance(error, InvalidError):
        return str(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith(str(PACKAGE))]
    ours = [frame for frame in frames if "/tests/" not in frame.filename[len(str(PACKAGE)) :]] or frames
    return f"{ours[-1].filename[len(str(PACKAGE)) + 1 :]}:{ours[-1].lineno} {ours[-1].line}" if ours else "?"


def _last(error: BaseException) -> str:
    return "".join(traceback.format_exception(error))[-3000:]


def save(out: Path, reader: Reader, number: int, seed: int, finding: Finding, change: Changes) -> None:
    """Writes a reproduction, unless there is one of this cause."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{reader.name}-{finding.key}.json"
    if path.exists():
        return
    record = {
        "reader": reader.name,
        "seed": seed,
        "number": number,
        "kind": finding.kind,
        "where": finding.where,
        "text": finding.text,
        "files": {n: None if c is None else base64.b64encode(c).decode() for n, c in change.items()},
    }
    path.write_text(json.dumps(record, indent=1), encoding="utf-8")


def work(
    reader: Reader, valid: Mapping[str, bytes], numbers: range, seed: int, home: Path, out: Path, board: Board
) -> None:
    """Puts the inputs of these numbers through the reader, telling the board; reproductions go to `out`."""
    bench = Bench(reader, valid, home)
    trace = open(home / "trace", "w+b")  # noqa: SIM115
    faulthandler.enable(trace, all_threads=False)
    faulthandler.register(signal.SIGUSR1, trace, all_threads=False)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    have = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (have + MEMORY, have + MEMORY))
    _, _, opened, refused, spent, most = board.read()
    for number in numbers:
        change = changes(reader, valid, seed, number)
        board.tell(number, time.time(), opened, refused, spent, most)
        began = time.process_time()
        outcome, finding = bench.attempt(change, Random(f"{seed} {number}"))
        took = time.process_time() - began
        spent, most = spent + took, max(most, took)
        opened, refused = opened + (outcome == "opened"), refused + (outcome == "refused")
        if finding:
            save(out, reader, number, seed, finding, change)
    board.tell(numbers.stop, time.time(), opened, refused, spent, most)


def valid_capture(reader: Reader, folder: Path) -> dict[str, bytes]:
    """The files of the reader's valid capture, made in the folder, which goes afterwards."""
    folder.mkdir(parents=True)
    try:
        reader.make(folder)
        return contents(folder)
    finally:
        shutil.rmtree(folder)
