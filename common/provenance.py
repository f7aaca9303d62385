"""What made a result, and when: the commit of viewbench, the machine, and its clock."""

import functools
import os
import platform
import subprocess
from datetime import UTC, datetime

from .settings import PACKAGE


def now() -> str:
    """The time in UTC by this machine's clock, ISO 8601 with milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@functools.cache
def commit() -> str:
    """Abbreviated commit of this checkout, with `-dirty` when tracked files were edited; "" for an installed wheel."""
    if not (PACKAGE / ".git").exists():
        return ""
    try:
        done = subprocess.run(
            ["git", "-C", str(PACKAGE), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def machine() -> dict[str, str | int]:
    """Processor, its count, system and Python, for people who compare timings."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            name = next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), name)
    except OSError:
        pass
    return {
        "cpu": name,
        "cpus": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }
