"""How much memory a training took: this process, the programs that it runs, and the GPU."""

import contextlib
import os
import shutil
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from ..common import gpu

EVERY_S = 0.2  # between looks at the memory of a running program
JOIN_S = 0.05
WATCHER = "memory"  # the thread that looks
GPU_EVERY_S = 1.0  # nvidia-smi takes a tenth of a second itself


@dataclass
class Usage:
    """The largest amounts seen, in bytes; None where nothing could be measured."""

    rss_bytes: int = 0
    gpu_bytes: int | None = None


def peak_rss_bytes() -> int:
    """Largest resident set of this process so far, in bytes.

    Of Linux' two answers that of /proc is right: getrusage's outlives exec, so that a program which a larger one
    started begins with that one's peak.
    """
    try:
        with open("/proc/self/status", encoding="utf-8") as file:
            return next(int(line.split()[1]) << 10 for line in file if line.startswith("VmHWM:"))
    except (OSError, StopIteration):
        import resource

        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))


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
        watcher.join(JOIN_S)  # it may be waiting for nvidia-smi, and nobody waits for that


def _watch(pid: int, usage: Usage, done: threading.Event) -> None:
    import psutil

    has_gpu = shutil.which(gpu.SMI) is not None
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
            if has_gpu and rounds % max(1, round(GPU_EVERY_S / EVERY_S)) == 0:
                used = gpu_bytes({process.pid for process in family})
                usage.gpu_bytes = max(usage.gpu_bytes or 0, used) if used is not None else usage.gpu_bytes
        rounds += 1
        if done.wait(EVERY_S):
            return


def gpu_bytes(pids: set[int]) -> int | None:
    """GPU memory of these processes now, in bytes; None where nvidia-smi does not name them or cannot say."""
    try:
        rows = gpu.asked("--query-compute-apps=pid,used_memory") or ()
        ours = [int(float(used)) << 20 for pid, used in rows if int(pid) in pids]  # it counts in MiB
    except ValueError:
        return None
    return sum(ours) if ours else None  # in a container it may know the processes by other numbers
