"""A process that has imported what commands import of other projects, and forks itself for every job of a study.

Importing numpy, scipy and numba, and making numba ready, takes a job of the default study as long as half of its work.
With the server of a run a job is a `viewbench` that hands over what it was asked (`_fork_client.py`) and waits. Of
viewbench itself the server has nothing imported: each job reads the source code as it is when it begins. A job has the
folder, the variables and the three streams of the `viewbench` that asked; signals are passed on; it ends when its
`viewbench` or the server does, and the server ends with the run. Where there is no server a command runs as always:
on another system than Linux, with several threads a job, and on a cluster, whose limits on a job hold for its own
processes alone.
"""

import atexit
import contextlib
import ctypes
import gc
import importlib
import json
import os
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any, NoReturn

from ._fork_client import ADDRESS, LENGTH, PASSED_ON, PREFIX

PACKAGES = ("click", "numpy", "PIL.Image", "plyfile", "scipy.ndimage", "scipy.spatial", "skimage.metrics")
LONGEST = 80  # bytes of a folder's name that leave room for that of a socket in it
PATIENCE_S = 10.0  # for the rest of a request that has begun
END_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)


def start(workflow: Any, threads: int) -> None:
    """Starts the server of this run, where it can have one; the jobs find it by a variable."""
    if not (workflow.local_exec and threads == 1 and _watches()) or ADDRESS in os.environ:
        return
    folder = tempfile.mkdtemp(prefix="viewbench-", dir=None if len(tempfile.gettempdir()) < LONGEST else "/tmp")
    address = str(Path(folder) / "jobs")
    server = subprocess.Popen(command(address), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    os.environ[ADDRESS], os.environ[PREFIX] = address, sys.prefix

    def stop() -> None:
        server.communicate()  # it ends when its standard input does, and so also when this process is killed
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(stop)


def command(address: str) -> list[str]:
    """What starts a server. -P: files in the folder that it is started in, that of the results, are no modules."""
    return [sys.executable, "-P", "-m", "viewbench.workflow._fork_server", address]


def _watches() -> bool:
    """Whether this system says when a process ends, as Linux does from 5.3 on where no sandbox forbids it."""
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):
        return False
    return True


class Server:
    """Forks a process for each request and tells its `viewbench` how it ended."""

    def __init__(self, address: str):
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(address)
        self.listener.listen(64)
        self.waiting = selectors.DefaultSelector()
        self.pids: set[int] = set()

    def serve(self) -> None:
        """Until standard input ends; then stops the jobs that are left."""
        self.waiting.register(self.listener, selectors.EVENT_READ, self.accept)
        self.waiting.register(sys.stdin.buffer, selectors.EVENT_READ, None)
        while True:
            for key, _ in self.waiting.select():
                if key.data is None:
                    for pid in self.pids:
                        _kill(pid)
                    return
                key.data()

    def accept(self) -> None:
        """Begins a job."""
        connection, _ = self.listener.accept()
        connection.settimeout(PATIENCE_S)
        fds: list[int] = []
        try:
            start, fds, _, _ = socket.recv_fds(connection, LENGTH, 3)
            content = connection.makefile("rb").read(int.from_bytes(start, "big"))
            request = json.loads(content)
            # What reaches the child before it minds signals waits until it does.
            signal.pthread_sigmask(signal.SIG_BLOCK, PASSED_ON)
            pid = os.fork()
            if not pid:
                run(request, fds)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, PASSED_ON)
        except (OSError, ValueError):  # it went away
            connection.close()
            return
        finally:
            for fd in fds:
                os.close(fd)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.setpgid(pid, pid)  # here too: signals may be passed on before the child has come to it
        ended = os.pidfd_open(pid)
        self.pids.add(pid)

        def reply() -> None:
            _, status = os.waitpid(pid, 0)
            self.pids.discard(pid)
            self.waiting.unregister(ended)
            os.close(ended)
            with contextlib.suppress(KeyError):
                self.waiting.unregister(connection)
            code = os.waitstatus_to_exitcode(status)
            with contextlib.suppress(OSError):
                connection.sendall(f"{code if code >= 0 else 128 - code}\n".encode())
            connection.close()

        def gone() -> None:
            self.waiting.unregister(connection)
            _kill(pid)

        with contextlib.suppress(OSError):  # where it has gone away meanwhile, `gone` is called next
            connection.sendall(f"{pid}\n".encode())
        self.waiting.register(ended, selectors.EVENT_READ, reply)
        self.waiting.register(connection, selectors.EVENT_READ, gone)  # nothing is sent: it can only be closed


def run(request: dict[str, Any], fds: list[int]) -> NoReturn:
    """In the forked process: the command, as if Python had just started in it."""
    status = 1
    try:
        os.setpgid(0, 0)  # what is passed on reaches the programs that it starts too
        ctypes.CDLL(None).prctl(END_WITH_PARENT, signal.SIGTERM)
        for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
            signal.signal(number, signal.SIG_IGN if number in request["ignored"] else usual)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, PASSED_ON)
        for number, fd in enumerate(fds):
            os.dup2(fd, number)
        os.closerange(3, max(fds, default=3) + 100)
        # Those that Python made when the server began know another file, whether it was a terminal and could be wound.
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1, closefd=False)  # noqa: SIM115
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        os.environ.pop(ADDRESS, None)
        os.environ.pop(PREFIX, None)
        sys.argv = ["viewbench", *request["arguments"]]
        importlib.invalidate_caches()
        from . import _again

        status = _again.run(request["arguments"])
    except SystemExit as error:
        status = error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def prepare() -> None:
    """Imports what commands import of other projects, and nothing of viewbench for good."""
    given = dict(os.environ)
    for name in PACKAGES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    with contextlib.suppress(Exception):  # without numba, or with one that has these elsewhere, jobs see to it
        importlib.import_module("viewbench.common.kernels")  # for the processor that it compiles for
        target = importlib.import_module("numba.core.registry").cpu_target
        target.typing_context.refresh()
        target.target_context.refresh()
    for name in [name for name in sys.modules if name.split(".")[0] == "viewbench"]:
        del sys.modules[name]
    os.environ.clear()
    os.environ.update(given)
    gc.collect()
    gc.freeze()  # so that no job copies what it only looks through


def _kill(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGTERM)


if __name__ == "__main__":
    for ignored in (signal.SIGINT, signal.SIGTERM):  # of the whole group: the jobs end first, and the run says how
        signal.signal(ignored, signal.SIG_IGN)
    server = Server(sys.argv[1])
    prepare()
    server.serve()
    with contextlib.suppress(OSError):  # here too, since the run may have been killed
        Path(sys.argv[1]).unlink()
        Path(sys.argv[1]).parent.rmdir()
