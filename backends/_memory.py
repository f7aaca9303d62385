"""How much memory a training took: this process, the programs that it runs, and the GPU."""

import contextlib
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass

EVERY_S = 0.1  # between looks at the memory of a running program
WATCHER = "memory"  # the thread that looks
GPU_EVERY_S = 1.0  # nvidia-smi takes a tenth of a second itself
QUERY = ("nvidia-smi", "--query-compute-apps=pid,used_memory", "--format=csv,noheader,nounits")


@dataclass
class Usage:
    """The largest amounts seen, in bytes; None where nothing could be measured."""

    rss_bytes: int = 0
    gpu_bytes: int | None = None


def peak_rss_bytes() -> int:
    """Largest resident set so far of this process or of one program that it ran and waited for, in bytes."""
    import resource

    peaks = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return int(max(peaks) * (1 if sys.platform == "darwin" else 1024))


@contextlib.contextmanager
def watched(pid: int) -> Iterator[Usage]:
    """Measures, while the body runs, this process together with the program `pid` and all that it starts.

    Resident sets are added up as they are at one moment, pages that processes share counted in each. GPU memory is
    what nvidia-smi says of these processes.
    """
    usage, done = Usage(), threading.Event()
    watcher = threading.Thread(target=_watch, args=(pid, usage, done), name=WATCHER, daemon=True)
    watcher.start()
    try:
        yield usage
    finally:
        done.set()
        watcher.join()


def _watch(pid: int, usage: Usage, done: threading.Event) -> None:
    import psutil

    has_gpu = shutil.which(QUERY[0]) is not None
    rounds = 0
    while True:
        with contextlib.suppress(psutil.Error):
            program = psutil.Process(pid)
            family = [program, *program.children(recursive=True)]
            total = psutil.Process(os.getpid()).memory_info().rss
            for process in family:
                with contextlib.suppress(psutil.Error):
                    total += process.memory_info().rss
            usage.rss_bytes = max(usage.rss_bytes, total)
            if has_gpu and rounds % round(GPU_EVERY_S / EVERY_S) == 0:
                used = gpu_bytes({process.pid for process in family})
                usage.gpu_bytes = max(usage.gpu_bytes or 0, used) if used is not None else usage.gpu_bytes
        rounds += 1
        if done.wait(EVERY_S):
            return


def gpu_bytes(pids: set[int]) -> int | None:
    """GPU memory of these processes now, in bytes; None where nvidia-smi cannot say."""
    try:
        listed = subprocess.run(QUERY, capture_output=True, text=True, timeout=10, check=True).stdout
        rows = [line.split(",") for line in listed.splitlines() if "," in line]
        return sum(int(float(used)) << 20 for pid, used in rows if int(pid) in pids)  # it counts in MiB
    except (OSError, subprocess.SubprocessError, ValueError):
        return None
