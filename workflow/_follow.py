"""Jobs end with the run that started them, however it ends, so that none goes on beside the jobs of the next run.

A run that is killed cannot end its jobs. Those that a fork server made end with the server; the others look at the
run's process themselves. On a cluster jobs belong to the scheduler, and outlive the process that sent them in.
"""

import os
import select
import signal
import threading
import time
from pathlib import Path
from typing import Any

from ..common import holding

RUN = "VIEWBENCH_RUN"  # of a run on this machine: its process, when that began, and the namespace of its number
GRACE_S = 30.0  # for a job to remove what it has half written


def lead(workflow: Any) -> None:
    """Has the jobs of this run, which are processes of this machine, follow it; a closed terminal stops it as Ctrl-C
    does."""
    if workflow.local_exec:
        os.environ[RUN] = f"{os.getpid()} {holding.began(os.getpid())} {_namespace()}"
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:
        signal.signal(signal.SIGHUP, signal.default_int_handler)


def follow() -> None:
    """Stops this process, in a thread that waits for it, when its run has ended; at once where it has already.

    Does nothing where there is no run, or none that can be seen from here, as in a container.
    """
    words = os.environ.get(RUN, "").split(" ")
    if len(words) != 3 or not words[0].isdigit() or not hasattr(os, "pidfd_open") or words[2] != _namespace():
        return
    pid = int(words[0])
    try:
        watched = os.pidfd_open(pid)
    except ProcessLookupError:
        raise KeyboardInterrupt from None
    except OSError:
        return
    if holding.began(pid) != words[1]:  # its number is another's by now
        raise KeyboardInterrupt

    def wait() -> None:
        select.select([watched], [], [])
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(GRACE_S)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=wait, name="follows its run", daemon=True).start()


def _namespace() -> str:
    try:
        return str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        return ""
