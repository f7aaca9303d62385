"""Does viewbench work under every Python, with the least and the newest of what it needs, and with what is pinned?

    python -m tests.versions --uv PROGRAM [--python PATH …] [--sets lowest,pinned,newest] [--keep FOLDER]
                                                                                        (or: make versions)

For each Python that is found, or named, and each set of packages: an environment of its own with the wheel, its
`pip check`, views of the generated room chosen, the study `tiny` run from an empty folder, and the tests of QUICK. The
sets have all extras but those that want torch (gigabytes for each): `pinned` is constraints.txt, `lowest` the least
that pyproject.toml allows of what it names, `newest` the newest of everything; only what has wheels for that Python is
taken, but for packages that have none at all. That all extras together resolve to wheels is asked of the index alone.
A Python that is not there is said not to have been tried. Prints a Markdown table; logs are in FOLDER. An hour, nine
environments. Exits with 1 where something failed or a Python was missing.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement

from viewbench.common.settings import PACKAGE

from . import lock

PYTHONS = ("3.11", "3.12", "3.13")
SETS = {"lowest": "lowest-direct", "pinned": "highest", "newest": "highest"}
TORCH = ("clip", "lpips", "gpu")  # extras that want it
EXTRAS = ("train", "study", "video", "heic", "match", "plot", "download")
TESTING = ("pytest>=8.2", "hypothesis>=6.100", "packaging>=24", "pip>=24", "setuptools>=77", "build>=1.2")
NO_WHEELS = ("connection-pool",)  # plain Python, published as source alone
QUICK = (
    *("tests/selectors", "tests/common", "tests/test_layout.py"),
    *(
        f"tests/scenes/test_{name}.py"
        for name in (
            *("colmap", "transforms", "load", "digest", "features", "lenses", "trajectory", "video", "photos"),
            *("unposed", "written", "matching", "thinning", "kitti", "rgbd", "rooms"),
        )
    ),
    *(f"tests/backends/test_{name}.py" for name in ("records", "pictures", "subset", "points", "program")),
    *(f"tests/reports/test_{name}.py" for name in ("statistics", "tables", "reports", "selection_plot")),
)


@dataclass(frozen=True)
class Step:
    """One thing that was tried."""

    name: str
    good: bool
    said: str  # the end of what it printed

    @property
    def word(self) -> str:
        return "ok" if self.good else "FAILED"


def interpreters(named: list[str]) -> dict[str, str]:
    """Programs by version, 3.11 and so on: those named, or those that PATH and pyenv have."""
    found: dict[str, str] = {}
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    usual = [str(path) for version in PYTHONS for path in sorted(pyenv.glob(f"{version}.*/bin/python"))]
    for program in named or [*usual, *(f"python{version}" for version in PYTHONS)]:
        code = "import sys; print('%d.%d' % sys.version_info[:2]); print(sys.executable)"
        try:
            done = subprocess.run([program, "-c", code], capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        version, path = done.stdout.split()
        found.setdefault(version, path)
    return found


def asked() -> list[str]:
    """What the sets are made of: the requirements of pyproject.toml, and what its tests need."""
    every = lock.project()["optional-dependencies"]
    lines = [*lock.project()["dependencies"], *(line for extra in EXTRAS for line in every[extra])]
    return [line for line in lines if Requirement(line).name != "viewbench"] + list(TESTING)


class Trial:
    """One environment."""

    def __init__(self, uv: str, python: str, version: str, kind: str, folder: Path):
        self.uv, self.python, self.version, self.kind, self.folder = uv, python, version, kind, folder
        self.bin = folder / "venv" / "bin"
        self.here = folder / "here"

    def steps(self, wheel: Path) -> Iterator[Step]:
        """What was tried, up to the first failure without which the rest says nothing."""
        self.here.mkdir(parents=True)
        for name, step in (("resolved", self._resolve), ("installed", lambda: self._install(wheel))):
            done = step()
            yield Step(name, not done.returncode, _end(done))
            if done.returncode:
                return
        yield self._step("pip check", self.bin / "python", "-m", "pip", "check")
        chosen = ("--count", "9", "--out", "chosen")
        yield self._step("select", self.bin / "viewbench", "select", "room_human", *chosen)
        yield self._step("study", self.bin / "viewbench", "run", "tiny", "--out", "lab", "-j2")
        plain = ("--import-mode=importlib", "-q", "-rf", "-p", "no:cacheprovider", "--maxfail=20")
        yield self._step("tests", self.bin / "python", "-m", "pytest", *plain, *QUICK, cwd=PACKAGE)

    def versions(self) -> dict[str, str]:
        """What was installed."""
        done = self._run(self.bin / "python", "-m", "pip", "list", "--format", "json")
        return {package["name"].lower(): package["version"] for package in json.loads(done.stdout or "[]")}

    def _resolve(self) -> subprocess.CompletedProcess:
        (self.folder / "asked.in").write_text("\n".join(asked()), encoding="utf-8")
        how = ["--python-version", self.version, "--resolution", SETS[self.kind], "--no-config", "--quiet"]
        how += ["--constraint", str(PACKAGE / "constraints.txt")] if self.kind == "pinned" else []
        out = ["--output-file", str(self.folder / "packages.txt")]
        return self._run(self.uv, "pip", "compile", str(self.folder / "asked.in"), *how, *out, *wheels_only())

    def _install(self, wheel: Path) -> subprocess.CompletedProcess:
        made = self._run(self.uv, "venv", "--quiet", "--python", self.python, str(self.bin.parent))
        if made.returncode:
            return made
        how = [self.uv, "pip", "install", "--quiet", "--no-config", "--no-deps", "--python", str(self.bin / "python")]
        return self._run(*how, "-r", str(self.folder / "packages.txt"), str(wheel))

    def _step(self, name: str, *command: object, cwd: Path | None = None) -> Step:
        done = self._run(*command, cwd=cwd)
        return Step(name, done.returncode == 0, _end(done))

    def _run(self, *command: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
        """Runs a program as in a shell of the environment, with one thread, and keeps what it said."""
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
        environment |= {**threads, "XDG_CACHE_HOME": str(self.folder / "cache"), "UV_CACHE_DIR": str(uv_cache())}
        environment["PATH"] = f"{self.bin}{os.pathsep}{environment.get('PATH', '')}"
        if cwd is not None:
            environment["PYTHONPATH"] = str(PACKAGE / ".editor")
        words = [str(word) for word in command]
        done = subprocess.run(
            words, cwd=cwd or self.here, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True
        )
        with open(self.folder / "log.txt", "a", encoding="utf-8") as log:
            log.write(f"$ {' '.join(words)}\n{done.stdout}{done.stderr}[{done.returncode}]\n\n")
        return done


def uv_cache() -> Path:
    """Where packages are kept that were downloaded once."""
    return Path(os.environ.get("UV_CACHE_DIR") or Path.home() / ".cache" / "uv")


def wheels_only() -> list[str]:
    """Options of uv: what would have to be compiled is as good as not there."""
    return ["--only-binary", ":all:", *(part for name in NO_WHEELS for part in ("--no-binary", name))]


def all_extras(uv: str, version: str) -> str:
    """Whether all extras, those with torch too, resolve to wheels for Linux, with the pinned versions."""
    extras = [part for extra in (*EXTRAS, *TORCH) for part in ("--extra", extra)]
    where = ["--python-version", version, "--python-platform", "x86_64-unknown-linux-gnu", "--no-config", "--quiet"]
    command = [uv, "pip", "compile", "pyproject.toml", *extras, "-c", "constraints.txt", *where, *wheels_only()]
    done = subprocess.run(command, cwd=PACKAGE, capture_output=True, text=True)
    return "ok" if done.returncode == 0 else f"FAILED: {_end(done)}"


def _end(done: subprocess.CompletedProcess) -> str:
    return "\n".join((done.stdout + done.stderr).strip().splitlines()[-25:])


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--uv", default="uv")
    parser.add_argument("--python", action="append", default=[], metavar="PATH")
    parser.add_argument("--sets", default=",".join(SETS))
    parser.add_argument("--keep", type=Path, help="folder for environments and logs, which must not exist")
    given = parser.parse_args()
    found = interpreters(given.python)
    folder = given.keep or Path(tempfile.mkdtemp(prefix="viewbench-versions-"))
    folder.mkdir(parents=True, exist_ok=given.keep is None)
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(PACKAGE)]
    subprocess.run(build, check=True, capture_output=True)
    wheel = next(folder.glob("*.whl"))
    names = ("resolved", "installed", "pip check", "select", "study", "tests")
    rows, failures = [], []
    for version in [*PYTHONS, *(extra for extra in found if extra not in PYTHONS)]:
        if version not in found:
            rows.append(f"| {version} | not there, so not tried |{' |' * len(names)}")
            failures.append(f"Python {version} is not there: name it with --python")
            continue
        for kind in given.sets.split(","):
            trial = Trial(given.uv, found[version], version, kind, (folder / f"{version}-{kind}").absolute())
            steps = list(trial.steps(wheel))
            words = {step.name: step.word for step in steps}
            rows.append(f"| {version} | {kind} | {' | '.join(words.get(name, '') for name in names)} |")
            print(rows[-1], file=sys.stderr, flush=True)
            failures += [f"{version} {kind}, {step.name}:\n{step.said}" for step in steps if not step.good]
    print(f"| Python | packages | {' | '.join(names)} |\n|{' --- |' * (len(names) + 2)}")
    print("\n".join(rows))
    for version in PYTHONS:
        said = all_extras(given.uv, version)
        print(f"All extras, those with torch too, as wheels for Python {version} on Linux: {said}")
        failures += [] if said == "ok" else [f"{version}: not all extras resolve"]
    for failure in failures:
        print(f"\n{failure}")
    print(f"\nLogs: {folder}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
