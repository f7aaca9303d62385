"""What must hold of a study's folder while its runs are killed, and when it is done in spite of that."""

import csv
import io
import json
import os
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from viewbench.common.files import SEAL, unsealed
from viewbench.reports._tracking import CELL

TIMES = {  # what differs from run to run: seconds, times, memory, and the hashes of records that have them
    *(
        "seconds",
        "select_s",
        "train_s",
        "evaluate_s",
        "setup_seconds",
        "peak_rss_bytes",
        "peak_gpu_bytes",
        "train_sha256",
        "began",
        "ended",
        SEAL,
    ),
}
COMPARED = ("cells", "selections", "features", "scenes", "rendered", "study.json", "results.csv")
LOOK_S = 0.02


def whole(path: Path) -> str | None:
    """What is wrong with a file under its final name; None where it is whole, or has just been replaced."""
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        if path.suffix == ".json":
            record = json.loads(content)
            if isinstance(record, dict):
                unsealed(record, path.name)
        elif path.suffix == ".ply":
            _ply(content)
        elif path.suffix in (".png", ".jpg"):
            with Image.open(io.BytesIO(content)) as image:
                image.load()
        elif path.suffix == ".npy":
            np.load(io.BytesIO(content), allow_pickle=False)
        elif path.suffix == ".csv":
            rows = list(csv.reader(io.StringIO(content.decode())))
            assert content.endswith(b"\n"), "the last row is cut"
            assert len({len(row) for row in rows}) == 1, "rows of different lengths"
        elif path.suffix == ".html":
            assert content.rstrip().endswith(b"</html>"), "the end is missing"
    except Exception as error:
        return f"{path}: {type(error).__name__}: {error}"
    return None


def _ply(content: bytes) -> None:
    """Raises where a binary PLY with one element of floats is not as long as its header says."""
    head, end, _ = content.partition(b"end_header\n")
    assert end, "no header"
    lines = head.decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    sizes = {"float": 4, "float32": 4, "uchar": 1, "uint8": 1, "double": 8, "int": 4}
    row = sum(sizes[line.split()[1]] for line in lines if line.startswith("property"))
    assert len(content) == len(head) + len(end) + count * row, "cut short"


class Watcher(threading.Thread):
    """Looks at every file of a study under its final name as soon as it is there or changes."""

    def __init__(self, results: Path):
        super().__init__(daemon=True)
        self.results, self.over = results, threading.Event()
        self.looked = 0
        self.wrong: list[str] = []
        self._seen: dict[str, tuple[int, int, int]] = {}

    def run(self) -> None:
        while not self.over.wait(LOOK_S):
            self.look(self.results)

    def look(self, folder: Path) -> None:
        for parent, folders, files in os.walk(folder):
            folders[:] = [name for name in folders if not name.startswith(".") and name not in ("logs", "benchmarks")]
            for path in (Path(parent, name) for name in files if not name.startswith(".")):
                try:
                    stat = path.stat()
                except OSError:
                    continue
                state = (stat.st_ino, stat.st_mtime_ns, stat.st_size)
                if self._seen.get(str(path)) != state:
                    self._seen[str(path)] = state
                    self.looked += 1
                    fault = whole(path)
                    if fault:
                        self.wrong.append(fault)

    def stop(self) -> None:
        self.over.set()
        self.join()
        self._seen.clear()
        self.look(self.results)


def timeless(value: Any) -> Any:
    """A record without what differs from run to run."""
    if isinstance(value, dict):
        return {key: timeless(item) for key, item in value.items() if key not in TIMES}
    return [timeless(item) for item in value] if isinstance(value, list) else value


def content(results: Path) -> dict[str, Any]:
    """Everything in a study's folder that two runs of it must agree in, by path."""
    found: dict[str, Any] = {}
    for name in COMPARED:
        top = results / name
        for path in sorted([top] if top.is_file() else top.rglob("*")):
            if path.is_dir():
                continue
            if path.suffix == ".json":
                value = timeless(json.loads(path.read_bytes()))
            elif path.suffix == ".csv":
                value = [timeless(row) for row in csv.DictReader(io.StringIO(path.read_text()))]
            else:
                value = path.read_bytes()
            found[path.relative_to(results).as_posix()] = value
    return found


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Paths that only one of two studies has, or that differ."""
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def left_over(results: Path) -> list[Path]:
    """Temporary files and folders that nobody should find after a run."""
    names = (".part-*", ".writer", ".training", ".renders", ".logs")
    return [path for name in names for path in results.rglob(name)]


def runs(uri: str, study: str) -> Counter:
    """Runs of cells in MLflow, those that were deleted aside, by cell and status."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=uri)
    experiment = client.get_experiment_by_name(study)
    assert experiment is not None, f"no experiment '{study}' at {uri}"
    found, token = [], None
    while True:
        page = client.search_runs([experiment.experiment_id], page_token=token)
        found += [(run.data.tags[CELL], run.info.status) for run in page if CELL in run.data.tags]
        token = page.token
        if not token:
            return Counter(found)


def processes(session: int) -> dict[int, tuple[int, str]]:
    """Living processes of a session: parent and command line by number."""
    found = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
                if int(fields[3]) == session and fields[0] not in "ZX":
                    line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                    found[int(folder.name)] = (int(fields[1]), line)
            except OSError:
                continue
    return found


def gone(session: int, seconds: float) -> bool:
    """Whether no process of a session is left, or soon will be."""
    until = time.monotonic() + seconds
    while processes(session):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True
