"""The lock files: every package with its version and the hashes of all its files on PyPI, for `pip --require-hashes`.

    python -m tests.lock UV          (or: make lock)

writes them with the program `uv`, for every platform and every Python that pyproject.toml allows. Versions are those of
constraints.txt. What that does not name is not installed where these were tested: CUDA, which PyPI's torch for Linux
brings along, and packages for Windows and other systems; of these the newest were taken, and stay until `--upgrade`.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from viewbench.common.files import whole
from viewbench.common.settings import PACKAGE

# By file: the extras that it is for. Not in them: dev, gpu and render, which want more than packages.
LOCKS = {
    "requirements-select.lock": (),
    "requirements.lock": ("study", "cluster", "video", "heic", "match", "plot", "lpips", "download"),
}
HEAD = """\
# {what}, with the hashes of PyPI's files; `make lock` writes it.
#     pip install --require-hashes -r {name} && pip install --no-deps viewbench-*.whl
# The Makefile goes by constraints.txt, which has the same versions: some machines have a torch of their own build.
"""


def project() -> dict:
    """[project] of pyproject.toml."""
    return tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def constraints() -> dict[str, str]:
    """Version by canonical name, of constraints.txt."""
    return dict(_pinned(line) for line in _lines(PACKAGE / "constraints.txt"))


def locked(name: str) -> dict[str, tuple[str, Requirement, int]]:
    """Version, requirement with its marker, and number of hashes by canonical name, of a lock file."""
    found = {}
    for line in _lines(PACKAGE / name):
        text, *hashes = re.split(r"\s+--hash=sha256:(?=[0-9a-f]{64}\b)", line)
        requirement = Requirement(text)
        key, version = _pinned(text.partition(";")[0])
        found[key] = version, requirement, len(hashes)
    return found


def needed(extras: tuple[str, ...], python: str) -> list[Requirement]:
    """What pyproject.toml asks for under a Python, with these extras and those that they name."""
    listed, optional = [*project()["dependencies"]], project()["optional-dependencies"]
    waiting, seen = list(extras), set()
    while waiting:
        extra = waiting.pop()
        if extra in seen:
            continue
        seen.add(extra)
        listed += optional[extra]
        waiting += [
            one for line in optional[extra] if line.startswith("viewbench[") for one in Requirement(line).extras
        ]
    environment = {**default_environment(), "python_version": python, "python_full_version": f"{python}.0"}
    every = [Requirement(line) for line in listed if not line.startswith("viewbench[")]
    return [one for one in every if one.marker is None or one.marker.evaluate(environment)]


def _lines(path: Path) -> list[str]:
    text = re.sub(r"\\\n", " ", path.read_text(encoding="utf-8"))
    return [line.strip() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]


def _pinned(text: str) -> tuple[str, str]:
    name, version = text.strip().split("==")
    return canonicalize_name(name), version.strip()


def command(uv: str, name: str, *more: str) -> list[str]:
    """What makes a lock file, run in the folder of pyproject.toml."""
    lowest = project()["requires-python"].removeprefix(">=")
    extras = [part for extra in LOCKS[name] for part in ("--extra", extra)]
    how = [
        "--universal",
        "--python-version",
        lowest,
        "--generate-hashes",
        "--no-annotate",
        "--no-header",
        "--no-config",
    ]
    return [uv, "pip", "compile", "--quiet", "pyproject.toml", *extras, "-c", "constraints.txt", *how, *more]


def main(uv: str, *more: str) -> None:
    """Writes the files."""
    for name, extras in LOCKS.items():
        file = PACKAGE / name
        with whole(file) as temporary:
            if file.is_file():
                temporary.write_bytes(file.read_bytes())  # versions that are in it and still fit stay
            subprocess.run([*command(uv, name, *more), "-o", str(temporary)], cwd=PACKAGE, check=True)
            what = f"viewbench[{','.join(extras)}]" if extras else "viewbench without extras, which chooses views"
            rows = temporary.read_text(encoding="utf-8")
            temporary.write_text(HEAD.format(what=what, name=name) + rows, encoding="utf-8")
        print(f"{name}: {len(locked(name))} packages")


if __name__ == "__main__":
    main(*sys.argv[1:])
