"""`make versions` tries what it says: no torch, tests that are there, and a Python that is not there is not passed."""

import sys

from packaging.requirements import Requirement

from tests import lock, versions
from viewbench.common.settings import PACKAGE


def test_the_sets_have_all_but_torch():
    extras = lock.project()["optional-dependencies"]
    named = {Requirement(line).name for line in versions.asked()}
    assert not named & {"torch", "torchvision", "open_clip_torch", "lpips", "gsplat", "viewbench"}
    of_torch = {Requirement(line).name for extra in versions.TORCH for line in extras[extra]}
    left_out = {"dev", "render", "rooms", "cluster", *versions.TORCH, *versions.EXTRAS}
    assert set(extras) == left_out, "a new extra: say whether it wants torch"
    for extra in versions.EXTRAS:
        assert {Requirement(line).name for line in extras[extra]} - of_torch - {"viewbench"} <= named


def test_the_tests_are_there():
    assert [name for name in versions.QUICK if not (PACKAGE / name).exists()] == []


def test_a_python_that_is_not_there_is_said(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(versions.subprocess, "run", lambda *_, **__: None)
    monkeypatch.setattr(versions, "interpreters", lambda named: {})
    monkeypatch.setattr(versions, "all_extras", lambda *_: "ok")
    monkeypatch.setattr(sys, "argv", ["versions", "--keep", str(tmp_path / "kept")])
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "viewbench-1-py3-none-any.whl").touch()
    monkeypatch.setattr(versions.Path, "mkdir", lambda *_, **__: None)
    assert versions.main() == 1
    rows = [line for line in capsys.readouterr().out.splitlines() if "not there, so not tried" in line]
    assert len(rows) == len(versions.PYTHONS)
    assert not any(" ok " in row for row in rows)


def test_interpreters_are_told_apart_by_their_version(tmp_path):
    other = tmp_path / "python-of-some-name"
    other.symlink_to(sys.executable)
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\nexit 3\n")
    broken.chmod(0o755)
    found = versions.interpreters([str(broken), str(tmp_path / "missing"), str(other)])
    assert list(found) == [f"{sys.version_info.major}.{sys.version_info.minor}"]
