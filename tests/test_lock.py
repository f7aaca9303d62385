"""The lock files say what constraints.txt and pyproject.toml say, with all that is needed and a hash for each."""

import importlib.metadata
import re

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from tests import lock

LINUX = {**default_environment(), "sys_platform": "linux", "platform_system": "Linux", "platform_machine": "x86_64"}
PYTHONS = ("3.11", "3.12", "3.13")
CUDA = re.compile(r"nvidia-|cuda-|triton$")  # what the torch of PyPI wants on Linux, and others do not


def environment(python: str) -> dict[str, str]:
    """What markers see on Linux under a Python."""
    return {**LINUX, "python_version": python, "python_full_version": f"{python}.0"}


def on_linux(requirement: Requirement, python: str = "3.11", extra: str = "") -> bool:
    marker = requirement.marker
    return marker is None or marker.evaluate({**environment(python), "extra": extra})


@pytest.mark.parametrize("name", lock.LOCKS)
def test_every_package_has_a_version_and_a_hash(name):
    assert lock.locked(name)
    for package, (version, _, hashes) in lock.locked(name).items():
        assert hashes > 0, f"{package} {version}"


@pytest.mark.parametrize("name", lock.LOCKS)
def test_versions_are_those_of_the_constraints(name):
    pinned = lock.constraints()
    wrong = {
        package: (version, pinned.get(package))
        for package, (version, requirement, _) in lock.locked(name).items()
        if pinned.get(package, version) != version
        or (package not in pinned and on_linux(requirement) and not CUDA.match(package))
    }
    assert not wrong, "make lock"


@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("name", lock.LOCKS)
def test_what_the_project_asks_for_is_there(name, python):
    found = lock.locked(name)
    for wanted in lock.needed(lock.LOCKS[name], python):
        version, requirement, _ = found[canonicalize_name(wanted.name)]
        assert on_linux(requirement, python), f"make lock: {wanted} is not there for Python {python}"
        assert version in wanted.specifier, f"make lock: {wanted}, not {version}"


def test_the_pythons_are_those_of_the_project():
    allowed = SpecifierSet(lock.project()["requires-python"])
    assert [python for python in ("3.9", "3.10", *PYTHONS) if python in allowed] == list(PYTHONS)


@pytest.mark.parametrize("name", lock.LOCKS)
def test_what_those_need_is_there_too(name):
    """By what the installed packages say of themselves: `--require-hashes` refuses a list with a gap."""
    found = lock.locked(name)
    seen, gaps = set(), []
    waiting = [(canonicalize_name(one.name), one.extras) for one in lock.needed(lock.LOCKS[name], "3.11")]
    while waiting:
        package, extras = waiting.pop()
        if (package, frozenset(extras)) in seen:
            continue
        seen.add((package, frozenset(extras)))
        try:
            listed = importlib.metadata.requires(package) or []
        except importlib.metadata.PackageNotFoundError:
            continue
        for wanted in map(Requirement, listed):
            if any(on_linux(wanted, extra=extra) for extra in ("", *extras)):
                other = canonicalize_name(wanted.name)
                if other not in found or not wanted.specifier.contains(found[other][0], prereleases=True):
                    gaps.append(f"{package}: {wanted}")
                waiting.append((other, wanted.extras))
    assert not gaps, "make lock"
    assert {package for package, _ in seen} >= {"numpy", "pycolmap"}


def test_a_drift_would_be_seen(monkeypatch, tmp_path):
    """Of a version, of a hash, of a package: each of the tests here fails."""
    text = (lock.PACKAGE / "requirements-select.lock").read_text(encoding="utf-8")
    for name in ("constraints.txt", "pyproject.toml"):
        (tmp_path / name).write_text((lock.PACKAGE / name).read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(lock, "PACKAGE", tmp_path)
    numpy = re.search(r"^numpy==.*?(?=^\w)", text, re.MULTILINE | re.DOTALL)
    assert numpy
    first = numpy[0].splitlines()[0]
    changed = {
        test_versions_are_those_of_the_constraints: text.replace(first, "numpy==1.0 \\"),
        test_every_package_has_a_version_and_a_hash: text.replace(numpy[0], first.removesuffix(" \\") + "\n"),
        test_what_those_need_is_there_too: text.replace(numpy[0], ""),
    }
    for test, edited in changed.items():
        (tmp_path / "requirements-select.lock").write_text(text, encoding="utf-8")
        test("requirements-select.lock")
        (tmp_path / "requirements-select.lock").write_text(edited, encoding="utf-8")
        with pytest.raises((AssertionError, KeyError)):
            test("requirements-select.lock")
