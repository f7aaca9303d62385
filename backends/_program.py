"""Which version of an external program does the work: its files, its checkout, and the Python packages it runs with."""

import hashlib
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from ..common.errors import UserError
from ..common.files import sha256_file
from ..scenes.image_files import is_file
from ._command_line import program

LONGEST_NAME = 4096  # of a path; more is a script in the command line
SECONDS = 60.0
CODE = (".py", ".c", ".cpp", ".cu", ".cuh", ".h", ".hpp", ".so", ".toml", ".yaml", ".yml", ".json", ".sh")
PYTHON = re.compile(r"python(\d+(\.\d+)?)?w?(\.exe)?")
LISTING = """
import importlib.metadata as m, json, sys
packages = {d.metadata["Name"]: d.version for d in m.distributions()}
owners = {e.name: e.dist.name for e in m.entry_points(group="console_scripts") if e.dist}
print(json.dumps({"python": sys.version.split()[0], "packages": packages, "owners": owners}))
"""


def program_version(command: list[str]) -> str:
    """What the program is that a command line starts, as far as it can be found out without running it.

    A console script is only the door to its package: then name and version of that package come first. Every Python
    program depends on the packages beside it, a script in a git checkout on the rest of the checkout, and any program
    on its own files. Raises UserError where the program is not there, or its packages cannot be listed.
    """
    files = named_files(command)
    if not files:
        raise UserError(f"'{command[0]}' is not installed or not on PATH")
    parts = []
    python = next((found for file in files if (found := _python_of(file))), None)
    if python is not None:
        listed = _listed(python)
        owner = next((listed["owners"][file.name] for file in files if file.name in listed["owners"]), None)
        if owner is not None:
            parts.append(f"{owner} {listed['packages'].get(owner, '?')}")
        lines = "".join(f"{name}=={version}\n" for name, version in sorted(listed["packages"].items()))
        parts.append(f"python {listed['python']} with packages {hashlib.sha256(lines.encode()).hexdigest()[:12]}")
    parts += dict.fromkeys(state for file in files if (state := _checkout(file.resolve())))
    return ", ".join([*parts, f"sha256:{files_sha256(command)}"])


def files_sha256(command: list[str]) -> str:
    """First 12 hex digits of the SHA-256 over the programs and scripts that a command line names, in any folder."""
    digest = hashlib.sha256()
    for file in named_files(command):
        digest.update(f"{file.name}\0{sha256_file(file)}\0".encode())
    return digest.hexdigest()[:12]


def named_files(command: list[str]) -> list[Path]:
    """Programs and scripts that a command line names, each once; `env` before them is none."""
    files = []
    for number, part in enumerate(dict.fromkeys(command[command.index(program(command)) :] if command else [])):
        # Only the program is looked for on PATH: "black" may be a colour, and a program too.
        found = shutil.which(part) if number == 0 else part if is_file(Path(part)) else None
        if found:
            files.append(Path(found))
    return files


def _python_of(file: Path) -> str | None:
    """The interpreter that a file is, or that its first line names."""
    if PYTHON.fullmatch(file.name):
        return str(file)
    with open(file, "rb") as script:
        line = script.readline(LONGEST_NAME)
    words = line[2:].decode("utf-8", "replace").split() if line.startswith(b"#!") else []
    return next((word for word in reversed(words) if PYTHON.fullmatch(Path(word).name)), None)


def _listed(python: str) -> dict:
    try:
        # Not in the current folder, where Python would look for packages too.
        asked = {"cwd": tempfile.gettempdir(), "timeout": SECONDS, "check": True}
        return json.loads(subprocess.run([python, "-c", LISTING], capture_output=True, text=True, **asked).stdout)
    except (OSError, subprocess.SubprocessError, ValueError) as error:
        raise UserError(f"'{python}' does not say which packages it has: {error}") from None


def _checkout(file: Path) -> str | None:
    """Commit of the git checkout that has a file, and a hash of what was changed and added since; None outside of one.

    A checkout that merely lies around the file is another program's: a virtual environment in a clone, a home folder
    under version control.
    """

    def git(*arguments: str) -> bytes:
        # A checkout of another user's is not refused: nothing of it is run.
        command = ["git", "-c", "safe.directory=*", "-C", str(file.parent), *arguments]
        return subprocess.run(command, capture_output=True, timeout=SECONDS, check=True).stdout

    try:
        git("ls-files", "--error-unmatch", file.name)
        commit = git("rev-parse", "--short=12", "HEAD").decode().strip()
        changed = git("diff", "--no-ext-diff", "--binary", "--submodule=diff", "HEAD")
        top = Path(git("rev-parse", "--show-toplevel").decode().strip())
        added = git("-C", str(top), "ls-files", "--others", "--exclude-standard", "-z").decode("utf-8", "replace")
    except (OSError, subprocess.SubprocessError):
        return None
    code = [top / name for name in added.split("\0") if Path(name).suffix in CODE]
    hashes = "".join(f"{path.name} {sha256_file(path)}\n" for path in code if is_file(path))
    state = changed + hashes.encode()
    return commit + (f"+{hashlib.sha256(state).hexdigest()[:8]}" if state else "")
