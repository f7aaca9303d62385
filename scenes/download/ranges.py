"""A file on a web server that can be read at any place: what `zipfile` needs to take one scene out of an archive.

What is wanted is told before (`plan`), and read in one request a run of neighbours, however many members that is.
"""

import io
from typing import Any

from ...common.errors import UserError
from .http import (
    CHUNK,
    Patience,
    TemporaryError,
    Tries,
    ask,
    check_signature,
    closing,
    head,
    if_range,
    range_of,
    read,
    same_file,
    validators,
)

TAIL = 1 << 18  # bytes at the end that are fetched at once: most directories of archives fit
GAP = 1 << 20  # bytes between two wanted parts that are read and dropped rather than asked for anew


class NoRangesError(Exception):
    """The server gives no parts of files, or not those that it was asked for."""


class ChangedError(Exception):
    """The file is another one than at the first request."""


class RangeFile(io.RawIOBase):
    """The file at `address`; `fetched` counts the bytes that came, `size` is its length.

    Raises NoRangesError where the server gives no parts, ChangedError when the file changes on the way, and UserError
    as `http.ask` does, for a web page, and for a server that gives up.
    """

    def __init__(self, address: str, kind: str | None, patience: Patience):
        super().__init__()
        self.address, self.patience = address, patience
        self.tries = Tries(address, patience)
        self.fetched = 0
        self._position = 0
        self._runs: list[tuple[int, int]] = []
        self._stream: Any = None
        self._at = self._end = 0  # of the stream: the next byte, and the one after its last
        self._tail = b""
        self._open(kind)

    def _open(self, kind: str | None) -> None:
        """Finds out length, validators and whether parts are given, by asking for the first bytes."""
        while True:
            try:
                with closing(ask(self.address, {"Range": "bytes=0-7"}, self.patience)) as response:
                    part = range_of(response)
                    if response.status == 416:
                        raise UserError(f"'{self.address}' is empty; it is not what the catalogue means")
                    if part is None or part.first == 0:
                        check_signature(head(response, 4096 if part is None else 8), self.address, kind)
                    if part is None or part.first != 0 or part.total is None:
                        raise NoRangesError
                    self.size, self.validators = part.total, validators(response)
                    return
            except TemporaryError as error:
                self.tries.failure(error)

    def plan(self, parts: list[tuple[int, int]]) -> None:
        """Tells which parts (first byte, one after the last) will be read; neighbours become one request."""
        runs: list[tuple[int, int]] = []
        for start, end in sorted(parts):
            if runs and start - runs[-1][1] <= GAP:
                runs[-1] = (runs[-1][0], max(runs[-1][1], end))
            else:
                runs.append((start, end))
        self._runs = runs

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self.size}[whence]
        if base + offset < 0:
            raise OSError(22, "seek before the start")
        self._position = base + offset
        return self._position

    def read(self, size: int | None = -1) -> bytes:  # pyright: ignore[reportIncompatibleMethodOverride]
        left = max(0, self.size - self._position)
        count = left if size is None or size < 0 else min(size, left)
        start = self._position
        if not count:
            return b""
        if start >= self.size - TAIL and not any(first <= start < end for first, end in self._runs):
            data = self._of_tail(start, count)
        else:
            data = self._bytes(start, count)
        self._position = start + len(data)
        return data

    def readinto(self, buffer: Any) -> int:
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._drop()
        super().close()

    def _of_tail(self, start: int, count: int) -> bytes:
        first = max(0, self.size - TAIL)
        if not self._tail:
            self._tail = self._bytes(first, self.size - first)
        return self._tail[start - first : start - first + count]

    def _bytes(self, start: int, count: int) -> bytes:
        """`count` bytes from `start`, however often the connection breaks off."""
        parts: list[bytes] = []
        have = 0
        while have < count:
            try:
                self._reach(start + have, start + count)
                data = read(self._stream, min(CHUNK, count - have, self._end - self._at))
                if not data:
                    raise TemporaryError("the server closed the connection early")
            except TemporaryError as error:
                self._drop()
                self.tries.failure(error)
                continue
            self.tries.progress()
            self._at += len(data)
            self.fetched += len(data)
            have += len(data)
            parts.append(data)
        return b"".join(parts)

    def _reach(self, start: int, end: int) -> None:
        """Brings the stream to `start`: by reading on where it is near, else by a request."""
        if self._stream is not None and self._at <= start < self._end and start - self._at <= GAP:
            while self._at < start:
                data = read(self._stream, min(CHUNK, start - self._at))
                if not data:
                    raise TemporaryError("the server closed the connection early")
                self._at += len(data)
                self.fetched += len(data)
            return
        self._drop()
        end = next((run_end for first, run_end in self._runs if first <= start < run_end), end)
        headers = {"Range": f"bytes={start}-{end - 1}", **if_range(self.validators)}
        response = ask(self.address, headers, self.patience)
        part = range_of(response)
        if response.status in (200, 416) or (part and part.total != self.size):
            with closing(response):
                now = validators(response)
            # A server that gives parts gives the whole only where the file is another one now.
            raise NoRangesError if response.status == 200 and same_file(now, self.validators) else ChangedError
        if part is None or part.first != start or part.last >= self.size or part.last < start:
            with closing(response):
                raise NoRangesError
        if not same_file(validators(response), self.validators):
            with closing(response):
                raise ChangedError
        self._stream, self._at, self._end = response, start, part.last + 1

    def _drop(self) -> None:
        if self._stream is not None:
            with closing(self._stream):
                self._stream = None
