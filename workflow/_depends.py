"""What a step depends on besides the files that pass from job to job: code, settings, versions, and data by content.

Snakemake sees files alone. So each step has a file that lists all of this, written when the workflow is read and only
where it says something new: a step runs again when, and only when, its list changed. Nothing in a list is a path of the
machine, so the same study with the same data in other folders has the same lists.
"""

import json
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from ..common.files import plain, write_text
from ..common.sources import sources
from ._alone import plainly


class Lists:
    """The lists of one study, in a folder of its results. Only Snakemake's main process writes them."""

    def __init__(self, folder: Path, writes: bool = True):
        self.folder, self.writes = folder, writes
        self._made: set[str] = set()

    def path(
        self,
        step: str,
        modules: tuple[str, ...] = (),
        values: Mapping[str, Any] | None = None,
        packages: tuple[str, ...] = (),
        keep: bool = False,
    ) -> str:
        """The file of `step`: sources of `modules`, versions of installed `packages`, and `values` by name.

        With `keep` a file that is there stays as it is: something in it cannot be found out now.
        """
        file = self.folder / f"{step}.txt"
        if keep and file.is_file():
            return str(file)
        if self.writes and step not in self._made:
            lines = [f"{sha256}  {name}" for name, sha256 in sources(*modules).items()] if modules else []
            lines += [f"{name} = {json.dumps(plain(value), sort_keys=True)}" for name, value in (values or {}).items()]
            lines += [f"{package} {_version(package)}" for package in packages]
            text = "".join(f"{line}\n" for line in lines)
            with plainly():  # it is written while Snakemake plans, which would show where in the code that was
                if not file.is_file() or file.read_text(encoding="utf-8") != text:
                    write_text(file, text)
            self._made.add(step)
        return str(file)


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
