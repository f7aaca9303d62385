"""Whether two runs of one study have the same results, but for times, memory and where they were made."""

import csv
import json
from pathlib import Path
from typing import Any

# Keys that say how a run went and not what came out of it.
OF_THE_RUN = (
    "_s",
    "seconds",
    "time",
    "rss",
    "commit",
    "machine",
    "threads",
    "content_sha256",
    "train_sha256",
    "began",
    "ended",
)


def _lasting(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lasting(item) for key, item in value.items() if not _of_the_run(key)}
    return [_lasting(item) for item in value] if isinstance(value, list) else value


def _of_the_run(key: str) -> bool:
    return any(key.endswith(word) if word == "_s" else word in key for word in OF_THE_RUN)


def content(path: Path) -> Any:
    """What must agree of a file."""
    if path.suffix == ".json":
        return _lasting(json.loads(path.read_text(encoding="utf-8")))
    if path.suffix == ".csv":
        with open(path, newline="", encoding="utf-8") as file:
            return [_lasting(row) for row in csv.DictReader(file)]
    return path.read_bytes()


def _files(folder: Path, part: str) -> set[Path]:
    paths = [folder / part, *(folder / part).rglob("*")]
    return {path.relative_to(folder) for path in paths if path.is_file()}


def differences(one: Path, other: Path) -> list[str]:
    """Files of two folders `results/STUDY` that are not the same: choices, models, renders, scores and the table."""
    wrong = []
    for part in ("selections", "cells", "results.csv"):
        names = [_files(folder, part) for folder in (one, other)]
        wrong += [f"{name}: only in one" for name in sorted(names[0] ^ names[1])]
        for name in sorted(names[0] & names[1]):
            if content(one / name) != content(other / name):
                wrong.append(f"{name}: differs")
    return wrong
