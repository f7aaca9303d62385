"""Tries a reproduction again, in a process of its own."""

import base64
import json
import shutil
import tempfile
from pathlib import Path
from random import Random

from tests.fuzz import readers
from tests.fuzz._parent import SHORT
from tests.fuzz._worker import Bench, valid_capture


def replay(file: Path) -> int:
    """Prints what came of it; 0 where nothing is wrong any more."""
    record = json.loads(file.read_text(encoding="utf-8"))
    reader = readers.known()[record["reader"]]
    home = Path(tempfile.mkdtemp(prefix="viewbench-fuzz-replay-", dir=SHORT))
    change = {name: None if text is None else base64.b64decode(text) for name, text in record["files"].items()}
    print(f"{record['reader']} {record['number']}: {record['kind']} at {record['where']}", flush=True)
    import os

    said = os.dup(1)
    try:
        bench = Bench(reader, valid_capture(reader, home / "made"), home / "worker")
        outcome, finding = bench.attempt(change, Random(f"{record['seed']} {record['number']}"))
    finally:
        os.dup2(said, 1)
        os.chdir("/")
        shutil.rmtree(home, ignore_errors=True)
    print(
        f"{outcome}; {finding.kind} at {finding.where}\n{finding.text}" if finding else f"{outcome}; nothing is wrong"
    )
    return int(finding is not None)
