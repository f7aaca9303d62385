"""A Slurm cluster of two nodes on this machine, for a test: its own configuration, state, key and ports, no systemd.

Everything lies in one temporary folder, `/etc` is not touched, and all daemons end with the cluster. Memory limits hold
(`OverMemoryKill`, looked at every second), control groups are not needed, and `sacct` works, with a MariaDB of its own.
"""

import contextlib
import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

# Debian's packages, and a program of each.
PACKAGES = {
    "slurmctld": "slurmctld",
    "slurmd": "slurmd",
    "slurmdbd": "slurmdbd",
    "slurm-client": "sacct",
    "munge": "munged",
    "mariadb-server": "mariadbd",
}
PLACES = "/usr/sbin:/usr/bin:/sbin:/bin"
NODE = "VIEWBENCH_TEST_NODE"  # of a daemon's variables
UP_S = 120.0  # until a daemon answers

SLURM = """\
ClusterName=viewbench
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ctld}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=bf_interval=2,sched_interval=2,defer
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=127.0.0.1
AccountingStoragePort={dbd}
AccountingStoragePass={folder}/munge.socket
AccountingStorageTRES=gres/gpu
AccountingStoreFlags=job_comment
OverTimeLimit=0
KillWait=3
SlurmdTimeout=15
SlurmctldTimeout=15
InactiveLimit=0
MinJobAge=300
GresTypes=gpu
NodeName=node1 NodeHostname={host} NodeAddr=127.0.0.1 Port={node1} CPUs={cpus} RealMemory={memory}
NodeName=node2 NodeHostname={host} NodeAddr=127.0.0.1 Port={node2} CPUs={cpus} RealMemory={memory} Gres=gpu:1
PartitionName=all Nodes=node[1-2] Default=YES MaxTime=INFINITE State=UP
"""

DATABASE = """\
AuthType=auth/munge
AuthInfo={folder}/munge.socket
DbdHost={host}
DbdAddr=127.0.0.1
DbdPort={dbd}
SlurmUser=root
LogFile={folder}/slurmdbd.log
PidFile={folder}/slurmdbd.pid
StorageType=accounting_storage/mysql
StorageHost=127.0.0.1
StoragePort={sql}
StorageUser=slurm
StoragePass={password}
StorageLoc=slurm_acct
"""


def missing() -> list[str]:
    """Debian's packages whose programs are not here."""
    return [package for package, program in PACKAGES.items() if not shutil.which(program, path=PLACES)]


def install(packages: list[str]) -> None:
    """Installs packages by apt; raises CalledProcessError where that fails."""
    command = ["apt-get", "-o", "DPkg::Lock::Timeout=600", "install", "-y", "-qq", "--no-install-recommends", *packages]
    subprocess.run(command, check=True, env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"})


@dataclass
class Cluster:
    """The daemons, started by `with`; `environment` is what programs need to find the cluster."""

    folder: Path  # readable for all, and not longer than a socket's name allows
    cpus: int = 2  # of each node, real or not
    memory: int = 16_000  # MB of each node, there or not
    daemons: list[tuple[str, subprocess.Popen]] = field(default_factory=list)

    def __enter__(self) -> "Cluster":
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.folder.chmod(0o755)
            self._configure()
            self._start_munge()
            self._start_database()
            self._start_slurm()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *given: object) -> None:
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            self.call("scancel", "--quiet", "--state=PENDING", timeout=20)
            self.call("scancel", "--quiet", "--state=RUNNING", timeout=20)
            deadline = time.monotonic() + 20
            while self.call("squeue", "--noheader", timeout=20).strip() and time.monotonic() < deadline:
                time.sleep(0.5)
        for _, daemon in reversed(self.daemons):
            if daemon.poll() is None:
                daemon.send_signal(signal.SIGTERM)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    daemon.wait(20)
            if daemon.poll() is None:
                daemon.kill()
                daemon.wait()
        self.daemons.clear()

    @property
    def environment(self) -> dict[str, str]:
        """Variables of a process that submits jobs."""
        path = f"{self.folder}/bin:{os.environ.get('PATH', '')}:{PLACES}"
        return {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf"), "PATH": path}

    def call(self, *command: str, timeout: float = 60) -> str:
        """What one of Slurm's programs prints; raises CalledProcessError where it fails."""
        done = subprocess.run(
            command, env=self.environment, capture_output=True, text=True, timeout=timeout, check=True
        )
        return done.stdout

    def node(self, name: str) -> subprocess.Popen:
        """Starts the daemon of a node, again where it has ended."""
        return self._daemon(name, f"slurmd -D -N {name}".split(), {NODE: name})

    def fail(self, name: str) -> None:
        """Kills a node's daemon, and whatever runs on the node, as a loss of power does."""
        for daemon_name, daemon in self.daemons:
            if daemon_name == name and daemon.poll() is None:
                daemon.kill()
                daemon.wait()
        self.daemons = [pair for pair in self.daemons if pair[0] != name]
        # First those that watch over jobs, and would report their end; they have the daemon's variables.
        for variable in (f"{NODE}={name}", f"SLURMD_NODENAME={name}"):
            for process in Path("/proc").glob("[0-9]*"):
                with contextlib.suppress(OSError):
                    variables = (process / "environ").read_bytes().split(b"\0")
                    if f"SLURM_CONF={self.folder}/slurm.conf".encode() in variables and variable.encode() in variables:
                        os.kill(int(process.name), signal.SIGKILL)

    def _configure(self) -> None:
        ports = dict(zip(("ctld", "dbd", "sql", "node1", "node2"), _free_ports(5), strict=True))
        self.sql_port, self.password = ports["sql"], secrets.token_hex(16)
        host = socket.gethostname().split(".")[0]
        values = {
            "folder": self.folder,
            "host": host,
            "password": self.password,
            "cpus": self.cpus,
            "memory": self.memory,
            **ports,
        }
        files = {
            "slurm.conf": SLURM,
            "slurmdbd.conf": DATABASE,
            "gres.conf": "NodeName=node2 Name=gpu File={folder}/gpu0\n",
            "cgroup.conf": "CgroupAutomount=no\n",
        }
        for name, text in files.items():
            (self.folder / name).write_text(text.format(**values), encoding="utf-8")
        (self.folder / "gpu0").touch()  # a device to Slurm, which does not open it
        (self.folder / "slurmdbd.conf").chmod(0o600)
        for name in ("state", "spool-node1", "spool-node2", "sql", "bin"):
            (self.folder / name).mkdir(exist_ok=True)
        # Snakemake's plugin takes SLURM_CONF from the steps of a job, which elsewhere find /etc/slurm/slurm.conf.
        step = self.folder / "bin" / "srun"
        step.write_text(f'#!/bin/sh\nSLURM_CONF={self.folder}/slurm.conf exec /usr/bin/srun "$@"\n', encoding="utf-8")
        step.chmod(0o755)

    def _start_munge(self) -> None:
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(1024))
        key.chmod(0o400)
        names = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
        options = [f"--{option}={self.folder}/munge.{end}" for option, end in names.items()]
        self._daemon("munge", ["munged", "--foreground", "--num-threads=2", *options])
        self._until("munge", lambda: (self.folder / "munge.socket").exists())

    def _start_database(self) -> None:
        place = f"--datadir={self.folder}/sql"
        subprocess.run(
            ["mariadb-install-db", "--no-defaults", place, "--user=root", "--auth-root-authentication-method=normal"],
            env=self.environment,
            check=True,
            capture_output=True,
        )
        door = f"--socket={self.folder}/sql.socket"
        options = [place, "--user=root", door, f"--port={self.sql_port}", "--bind-address=127.0.0.1"]
        options += [
            f"--pid-file={self.folder}/sql.pid",
            "--innodb-buffer-pool-size=64M",
            "--innodb-lock-wait-timeout=900",
        ]
        self._daemon("mariadb", ["mariadbd", "--no-defaults", *options])
        client = ["mariadb", "--no-defaults", door, "--user=root", "--execute"]
        self._until("mariadb", lambda: subprocess.run([*client, "SELECT 1"], capture_output=True).returncode == 0)
        statements = (
            f"CREATE USER slurm@'127.0.0.1' IDENTIFIED BY '{self.password}'; "
            f"CREATE USER slurm@localhost IDENTIFIED BY '{self.password}'; "
            "GRANT ALL ON slurm_acct.* TO slurm@'127.0.0.1'; GRANT ALL ON slurm_acct.* TO slurm@localhost;"
        )
        subprocess.run([*client, statements], check=True, capture_output=True)

    def _start_slurm(self) -> None:
        self._daemon("slurmdbd", ["slurmdbd", "-D"])
        self._until("slurmdbd", lambda: "Cluster" in self.call("sacctmgr", "-i", "show", "cluster"))
        listed = self.call("sacctmgr", "-n", "-P", "show", "cluster", "format=cluster")
        if "viewbench" not in listed:
            self.call("sacctmgr", "-i", "add", "cluster", "viewbench")
        self._daemon("slurmctld", ["slurmctld", "-D", "-i"])
        for node in ("node1", "node2"):
            self.node(node)
        self._until("the nodes", lambda: self.call("sinfo", "-h", "-N", "-o", "%T").split() == ["idle", "idle"])

    def _daemon(self, name: str, command: list[str], variables: dict[str, str] | None = None) -> subprocess.Popen:
        with open(self.folder / f"{name}.out", "ab") as out:
            daemon = subprocess.Popen(
                command,
                env=self.environment | (variables or {}),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=out,
                start_new_session=True,
            )
        self.daemons.append((name, daemon))
        return daemon

    def _until(self, name: str, ready) -> None:
        """Waits until `ready()`; raises RuntimeError with the daemons' last words after UP_S."""
        deadline = time.monotonic() + UP_S
        while time.monotonic() < deadline:
            with contextlib.suppress(subprocess.SubprocessError, OSError):
                if ready():
                    return
            ended = [daemon for daemon, process in self.daemons if process.poll() is not None]
            if ended:
                break
            time.sleep(0.5)
        words = []
        for file in sorted([*self.folder.glob("*.out"), *self.folder.glob("*.log")]):
            words += [f"{file.name}: {line}" for line in file.read_text(errors="replace").splitlines()[-5:]]
        raise RuntimeError(f"{name} did not come up:\n" + "\n".join(words))


def _free_ports(count: int) -> list[int]:
    """Ports of 127.0.0.1 that nobody listens on, found together so that they differ."""
    with contextlib.ExitStack() as stack:
        ports = []
        for _ in range(count):
            door = stack.enter_context(socket.socket())
            door.bind(("127.0.0.1", 0))
            ports.append(door.getsockname()[1])
        return ports
