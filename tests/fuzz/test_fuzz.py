"""Whatever a file holds, a reader returns a valid object or one sentence: some hundred damaged inputs of each."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz import _parent, readers
from tests.fuzz._reader import Reader, changes
from viewbench.common import plugins
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE

INPUTS = 200  # of each reader; `make fuzz` has 100,000
GROUPS = 6  # processes, so that the workers of pytest share them


def test_every_format_has_a_fuzzer():
    assert {name for reader in readers.ALL for name in reader.formats} == set(plugins.names("scenes.formats"))


@pytest.mark.parametrize("group", range(GROUPS))
def test_damaged_inputs(group, tmp_path):
    names = list(readers.known())[group::GROUPS]
    command = [sys.executable, "-m", "tests.fuzz", *names, "--inputs", str(INPUTS), "--jobs", "1", "--out", tmp_path]
    done = subprocess.run(command, cwd=PACKAGE, capture_output=True, text=True)
    found = [json.loads(path.read_text()) for path in tmp_path.glob("*.json")]
    said = "\n\n".join(f"{one['reader']} {one['number']}: {one['kind']}\n{one['text']}" for one in found)
    assert done.returncode == 0, said or done.stderr


def writes(root: Path) -> None:
    (root / "a.txt").write_text("1 2 3\n4 5 6\n")


def tried(use, tmp_path, inputs=6):
    """(tally, findings' kinds) of a reader that is `use`, by one worker."""
    with _parent.Runner(Reader("made-up", writes, use), 0, tmp_path, 1) as runner:
        tally = runner.run(0, inputs)
    return tally, {json.loads(path.read_text())["kind"] for path in tally.findings}


def valid(given) -> bool:
    """Whether the input is the capture as it was made."""
    return not given.changed


def wrong_type(given):
    if not valid(given):
        return {}["a"]


def refuses(given):
    if not valid(given):
        raise UserError("no")


def two_lines(given):
    if not valid(given):
        error = UserError("no")
        error.args = ("a\nb",)
        raise error


def falls(given):
    if not valid(given):
        os.kill(os.getpid(), signal.SIGSEGV)


def hangs(given):
    while not valid(given):
        pass


def eats(given):
    if not valid(given):
        bytearray(64 << 30)


def talks(given):
    if not valid(given):
        os.write(2, b"libsomething: bad 3\n")


def litters(given):
    if not valid(given):
        (given.root / "left").write_text("")


@pytest.mark.parametrize(
    ("use", "kind"),
    [
        (wrong_type, "KeyError"),
        (two_lines, "sentence"),
        (falls, "died of SIGSEGV"),
        (hangs, "hang"),
        (eats, "MemoryError"),
        (talks, "printed"),
        (litters, "left behind"),
    ],
)
def test_what_the_harness_finds_and_goes_on_after(use, kind, tmp_path, monkeypatch):
    monkeypatch.setattr(_parent, "LIMIT_S", 0.3)
    tally, kinds = tried(use, tmp_path)
    assert kinds == {kind}
    assert (tally.inputs, len(tally.findings)) == (6, 1)  # of one cause
    assert tally.opened + tally.refused + tally.died == 6


def test_a_sentence_is_no_finding(tmp_path):
    tally, kinds = tried(refuses, tmp_path)
    assert (tally.refused, kinds) == (6, set())


def test_a_capture_that_is_not_valid_is_said(tmp_path):
    def never(given):
        raise UserError("no")

    with pytest.raises(UserError):
        tried(never, tmp_path)


def test_an_input_is_known_by_its_number():
    valid_files = {"a.txt": b"1 2 3\n4 5 6\n", "b.png": b"\x89PNG", "c.json": b'{"a": [1, {"b": 2}]}'}
    reader = Reader("made-up", writes, refuses)
    first = [changes(reader, valid_files, 0, number) for number in range(300)]
    assert first == [changes(reader, valid_files, 0, number) for number in range(300)]
    assert first != [changes(reader, valid_files, 1, number) for number in range(300)]
    different = {repr(sorted(change.items())) for change in first}
    assert len(different) > 200
    unchanged = sum(all(valid_files[name] == content for name, content in change.items()) for change in first)
    assert unchanged < 60


def test_a_finding_is_tried_again(tmp_path):
    names = ["rules"]
    record = {"reader": "rules", "seed": 0, "number": 3, "kind": "KeyError", "where": "x", "text": ""}
    file = tmp_path / "one.json"
    file.write_text(json.dumps({**record, "files": {"rules.txt": "ZXZlcnk6OAo="}}))
    command = [sys.executable, "-m", "tests.fuzz", "--replay", str(file)]
    done = subprocess.run(command, cwd=PACKAGE, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "nothing is wrong" in done.stdout
    assert names[0] in done.stdout
