"""Damaged inputs by the hundred thousand for every reader: `python -m tests.fuzz [READER …] [--inputs N]`."""

import argparse
import csv
import sys
from pathlib import Path

from tests.fuzz import _parent, readers
from tests.fuzz._reader import Reader
from tests.fuzz._replay import replay
from viewbench.common.files import whole

COLUMNS = ("reader", "inputs", "inputs_per_cpu_s", "refused_percent", "opened_percent", "longest_s", "findings")


def main() -> int:
    """Runs the readers in rounds, so that all of them have had their share whenever it is stopped; 1 for findings."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("readers", nargs="*", metavar="READER", help="all of them where none is named")
    parser.add_argument("--inputs", type=int, default=100_000, help="of each reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--round", type=int, default=2000, help="inputs before the next reader's turn")
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"), help="reproductions, and table.csv")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--replay", type=Path, metavar="FILE", help="try one reproduction again")
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    if given.replay:
        return replay(given.replay)
    known = readers.known()
    if given.list:
        print("\n".join(known))
        return 0
    unknown = [name for name in given.readers if name not in known]
    if unknown:
        parser.error(f"no reader is called {unknown[0]} (there are: {', '.join(known)})")
    names = given.readers or list(known)
    given.out.mkdir(parents=True, exist_ok=True)
    done = run([known[name] for name in names], given)
    return int(any(runner.broken or runner.tally.findings for runner in done))


def run(chosen: list[Reader], given: argparse.Namespace) -> list[_parent.Runner]:
    """What came of the readers, in their order; the table is written after every turn."""
    out = given.out.resolve()
    runners = [_parent.Runner(reader, given.seed, out, given.jobs) for reader in chosen]
    try:
        for first in range(given.first, given.first + given.inputs, given.round):
            for runner in [runner for runner in runners if not runner.broken]:
                try:
                    tally = runner.run(first, min(given.round, given.first + given.inputs - first))
                except RuntimeError as error:  # of the harness: the other readers go on
                    runner.broken = str(error)
                    print(f"{runner.reader.name}: {error}", file=sys.stderr, flush=True)
                    continue
                print("  ".join(tally.row()), flush=True)
                with whole(out / "table.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
                    csv.writer(file).writerows([COLUMNS, *(one.tally.row() for one in runners)])
    finally:
        for runner in runners:
            runner.__exit__()
    return runners


if __name__ == "__main__":
    sys.exit(main())
