"""Are there known vulnerabilities in what the lock files name?

    python -m tests.audit --pip-audit PROGRAM [--service pypi]        (or: make audit)
    python -m tests.audit --advisories FOLDER                         (or: make audit ADVISORIES=FOLDER)

The first asks a service by pip-audit. Without one in reach, FOLDER is a clone of pypa/advisory-database, or any folder
of records in OSV's form (.yaml or .json); what is newer than it stays unknown. tests/advisories.toml has the
advisories that are accepted, each with the reason. Exits with 1 for one that is not accepted, or accepted and found no
more, and with 2 where not all packages could be looked up.
"""

import argparse
import json
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

from viewbench.common.settings import PACKAGE

from . import lock

ACCEPTED = PACKAGE / "tests" / "advisories.toml"


def affected(record: dict[str, Any], package: str, version: str) -> bool:
    """Whether a record in OSV's form is of this version of a package of PyPI, as OSV's documentation has it."""
    if record.get("withdrawn"):
        return False
    for entry in record.get("affected", ()):
        of = entry.get("package", {})
        if of.get("ecosystem") != "PyPI" or canonicalize_name(of.get("name", "")) != package:
            continue
        if version in map(str, entry.get("versions", ())):
            return True
        if any(_within(one.get("events", ()), version) for one in entry.get("ranges", ()) if one["type"] != "GIT"):
            return True
    return False


def _within(events: Iterable[dict[str, Any]], version: str) -> bool:
    """Whether the last of the events that are not after the version leaves it vulnerable."""
    here, inside = Version(version), False
    for event in sorted(events, key=lambda event: _version(next(iter(event.values())))):
        ((kind, at),) = event.items()
        if kind == "introduced" and here >= _version(at):
            inside = True
        elif (kind == "fixed" and here >= _version(at)) or (kind == "last_affected" and here > _version(at)):
            inside = False
    return inside


def _version(text: Any) -> Version:
    try:
        return Version(str(text))
    except InvalidVersion:
        return Version("0")


def records(folder: Path, packages: Iterable[str]) -> Iterator[dict[str, Any]]:
    """The records below a folder that name one of the packages."""
    import yaml

    names = set(packages)
    for path in sorted(folder.rglob("*")):
        if path.suffix not in (".yaml", ".json"):
            continue
        text = path.read_text(encoding="utf-8")
        record = json.loads(text) if path.suffix == ".json" else yaml.load(text, Loader=yaml.CSafeLoader)
        if isinstance(record, dict) and names & {
            canonicalize_name(entry.get("package", {}).get("name", "")) for entry in record.get("affected", ())
        }:
            yield record


def of_folder(folder: Path, versions: dict[str, str]) -> dict[str, str]:
    """Package and version by the id of each advisory on one of these."""
    found = {}
    for record in records(folder, versions):
        of = [f"{name} {at}" for name, at in versions.items() if affected(record, name, at)]
        if of:
            found[record["id"]] = ", ".join(of)
    return found


def of_service(program: str, service: str) -> tuple[dict[str, str], list[str]]:
    """The same by pip-audit, and the packages that were not looked up. Raises SystemExit where nothing answers."""
    found, unknown = {}, []
    for name in lock.LOCKS:
        asked = ["-r", str(PACKAGE / name), "--require-hashes", "--disable-pip", "--progress-spinner", "off"]
        command = [program, *asked, "--vulnerability-service", service, "--format", "json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        try:
            listed = json.loads(done.stdout)["dependencies"]
        except (ValueError, KeyError):
            said = done.stderr.strip().splitlines() or ["it said nothing"]
            sys.exit(f"pip-audit could not ask '{service}': {said[-1]}")
        for one in listed:
            if "skip_reason" in one:
                unknown.append(one["name"])
            for vulnerability in one.get("vulns", ()):
                found[vulnerability["id"]] = f"{one['name']} {one['version']}"
    return found, sorted(set(unknown))


def judged(found: dict[str, str], accepted: dict[str, str]) -> list[str]:
    """What is wrong, a line each."""
    lines = [f"{name}: {of} has it; raise the version, or give a reason" for name, of in found.items()]
    wrong = [line for name, line in zip(found, lines, strict=True) if name not in accepted]
    wrong += [f"{name} is accepted without a reason" for name, reason in accepted.items() if not reason.strip()]
    return wrong + [f"{name} is accepted and no longer found; take it out" for name in accepted if name not in found]


def main() -> int:
    """Prints what was found."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--pip-audit", default="pip-audit")
    parser.add_argument("--service", default="pypi", choices=("pypi", "osv"))
    parser.add_argument("--advisories", type=Path, help="a folder of records, in place of a service")
    asked = parser.parse_args()
    versions = {name: version for file in lock.LOCKS for name, (version, *_) in lock.locked(file).items()}
    unknown: list[str] = []
    if asked.advisories is None:
        found, unknown = of_service(asked.pip_audit, asked.service)
        where = f"'{asked.service}', asked by pip-audit"
    else:
        found = of_folder(asked.advisories, versions)
        count = sum(1 for _ in records(asked.advisories, versions))
        where = f"'{asked.advisories}', {count} advisories on any version of these packages"
    accepted = tomllib.loads(ACCEPTED.read_text(encoding="utf-8")).get("accepted", {})
    wrong = judged(found, {} if unknown else accepted)
    print(f"{len(versions) - len(unknown)} of {len(versions)} packages were looked up in {where}: {len(found)} found")
    for line in wrong:
        print(line)
    if unknown:
        print(f"not looked up: {', '.join(unknown[:5])}{', …' if len(unknown) > 5 else ''}")
    return 1 if wrong else 2 if unknown else 0


if __name__ == "__main__":
    sys.exit(main())
