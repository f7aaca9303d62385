"""Tries a reproduction again, in this process."""

import base64
import json
import os
from pathlib import Path
from random import Random

from tests.fuzz import readers
from tests.fuzz._parent import Runner
from tests.fuzz._worker import Bench


def replay(file: Path) -> int:
    """Prints what came of it; 0 where nothing is wrong any more."""
    record = json.loads(file.read_text(encoding="utf-8"))
    reader = readers.known()[record["reader"]]
    change = {name: None if text is None else base64.b64decode(text) for name, text in record["files"].items()}
    print(f"{record['reader']} {record['number']}: {record['kind']} at {record['where']}", flush=True)
    with Runner(reader, record["seed"], file.parent, 1) as runner:
        streams = [os.dup(1), os.dup(2)]
        try:
            bench = Bench(reader, runner.valid, runner.home / "worker")
            outcome, finding = bench.attempt(change, Random(f"{record['seed']} {record['number']}"))
        finally:
            for number, stream in enumerate(streams, start=1):
                os.dup2(stream, number)
            os.chdir("/")
    print(outcome, f"{finding.kind} at {finding.where}\n{finding.text}" if finding else "nothing is wrong", sep="; ")
    return int(finding is not None)
