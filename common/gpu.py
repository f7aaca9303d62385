"""One GPU a job: which devices there are, and a lock on the one that a process uses.

The lock is on a file, and held until the process ends, however it ends: the kernel gives it back. Programs that the
process starts see that device alone. Other programs know nothing of the lock; whether any of them used the device at
the same time is looked up and recorded, since timings of a shared GPU are not those of a free one.
"""

import contextlib
import itertools
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import holding
from .errors import UserError

VISIBLE = "CUDA_VISIBLE_DEVICES"
FOLDER = "viewbench-gpu"  # in the folder of temporary files: for all users of the machine
POLL_S = 0.5
SMI = "nvidia-smi"


@dataclass
class Lease:
    """A device that is this process's among those of viewbench."""

    device: str  # as CUDA_VISIBLE_DEVICES names it
    uuid: str  # as nvidia-smi names it; `device` where that cannot say
    waited_s: float
    others: int  # programs that used the device when it was taken, of whomever
    file: int  # descriptor of the lock; -1 where there are no locks

    def record(self) -> dict[str, Any]:
        """What `train.json` says; `shared` is True where another program used the device too, None if nobody knows."""
        now = _programs(self.uuid)
        # Where this process is named, every other is somebody's. Where it is not (it may have used none, or go by
        # another number in a container), one may be itself.
        ours = 0 if now is not None and os.getpid() in now else int("torch" in sys.modules)
        shared = None if now is None else self.others > 0 or len(now - {os.getpid()}) > ours
        return {"device": self.device, "waited_s": self.waited_s, "shared": shared}


_held: Lease | None = None


def devices() -> list[str]:
    """The devices that this process may use: those of CUDA_VISIBLE_DEVICES, or else all that nvidia-smi names.

    The latter by UUID: CUDA counts by speed and nvidia-smi by bus, so that a number may mean two devices.
    """
    given = os.environ.get(VISIBLE)
    if given is not None:
        names = [name.strip() for name in given.split(",")]
        # CUDA reads up to the first that it does not know: -1, NoDevFiles, …
        usable = itertools.takewhile(lambda name: name.isdigit() or name.startswith(("GPU-", "MIG-")), names)
        return list(dict.fromkeys(usable))
    return list(_identities().values())


def hold(wanted: str = "cuda") -> Lease | None:
    """Takes a device for as long as this process lives, waiting until one is free; None where there is none.

    Comes before CUDA is first asked for anything, since it reads CUDA_VISIBLE_DEVICES but once. `wanted` is "cuda" or
    "auto" for any of the devices, or "cuda:N" for one of them; whichever it is, it is the process's only one from then
    on, and number 0. A second call changes nothing. Raises UserError for a number that no device has.
    """
    global _held
    if _held is not None or wanted == "cpu":
        return _held
    names = devices()
    _, pinned, number = wanted.partition(":")
    if not names:
        return None
    if pinned:
        if not (number.isdigit() and int(number) < len(names)):
            raise UserError(f"[compute] device is '{wanted}', and there are {len(names)} devices, cuda:0 and on")
        names = [names[int(number)]]
    os.environ.setdefault("CUDA_DEVICE_ORDER", "PCI_BUS_ID")  # as nvidia-smi counts, by whose numbers locks are named
    uuids = _identities()
    began, told = time.monotonic(), False
    while True:
        for name in names:
            uuid = uuids.get(name, name)  # one device has one lock, whichever of its names it is called by
            file = _lock(uuid)
            if file is not None:
                _held = Lease(name, uuid, round(time.monotonic() - began, 1), len(_programs(uuid) or ()), file)
                os.environ[VISIBLE] = name
                return _held
        if not told:
            print(f"viewbench: waiting for a GPU ({len(names)} in use by other jobs)", file=sys.stderr, flush=True)
            told = True
        time.sleep(POLL_S)


def _lock(uuid: str) -> int | None:
    """A descriptor that holds the device's lock; None where another process has it."""
    if holding.fcntl is None:
        return -1
    folder = Path(tempfile.gettempdir()) / FOLDER
    with contextlib.suppress(OSError):
        folder.mkdir()
        folder.chmod(0o1777)  # by whoever made it: another user's may be a link to a folder of ours by now
    # Nodes of a cluster may share the folder: a number alone means another device on each.
    name = uuid if uuid.startswith(("GPU-", "MIG-")) else f"{os.uname().nodename}-{uuid}"
    path = folder / name.replace("/", "_")
    with contextlib.suppress(OSError):
        made = os.open(path, os.O_CREAT | os.O_EXCL, 0o666)
        os.fchmod(made, 0o666)
        os.close(made)
    try:
        file = _opened(path)
    except OSError:  # a link, or nothing that can be made
        return -1
    got = holding.lock(file)
    if got:
        return file
    os.close(file)
    return None if got is False else -1  # a file system without locks


def _opened(path: Path) -> int:
    """A descriptor of a lock's file. Raises OSError for a link, which another user may have left to any file."""
    careful = os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        return os.open(path, os.O_RDWR | careful)
    except OSError:
        return os.open(path, os.O_RDONLY | careful)  # of another user; NFS wants more, a local file system does not


def _identities() -> dict[str, str]:
    """UUIDs by index."""
    return {row[0]: row[1] for row in asked("--query-gpu=index,uuid") or () if len(row) == 2}


def _programs(uuid: str) -> set[int] | None:
    """Numbers of the processes that compute on a device; None where nvidia-smi cannot say."""
    rows = asked("--query-compute-apps=gpu_uuid,pid")
    if rows is None:
        return None
    return {int(row[1]) for row in rows if len(row) == 2 and row[0] == uuid and row[1].isdigit()}


def asked(query: str) -> list[list[str]] | None:
    """Rows of what nvidia-smi answers, its numbers without their units; None where there is none, or it fails."""
    try:
        command = [SMI, query, "--format=csv,noheader,nounits"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return [[part.strip() for part in line.split(",")] for line in done.stdout.splitlines() if "," in line]
