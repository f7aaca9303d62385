"""Advisories are found by version, as OSV's records have it, and nothing is said to be clean that was not looked up."""

import json
import subprocess
import sys

import pytest
from hypothesis import given, strategies

from tests import audit, lock

RELEASES = [f"1.{minor}" for minor in range(12)]


def record(events, versions=(), **more):
    ranges = [{"type": "ECOSYSTEM", "events": events}] if events else []
    of = {"package": {"ecosystem": "PyPI", "name": "Some_Package"}, "ranges": ranges, "versions": list(versions)}
    return {"id": "PYSEC-1", "affected": [of], **more}


@given(strategies.lists(strategies.sampled_from(range(12)), unique=True, max_size=6), strategies.booleans())
def test_ranges_are_the_releases_between_their_ends(ends, last):
    """However the events are ordered: against walking the releases one by one."""
    pairs = list(zip(sorted(ends)[0::2], sorted(ends)[1::2], strict=False))
    end = "last_affected" if last else "fixed"
    events = [{kind: RELEASES[at]} for pair in pairs for kind, at in zip(("introduced", end), pair, strict=True)]
    wanted = {RELEASES[k] for a, b in pairs for k in range(a, b + last)}
    for ordered in (events, events[::-1]):
        found = {one for one in RELEASES if audit.affected(record(ordered), "some-package", one)}
        assert found == wanted


def test_what_is_listed_withdrawn_or_another_package():
    listed = record([], ["1.3"])
    assert audit.affected(listed, "some-package", "1.3")
    assert not audit.affected(listed, "some-package", "1.4")
    assert not audit.affected(listed, "other", "1.3")
    assert not audit.affected({**listed, "withdrawn": "2024-01-01T00:00:00Z"}, "some-package", "1.3")
    assert audit.affected(record([{"introduced": "0"}]), "some-package", "1.0.post1"), "never mended"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Exit status and text of the program, with these accepted."""

    def run(accepted, *arguments):
        (tmp_path / "accepted.toml").write_text(f"[accepted]\n{accepted}")
        monkeypatch.setattr(audit, "ACCEPTED", tmp_path / "accepted.toml")
        monkeypatch.setattr(sys, "argv", ["audit", *map(str, arguments)])
        return audit.main(), capsys.readouterr().out

    return run


def test_an_advisory_wants_a_reason(run, tmp_path):
    folder = tmp_path / "advisories"
    folder.mkdir()
    assert run("", "--advisories", folder)[0] == 0
    entry = record([{"introduced": "0"}])
    entry["affected"][0]["package"]["name"] = "NumPy"
    (folder / "PYSEC-1.json").write_text(json.dumps(entry))
    status, text = run("", "--advisories", folder)
    assert status == 1
    assert f"PYSEC-1: numpy {lock.constraints()['numpy']} has it" in text
    assert run('PYSEC-1 = "only in what nobody calls"', "--advisories", folder)[0] == 0
    assert run('PYSEC-1 = ""', "--advisories", folder)[0] == 1
    (folder / "PYSEC-1.json").unlink()
    assert "no longer found" in run('PYSEC-1 = "x"', "--advisories", folder)[1]


@pytest.mark.parametrize("skipped", [True, False])
def test_what_could_not_be_looked_up_is_not_clean(run, tmp_path, monkeypatch, skipped):
    one = {"name": "numpy", "version": "1", "vulns": []} | ({"skip_reason": "not found"} if skipped else {})
    answer = subprocess.CompletedProcess([], 0, json.dumps({"dependencies": [one]}), "")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: answer)
    status, text = run("", "--pip-audit", "pip-audit")
    assert status == (2 if skipped else 0)
    assert ("not looked up: numpy" in text) == skipped


def test_no_answer_is_said(run, monkeypatch):
    answer = subprocess.CompletedProcess([], 1, "", "Traceback\nConnectionError: no such host\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: answer)
    with pytest.raises(SystemExit, match="could not ask 'pypi': ConnectionError: no such host"):
        run("", "--pip-audit", "pip-audit")


def test_what_is_accepted_is_said_why():
    import tomllib

    accepted = tomllib.loads(audit.ACCEPTED.read_text(encoding="utf-8"))["accepted"]
    assert all(isinstance(reason, str) and reason.strip() for reason in accepted.values())
