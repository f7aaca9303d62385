"""PostgreSQL in a folder of its own, begun by hand, and the Python packages that a server over it needs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from viewbench.backends._command_line import free_port

PACKAGES = ("psycopg2-binary", "Flask-WTF")  # its driver, and what `mlflow server --app-name basic-auth` wants
PATIENCE_S = 300


def programs(install: bool) -> Path:
    """The folder of initdb and pg_ctl; exits with the line that installs them where there is none."""
    folders = [*sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name), reverse=True)]
    folders += [Path(found).parent for name in ("pg_ctl",) if (found := shutil.which(name))]
    for folder in folders:
        if (folder / "initdb").is_file():
            return folder
    if install:
        subprocess.run(["apt-get", "install", "-y", "--no-install-recommends", "postgresql"], check=True)
        return programs(False)
    sys.exit("PostgreSQL is not installed: apt-get install postgresql, or make test-server INSTALL=1 as root")


def packages(folder: Path) -> str:
    """PYTHONPATH with what the server needs besides mlflow, which is kept in `folder`."""
    if not (folder / "psycopg2").is_dir():
        command = [sys.executable, "-m", "pip", "install", "-qq", "--disable-pip-version-check", "--no-deps"]
        subprocess.run([*command, "--target", str(folder), *PACKAGES, "WTForms"], check=True)
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])


class Postgres:
    """A cluster of one database, on a port of 127.0.0.1; it runs as the user postgres where it is begun by root."""

    def __init__(self, folder: Path, bin_folder: Path):
        self.folder, self.bin, self.port = folder, bin_folder, free_port()
        self.folder.mkdir(parents=True)
        if not os.geteuid():
            shutil.chown(self.folder, "postgres")
        self._run("initdb", "-D", str(self.folder / "data"), "-U", "viewbench", "--auth=trust", "-E", "UTF8", "-N")
        self.control("start")

    @property
    def uri(self) -> str:
        return f"postgresql://viewbench@127.0.0.1:{self.port}/postgres"

    def control(self, what: str, *options: str) -> None:
        """`pg_ctl` start, stop or restart."""
        # Without waiting for the disk, which only a machine that loses its power needs.
        settings = f"-p {self.port} -c fsync=off -c listen_addresses=127.0.0.1 -c unix_socket_directories={self.folder}"
        log = str(self.folder / "log")
        self._run("pg_ctl", "-D", str(self.folder / "data"), "-w", "-l", log, "-o", settings, *options, what)

    def _run(self, program: str, *arguments: str) -> None:
        user = "postgres" if not os.geteuid() else None
        done = subprocess.run(
            [str(self.bin / program), *arguments],
            user=user,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,  # which the server that it leaves would hold open
            stderr=subprocess.DEVNULL,
            timeout=PATIENCE_S,
        )
        assert done.returncode == 0, f"{program} {' '.join(arguments)} ended with {done.returncode}"
