"""Downloads a whole file, and goes on where the last try ended, whether that was a second or a week ago."""

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...common.errors import UserError
from ...common.files import read_json, write_json
from .http import (
    CHUNK,
    Patience,
    Progress,
    TemporaryError,
    Tries,
    ask,
    check_signature,
    closing,
    head,
    if_range,
    kind_of,
    length_of,
    range_of,
    read,
    same_file,
    validators,
)
from .room import check_room

HEAD = 4096  # bytes by which an archive is told from a web page
RESTARTS = 3  # times that a file may become another one while it is fetched


@dataclass
class Download:
    """The file at `address` on its way to `target`, which appears when it is complete.

    What came so far is in `target.part`, with what the server said of it in `target.part.json`.
    """

    address: str
    target: Path
    patience: Patience
    progress: Progress
    say: Callable[[str], None]
    room: float = 1.0  # how often the file must fit on the disk
    best: int = field(default=0, init=False)  # most bytes that were ever there

    def __post_init__(self) -> None:
        self.part = self.target.with_name(self.target.name + ".part")
        self.note = self.target.with_name(self.target.name + ".part.json")
        self.tries = Tries(self.address, self.patience)

    def run(self) -> None:
        """Brings it.

        Raises UserError for a web page or another kind of file in place of an archive, a full disk, and a server that
        gives up.
        """
        self.target.parent.mkdir(parents=True, exist_ok=True)
        restarts = 0
        while True:
            have, then = self._kept()
            self.best = max(self.best, have)
            try:
                complete = self._once(have, then)
            except TemporaryError as error:
                self.tries.failure(error)
                continue
            if complete:
                break
            restarts += 1
            if restarts > RESTARTS:
                raise UserError(f"'{self.address}' becomes another file again and again while it is fetched; try later")
        self.part.replace(self.target)
        self.note.unlink(missing_ok=True)

    def _kept(self) -> tuple[int, dict[str, Any]]:
        """Bytes that are there and what the server said of the file then; nothing where they are of another address."""
        if self.part.is_file() and self.note.is_file():
            with contextlib.suppress(UserError, AttributeError, TypeError):
                then = read_json(self.note)
                if then.get("address") == self.address and isinstance(then.get("validators"), dict):
                    return self.part.stat().st_size, then
        return 0, {}

    def _once(self, have: int, then: dict[str, Any]) -> bool:
        """One request: True when the file is complete, False when it is to be begun anew.

        Raises TemporaryError when it broke off.
        """
        asked = {"Range": f"bytes={have}-", **if_range(then.get("validators", {}))} if have else {}
        with closing(ask(self.address, asked, self.patience)) as response:
            got, now, total = range_of(response), validators(response), then.get("length")
            if response.status == 416 and have and response.headers.get("Content-Range", "") == f"bytes */{have}":
                return True  # all of it is there
            goes_on = (
                got is not None
                and got.first == have
                and same_file(now, then.get("validators", {}))
                and (total is None or got.total in (None, total))
            )
            if response.status in (206, 416) and not goes_on:
                self.say(f"'{self.address}' is not what it was, or not the part that was asked for: it is begun anew")
                self.part.unlink(missing_ok=True)
                return False
            if not goes_on:
                first = head(response, HEAD)
                check_signature(first, self.address, kind_of(self.address))
                if have:
                    self.say(f"'{self.address}' is begun anew: it has changed, or the server gives no parts")
                have = 0
            else:
                first = read(response, CHUNK)
            left = length_of(response) if got is None else got.last - got.first + 1
            length = None if left is None else have + left
            if length is not None:
                check_room(self.part.parent, int(length * self.room) - have)
            if not goes_on:
                self.part.unlink(missing_ok=True)  # before the note: it is never taken for a part of another file
                write_json(self.note, {"address": self.address, "validators": now, "length": length})
            self._write(response, first, have, length)
        return True

    def _write(self, response: Any, piece: bytes, done: int, length: int | None) -> None:
        """Appends the body. Raises TemporaryError where it is shorter than announced."""
        with open(self.part, "ab" if done else "wb") as file:
            while piece:
                file.write(piece)
                done += len(piece)
                if done > self.best:  # else a server that always begins anew would be asked for ever
                    self.tries.progress()
                self.progress(done, length)
                piece = read(response, CHUNK)
            file.flush()
            os.fsync(file.fileno())
        if length is not None and done < length:
            short = f"the server announces more than the {done} bytes that it sends"
            raise TemporaryError("the server closed the connection early" if done > self.best else short)
