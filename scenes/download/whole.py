"""Downloads a whole file, and goes on where the last try ended, whether that was a second or a week ago."""

import contextlib
import os
from collections.abc import Callable
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


def download(address: str, target: Path, patience: Patience, progress: Progress, say: Callable[[str], None]) -> None:
    """Brings the file at `address` to `target`, which appears when it is complete.

    What came so far is in `target.part`, with what the server said of it in `target.part.json`. Raises UserError for a
    web page or another kind of file in place of an archive, a full disk, and a server that gives up.
    """
    part, note = target.with_name(target.name + ".part"), target.with_name(target.name + ".part.json")
    target.parent.mkdir(parents=True, exist_ok=True)
    tries, restarts, best = Tries(address, patience), 0, 0
    while True:
        have, then = _kept(part, note, address)
        best = max(best, have)
        try:
            ended, restarted = _once(address, part, note, have, then, patience, progress, _more(tries, best), say)
        except TemporaryError as error:
            tries.failure(error)
            continue
        if ended:
            break
        restarts += restarted
        if restarts > RESTARTS:
            raise UserError(f"'{address}' becomes another file again and again while it is fetched; try later")
        size = part.stat().st_size if part.exists() else 0
        if not restarted:
            short = f"the server announces more than the {size} bytes that it sends"
            tries.failure(TemporaryError("the server closed the connection early" if size > best else short))
    part.replace(target)
    note.unlink(missing_ok=True)


def _more(tries: Tries, best: int) -> Callable[[int], None]:
    """Takes note of progress only where more is there than ever was: a server may begin anew again and again."""

    def note(done: int) -> None:
        if done > best:
            tries.progress()

    return note


def _kept(part: Path, note: Path, address: str) -> tuple[int, dict[str, Any]]:
    """Bytes that are there and what the server said of the file then; nothing where they are of another address."""
    if part.is_file() and note.is_file():
        with contextlib.suppress(UserError, AttributeError, TypeError):
            then = read_json(note)
            if then.get("address") == address and isinstance(then.get("validators"), dict):
                return part.stat().st_size, then
    return 0, {}


def _once(
    address: str,
    part: Path,
    note: Path,
    have: int,
    then: dict[str, Any],
    patience: Patience,
    progress: Progress,
    more: Callable[[int], None],
    say: Callable[[str], None],
) -> tuple[bool, bool]:
    """One request: whether the file is complete now, and whether it was begun anew."""
    kind = kind_of(address)
    asked = {"Range": f"bytes={have}-", **if_range(then.get("validators", {}))} if have else {}
    with closing(ask(address, asked, patience)) as response:
        if response.status == 416:
            whole = response.headers.get("Content-Range", "").rpartition("/")[2]
            if have and whole == str(have):
                return True, False  # all of it is there
            part.unlink(missing_ok=True)
            return False, True
        got = range_of(response)
        now = validators(response)
        total = then.get("length")
        goes_on = (
            got is not None
            and got.first == have
            and same_file(now, then.get("validators", {}))
            and (total is None or got.total in (None, total))
        )
        if have and response.status == 206 and not goes_on:
            say(f"'{address}' is not what it was, or the server gives other parts than asked: it is fetched anew")
            part.unlink(missing_ok=True)
            return False, True
        first = head(response, HEAD) if not goes_on else read(response, CHUNK)
        if not have or not goes_on:
            check_signature(first, address, kind)
        if have and not goes_on:
            say(f"'{address}' is fetched anew: the server does not go on in the middle, or the file has changed")
        start = have if goes_on else 0
        left = length_of(response) if response.status != 206 or got is None else got.last - got.first + 1
        length = None if left is None else start + left
        if length is not None:
            check_room(part.parent, length - start)
        if not goes_on:
            part.unlink(missing_ok=True)  # before the note: what is there is never taken for a part of another file
            write_json(note, {"address": address, "validators": now, "length": length})
        done = start
        with open(part, "ab" if goes_on else "wb") as file:
            while first:
                file.write(first)
                done += len(first)
                more(done)
                progress(done, length)
                first = read(response, CHUNK)
            file.flush()
            os.fsync(file.fileno())
        if length is not None and done < length:
            return False, False
        return True, False
