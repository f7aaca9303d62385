"""What is known of a scene that is half there, and who is at it."""

import contextlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ...common.errors import UserError
from ...common.files import read_json, write_json

FORM: dict[str, Callable[[Any], bool]] = {
    "force": lambda value: isinstance(value, bool),
    "directory": lambda value: isinstance(value, str),
    "unpacked": lambda value: isinstance(value, list) and all(isinstance(one, str) for one in value),
}


@contextlib.contextmanager
def alone(root: Path, name: str) -> Iterator[None]:
    """Keeps a second call for the same scene or archive out. Raises UserError in that one."""
    import fcntl

    path = root / ".viewbench" / "locks" / name.replace("/", "+")
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UserError(f"{name} is being downloaded by another call of viewbench; wait for it") from None
        except OSError:
            pass  # a file system without locks
        yield


class State:
    """What is known of a scene that is half there."""

    def __init__(self, path: Path, staging: Path):
        self.path, self.staging = path, staging
        record = {}
        with contextlib.suppress(UserError):
            record = read_json(path) if path.is_file() else {}
        known = record if isinstance(record, dict) else {}
        # What is damaged is as if it were not there: at the worst something comes once more.
        self.record: dict[str, Any] = {
            key: known[key] for key, fits in FORM.items() if key in known and fits(known[key])
        }

    @property
    def directory(self) -> str | None:
        """The hash of the archive that it is from."""
        return self.record.get("directory")

    @property
    def unpacked(self) -> list[str]:
        """Archives in the archive that are unpacked, and gone."""
        return self.record.get("unpacked", [])

    def begin(self, force: bool) -> bool:
        """Forgets what came unless it is of a call that wanted the same: --force begins anew once, and then goes on.

        Returns whether it begins anew.
        """
        anew = force and not self.record.get("force")
        if anew:
            shutil.rmtree(self.staging, ignore_errors=True)
            self.record = {}
        self._write(force=force or self.record.get("force", False))
        return anew

    def of(self, directory: str) -> None:
        """Forgets what came from another archive than the one with this directory."""
        if self.record.get("directory", directory) != directory:
            shutil.rmtree(self.staging, ignore_errors=True)
            self.record = {"force": self.record.get("force", False)}
        self._write(directory=directory)

    def has_unpacked(self, relative: str) -> None:
        self._write(unpacked=[*self.unpacked, relative])

    def end(self) -> None:
        self.path.unlink(missing_ok=True)

    def _write(self, **values: Any) -> None:
        self.record = {**self.record, **values}
        write_json(self.path, self.record)
